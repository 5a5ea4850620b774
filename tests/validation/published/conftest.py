"""A small press with contacts written down by hand."""

import numpy as np
import pytest

import fastmodel
from fastmodel import FastIndentation
from fem_reference.closed_form.layer import tabulate_texel_response
from meshes import TexelArray
from validation.campaign.case import Case
from validation.published.scene import ContactMap, Contacts, Scene

#: Load of the presses [N].
LOAD = 2.0


@pytest.fixture(scope="session")
def parameters(wts):
    return fastmodel.Parameters(array=wts, spread=fastmodel.Gaussian.from_sigma(0.5), electronics=fastmodel.WTS_0614_34)


def make_scene(cover, array, at, contacts, *, edge=0.25e-3, half=3e-3):
    """Press 4 x 3 texels with a ball of 8 mm; its height is d^2 / 16 mm at the distance d from its axis."""
    pressed = np.bincount(contacts.texels, contacts.pushes, array.count)
    boxes = FastIndentation(
        contact_forces=pressed, texel_forces=pressed, outside=0.0, total_force=float(pressed.sum()), chatter=0.0,
        depth=None, method="boxes", fewest_cells=None, warnings=(), seconds=0.0,
    )  # fmt: skip
    edges = (np.arange(round(2 * half / edge)) + 0.5) * edge - half
    x, y = (each.ravel() for each in np.meshgrid(edges, edges))
    return Scene(
        case=Case.read("ball", "sphere:radius=8mm", f"{LOAD} N", at=f"{1e3 * at[0]:g}mm,{1e3 * at[1]:g}mm"),
        cover=cover, array=array, boxes=boxes, contacts=contacts, plate=contacts,
        response=tabulate_texel_response(cover, array.texel_size),
        texel_gaps=((array.centres[:, :2] - at) ** 2).sum(axis=1) / 16e-3,
        map=ContactMap(np.stack([x, y], axis=-1), ((x - at[0]) ** 2 + (y - at[1]) ** 2) / 16e-3, edge**2),
    )  # fmt: skip


@pytest.fixture(scope="session")
def scene(bonded):
    """Texels of 2 mm; the axis of the ball stands over no symmetric place."""
    contacts = Contacts(
        points=np.array([[0.2e-3, 0.9e-3, 0.0], [1.2e-3, 1.0e-3, 0.0], [0.1e-3, -0.3e-3, 0.0]]),
        normals=np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.0, 1.0]]),
        forces=np.array([1.0, 0.5, 0.6]),
        texels=np.array([7, 8, 4]),
        depths=np.array([0.3e-3, 0.2e-3, 0.1e-3]),
    )
    return make_scene(bonded(0.45), TexelArray.grid(4, 3, 2e-3), np.array([0.5e-3, 0.7e-3]), contacts)


@pytest.fixture(scope="session")
def oblong(bonded):
    """Texels of 1.7 mm x 2.4 mm at a pitch of 2 mm x 3 mm, loaded at a corner; some force is beside the array."""
    contacts = Contacts(
        points=np.array(
            [[-1.4e-3, 3.3e-3, 0.0], [-1.8e-3, 4.6e-3, 1e-4], [0.4e-3, 4.9e-3, 0.0], [0.3e-3, 2.7e-3, 0.0]]
        ),
        normals=np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.28, 0.96], [0.0, 0.0, 1.0]]),
        forces=np.array([0.8, 0.5, 0.5, 0.32]),
        texels=np.array([9, 9, 10, 7]),
        depths=np.array([0.3e-3, 0.2e-3, 0.1e-3, 0.15e-3]),
    )
    array = TexelArray.grid(4, 3, (2e-3, 3e-3), texel_size=(1.7e-3, 2.4e-3))
    return make_scene(bonded(0.4), array, np.array([-1.5e-3, 3.9e-3]), contacts, half=7e-3)
