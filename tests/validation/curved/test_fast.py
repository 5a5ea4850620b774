"""The fast model of a sensor with a curved cover, and its place in the results."""

import json

import numpy as np
import pytest

from meshes import Sphere
from meshes.solids import SolidMesh, flat_pad
from validation.cli.curved.press import PressText, press_by_fast_model
from validation.curved import fast
from validation.curved.fast import choose_mesh
from validation.curved.press import press_sensor
from validation.derivation.derive import derive
from validation.errors import InputError
from validation.json_values import json_text

BALL = PressText(indenter="sphere:radius=4mm", at=None, direction=None, yaw="0deg")


def test_a_press_by_both_models_states_what_the_fast_one_misplaces(small_pad):
    press = press_sensor(small_pad, Sphere(radius=4e-3), shape="ball", load=0.5, fast=True)
    assert 0 < press.fast.misplaced < 0.05  # one coarse mesh, contact at its nodes
    described = json.loads(json_text(press.as_json()))["models"]["fast"]
    np.testing.assert_allclose(described["texel_forces"], press.fast.texel_forces)
    np.testing.assert_allclose(described["texel_forces"], press.fem.texel_forces, atol=0.02)
    assert described["misplaced_force"] == press.fast.misplaced
    apart = np.abs(press.fast.texel_forces - press.fem.texel_forces).sum()
    assert press.fast.misplaced == pytest.approx(apart / 2 / 0.5)
    assert press_sensor(small_pad, Sphere(radius=4e-3), shape="ball", load=0.5).fast is None


def test_derived_parameters_hold_the_cover(small_pad):
    derivation = derive(small_pad)
    parameters = derivation.parameters
    assert derivation.gaussian.sigma[0] == pytest.approx(derivation.gaussian.sigma[1], rel=1e-3)
    assert derivation.gaussian.residual < 0.2
    assert parameters.surface.influence.shape[0] == parameters.array.count
    assert parameters.surface.thickness == pytest.approx(2e-3)


def test_the_fast_model_alone(small_pad, capsys):
    press_by_fast_model(small_pad, BALL, 0.5, None, json=True)
    found = json.loads(capsys.readouterr().out)
    assert found["models"]["fast"]["force"] == pytest.approx([0, 0, -0.5], abs=1e-6)
    press_by_fast_model(small_pad, BALL, 0.5, None, json=False)
    assert "fast model" in capsys.readouterr().out
    with pytest.raises(InputError, match="takes a load"):
        press_by_fast_model(small_pad, BALL, None, None, json=False)


def test_the_mesh_of_the_fast_model_is_the_second_or_a_smaller_one():
    pad = flat_pad(size=(9e-3, 9e-3))
    coarse, middle, fine = (pad.mesh(size, layers=2) for size in (3e-3, 1.5e-3, 0.5e-3))
    assert choose_mesh((coarse, middle, fine)) is middle
    assert choose_mesh((coarse,)) is coarse
    huge = flat_pad(size=(60e-3, 60e-3)).mesh(1.5e-3, layers=2)
    assert choose_mesh((coarse, huge)) is coarse
    assert choose_mesh((huge,)) is None


def test_nodes_between_the_corners_of_tetrahedra_count(monkeypatch):
    """They carry displacements too, and are three times as many as corners."""
    nodes = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]) * 1e-3
    base, top = np.array([[0, 2, 1]]), np.array([[0, 1, 3], [1, 2, 3], [0, 3, 2]])
    mesh = SolidMesh(nodes=nodes, cells=np.array([[0, 1, 2, 3]]), base=base, top=top, sides=base[:0], source="one")
    for most, found in ((10, mesh), (9, None)):
        monkeypatch.setattr(fast, "_MOST_NODES", most)
        assert choose_mesh((mesh,)) is found


def test_derive_says_where_the_fast_model_is_missing(small_pad, monkeypatch, softcover, tmp_path):
    monkeypatch.setattr(fast, "_MOST_NODES", 9)
    monkeypatch.setattr("validation.scene.draw.write_scene", lambda *_: ("cover.png",))
    derivation = derive(small_pad)
    monkeypatch.setattr("validation.derivation.derive.derive_cover", lambda *_args, **_options: derivation)
    status, _, err = softcover("derive", "flat-pad", "--out", str(tmp_path / "derived"))
    assert status == 0
    assert "no contact of the cover" in err
