"""Meshes of a sensor's solid cover: checked, described and written."""

import dataclasses
import json

import numpy as np
import pytest

from meshes.solids import flat_pad, read_mesh
from validation.cover_meshes import describe_mesh, make_meshes, write_meshes
from validation.errors import InputError


@pytest.fixture
def pads(small_pad):
    """The small pad of 9 mm x 9 mm x 2 mm on a coarse and on a finer mesh."""
    meshes = tuple(flat_pad(size=(9e-3, 9e-3)).mesh(size, layers=layers) for size, layers in ((3e-3, 2), (2.25e-3, 3)))
    return dataclasses.replace(small_pad, cover=dataclasses.replace(small_pad.cover, make=lambda *_: meshes, _made={}))


def test_a_description_holds_the_numbers_of_the_mesh(pads):
    coarse, fine = map(describe_mesh, make_meshes(pads))
    assert {name: value for name, value in fine.items() if name not in {"digest", "settings"}} == pytest.approx(
        {
            "source": "flat pad", "elements": 4 * 4 * 3, "kind": "hexahedra", "nodes": 9 * 9 * 7,
            "volume_m3": 162e-9, "thickness_m": 2e-3, "scaled_jacobian": 1.0, "inverted": 0, "slivers": 0,
            "through": 3.0, "bonded_m2": 81e-6, "touchable_m2": 81e-6 + 72e-6, "left_out_m2": 0.0,
            "geometry_error_m": 0.0,
        }
    )  # fmt: skip
    assert (coarse["elements"], coarse["settings"]["layers"]) == (3 * 3 * 2, 2)
    assert coarse["digest"] != fine["digest"]
    mesh = make_meshes(pads)[1]
    part = dataclasses.replace(
        mesh, top=mesh.top[:16], left_out=mesh.top[16:], settings={"geometry_error": 3e-6}
    )  # fmt: skip
    described = describe_mesh(part)
    assert (described["touchable_m2"], described["left_out_m2"]) == pytest.approx((81e-6, 72e-6))
    assert (described["geometry_error_m"], described["settings"]) == (3e-6, {"geometry_error": 3e-6})


def test_the_finest_mesh_and_the_quality_of_all_are_written_and_the_finest_is_drawn(pads, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr("validation.scene.cover_scene.show_mesh", lambda *given, **named: drawn.append((given, named)))
    monkeypatch.setattr("validation.scene.draw.write_scene", lambda _, folder: (f"{folder.name}.png",))
    meshes = make_meshes(pads)
    assert write_meshes(pads, meshes, tmp_path) == ("mesh.npz", "mesh.json", f"{tmp_path.name}.png")
    assert read_mesh(tmp_path / "mesh.npz").digest == meshes[1].digest
    found = json.loads((tmp_path / "mesh.json").read_text())
    assert found == {"sensor": "small pad", "meshes": json.loads(json.dumps([describe_mesh(each) for each in meshes]))}
    assert drawn == [((meshes[1], pads.array), {"title": "small pad"})]


def test_bad_meshes_and_texels_beside_the_base_are_refused_with_the_name_of_the_sensor(pads):
    coarse, fine = make_meshes(pads)
    inverted = dataclasses.replace(coarse, nodes=coarse.nodes * [1, 1, -1])
    array = dataclasses.replace(pads.array, centres=pads.array.centres + np.array([9e-3, 0, 0]))
    for changes, fault in (
        ({"make": lambda *_: (inverted, fine)}, "18 of 18 elements are inverted"),
        ({}, "texels are off the base"),
    ):
        cover = dataclasses.replace(pads.cover, _made={}, **changes)
        with pytest.raises(InputError, match=rf"(?s)^{pads.source}: .*{fault}"):
            make_meshes(dataclasses.replace(pads, cover=cover, array=pads.array if changes else array))
