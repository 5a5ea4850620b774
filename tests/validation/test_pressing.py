"""Presses from text, on solid covers: one request, one comparison, one set of files."""

import dataclasses
import json

import numpy as np
import pytest

import validation
from meshes import Pose, Sphere
from meshes.solids import flat_pad
from tests.support.coarse_cells import coarse_cells
from validation.campaign.case import Case
from validation.campaign.reference_press import press_reference
from validation.cover_meshes import make_meshes
from validation.derivation import cover_points
from validation.derivation.cover_points import choose_mesh
from validation.derivation.derive import derive
from validation.json_values import json_text
from validation.places import SolidPlaces
from validation.press_files import write_press

BALL = "sphere:radius=4mm"


@pytest.fixture(scope="module", autouse=True)
def _cells():
    with coarse_cells():
        yield


@pytest.fixture(scope="module")
def press(small_pad):
    return validation.press(small_pad, BALL, load="0.5 N")


@pytest.fixture
def read_pad(small_pad, monkeypatch):
    """The name of a sensor stands for the small pad."""
    monkeypatch.setattr(validation.api, "load", lambda *_, **__: small_pad)
    monkeypatch.setattr(validation.api, "describe", lambda *_, **__: small_pad)


@pytest.mark.slow
def test_forces_balance_as_vectors(press):
    assert np.argmax(press.fem.texel_forces) == 4
    np.testing.assert_allclose(press.fem.force, [0, 0, -0.5], atol=1e-7)
    np.testing.assert_allclose(press.fem.base_force, press.fem.force, atol=1e-9)
    measured = press.fem.unmeasured - press.fem.texel_forces @ press.sensor.array.normals
    np.testing.assert_allclose(measured, press.fem.base_force, atol=1e-9)


def test_the_mesh_is_named_in_the_result(press, small_pad):
    described = json.loads(json_text(press.as_json()))["models"]["fem"]["mesh"]
    assert described["digest"] == make_meshes(small_pad)[-1].digest
    assert described["elements"] == len(press.fem.mesh.cells)


def test_the_fast_model_is_scored(press):
    assert 0 < press.score.misplaced_force < 0.05  # one coarse mesh, contact at its nodes
    described = json.loads(json_text(press.as_json()))["models"]["fast"]
    np.testing.assert_allclose(np.ravel(described["texel_forces"]), press.fast.texel_forces)
    np.testing.assert_allclose(press.fast.texel_forces, press.fem.texel_forces, atol=0.02)
    apart = np.abs(press.fast.texel_forces - press.fem.texel_forces).sum()
    assert described["misplaced_force"] == pytest.approx(apart / 2 / 0.5)
    assert described["force"] == pytest.approx([0, 0, -0.5], abs=1e-6)


def test_files_hold_the_forces(press, tmp_path, monkeypatch):
    monkeypatch.setattr("validation.scene.draw.write_scene", lambda *_: ())
    files = write_press(press, tmp_path)
    assert set(files) == {"press.json", "texels.csv", "contact.csv", "mesh.npz", "press.png"}
    texels = np.loadtxt(tmp_path / "texels.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(texels[:, -1], press.fem.texel_forces, rtol=1e-6, atol=1e-12)
    contact = np.loadtxt(tmp_path / "contact.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(contact[:, 3:].sum(axis=0), [0, 0, -0.5], atol=1e-6)


@pytest.mark.slow
def test_the_friction_of_the_file_or_the_option_reaches_the_finite_elements(press, small_pad):
    sticky = dataclasses.replace(small_pad, friction=np.inf)
    found, smooth = (
        validation.press(sticky, BALL, load="0.5 N", friction=friction, models=("fem",)).fem for friction in (None, "0")
    )
    assert found.assumptions["friction"] == "no slip"
    np.testing.assert_array_equal(smooth.texel_forces, press.fem.texel_forces)
    assert np.abs(found.texel_forces - smooth.texel_forces).max() > 1e-4
    assert np.abs(found.contact_forces[:, :2]).sum() > 1e-3
    case = Case(name="ball", indenter=Sphere(radius=4e-3), shape="ball", load=0.5, pose=press.case.pose)
    kept = press_reference(sticky.cover, sticky.array, case, friction=np.inf)
    np.testing.assert_array_equal(kept.texel_forces, found.texel_forces)


@pytest.mark.slow
def test_a_pose_by_names_is_that_of_a_campaign_file(small_pad):
    """Also its tilt, and the pose stands in the JSON."""
    texts = {"at": "edge", "direction": "oblique y", "yaw": "20deg", "tilt": "0deg,5deg"}
    press = validation.press(small_pad, "box:size=3mmx2mmx3mm", load="0.1 N", models=("fem",), **texts)
    places = SolidPlaces(sensor=small_pad)
    assert press.case.pose.is_close_to(places.find(places.parse(texts, "case.")))
    described = press.as_json()
    assert described["tilt"] == pytest.approx([0.0, np.radians(5)])
    assert described["yaw"] == pytest.approx(np.radians(20))
    np.testing.assert_allclose(described["at"], places.named["edge"], atol=1e-6)
    assert np.dot(described["direction"], [0, 0, -1]) == pytest.approx(np.cos(np.radians(30)))


@pytest.mark.slow
def test_a_curve_of_a_solid_ends_at_the_press(small_pad, read_pad, softcover, tmp_path):
    words = ("press", "flat-pad", "--indenter", BALL, "--load", "0.5N", "--model", "fem", "--json")
    status, out, _ = softcover(*words, "--curve", "2", "--out", "curve")
    assert status == 0
    half, whole = json.loads(out)["curve"]
    assert (half["load_N"], whole["load_N"]) == pytest.approx((0.25, 0.5), rel=1e-6)
    known = validation.press(small_pad, BALL, load="0.5 N", models=("fem",)).fem
    assert whole["depth_m"] == pytest.approx(known.depth)
    assert (tmp_path / "curve" / "curve.csv").exists()


@pytest.mark.slow
def test_the_fast_model_alone(small_pad, read_pad, softcover):
    words = ("press", "flat-pad", "--indenter", BALL, "--model", "fast")
    status, out, _ = softcover(*words, "--load", "0.5N", "--json")
    assert status == 0
    fast = json.loads(out)["models"]
    assert list(fast) == ["fast"]
    both = validation.press(small_pad, BALL, load="0.5 N").fast
    np.testing.assert_allclose(np.ravel(fast["fast"]["texel_forces"]), both.texel_forces, rtol=1e-6, atol=1e-9)
    status, out, _ = softcover(*words, "--depth", "0.1mm", "--json")
    assert status == 0
    deep = json.loads(out)
    known = validation.press(small_pad, BALL, depth="0.1 mm", models=("fem",)).fem
    assert deep["models"]["fast"]["total_force"] == pytest.approx(known.total_force, rel=1e-6)


def test_derived_parameters_hold_the_cover(small_pad):
    derivation = derive(small_pad)
    parameters = derivation.parameters
    assert derivation.gaussian.sigma[0] == pytest.approx(derivation.gaussian.sigma[1], rel=1e-3)
    assert derivation.gaussian.residual < 0.2
    assert parameters.surface.influence.shape[0] == parameters.array.count
    assert parameters.surface.thickness == pytest.approx(2e-3)


def limit_loads(monkeypatch, most):
    monkeypatch.setattr(cover_points, "_SETTINGS", dataclasses.replace(cover_points.LatticeSettings(), most=most))


def test_the_mesh_of_the_fast_model_is_the_second_or_a_smaller_one(monkeypatch):
    pad = flat_pad(size=(9e-3, 9e-3))
    coarse, middle, fine = (pad.mesh(size, layers=2) for size in (3e-3, 1.5e-3, 0.5e-3))
    limit_loads(monkeypatch, 200)
    assert choose_mesh((coarse, middle, fine)) is middle
    assert choose_mesh((coarse,)) is coarse
    huge = flat_pad(size=(60e-3, 60e-3)).mesh(1.5e-3, layers=2)
    assert choose_mesh((coarse, huge)) is coarse
    assert choose_mesh((huge,)) is None


@pytest.mark.slow
def test_where_the_meshes_are_too_fine_the_fast_model_is_left_out_and_said(
    small_pad, read_pad, monkeypatch, softcover, tmp_path
):
    limit_loads(monkeypatch, 5)
    monkeypatch.setattr("validation.scene.draw.write_scene", lambda *_: ())  # `scene/test_draw.py` draws
    status, _, err = softcover("derive", "flat-pad", "--out", str(tmp_path / "derived"))
    assert status == 0
    assert "no contact of the cover" in err
    words = ("press", "flat-pad", "--indenter", BALL, "--load", "0.5N")
    status, out, err = softcover(*words, "--json")
    assert status == 0
    assert list(json.loads(out)["models"]) == ["fem"]
    assert "too fine for the fast model" in err
    assert softcover(*words, "--model", "fast")[0] == 2


def test_the_default_pose_is_above_the_middle(press):
    assert press.case.pose.is_close_to(Pose(point=(0.0, 0.0, 2e-3)))
