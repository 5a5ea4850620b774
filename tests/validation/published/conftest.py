"""A small press with contacts written down by hand."""

import numpy as np
import pytest

import fastmodel
from fastmodel import FastIndentation
from fem_reference.closed_form.layer import tabulate_texel_response
from meshes import TexelArray
from validation.campaign.case import Case
from validation.published.scene import ContactMap, Contacts, Scene

PITCH, LOAD = 2e-3, 2.0


@pytest.fixture(scope="session")
def parameters(wts):
    return fastmodel.Parameters(array=wts, spread=fastmodel.Gaussian.from_sigma(0.5), electronics=fastmodel.WTS_0614_34)


@pytest.fixture(scope="session")
def scene(bonded):
    """Press 4 x 3 texels of 2 mm with a ball, whose axis stands over no symmetric place."""
    array, cover = TexelArray.grid(4, 3, PITCH), bonded(0.45)
    at = np.array([0.5e-3, 0.7e-3])
    contacts = Contacts(
        points=np.array([[0.2e-3, 0.9e-3, 0.0], [1.2e-3, 1.0e-3, 0.0], [0.1e-3, -0.3e-3, 0.0]]),
        normals=np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.0, 1.0]]),
        forces=np.array([1.0, 0.5, 0.6]),
        texels=np.array([7, 8, 4]),
        depths=np.array([0.3e-3, 0.2e-3, 0.1e-3]),
    )
    pressed = np.zeros(array.count)
    pressed[[7, 8, 4]] = 1.0, 0.4, 0.6
    boxes = FastIndentation(
        contact_forces=pressed,
        texel_forces=pressed,
        outside=0.0,
        total_force=LOAD,
        chatter=0.0,
        depth=None,
        method="boxes",
        fewest_cells=None,
        warnings=(),
        seconds=0.0,
    )
    edges = (np.arange(24) + 0.5) * 0.25e-3 - 3e-3
    x, y = (each.ravel() for each in np.meshgrid(edges, edges))
    return Scene(
        case=Case.read("ball", "sphere:radius=8mm", f"{LOAD} N", at="0.5mm,0.7mm"),
        cover=cover,
        array=array,
        boxes=boxes,
        contacts=contacts,
        plate=contacts,
        response=tabulate_texel_response(cover, array.texel_size),
        texel_gaps=((array.centres[:, :2] - at) ** 2).sum(axis=1) / 16e-3,
        map=ContactMap(np.stack([x, y], axis=-1), ((x - at[0]) ** 2 + (y - at[1]) ** 2) / 16e-3, 0.25e-3**2),
    )
