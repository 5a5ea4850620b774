"""Every contact method on whole models: balance, symmetry, and errors for wrong use."""

import dataclasses

import mujoco
import numpy as np
import pytest
from scipy.special import ndtr

import fastmodel
from fastmodel import BoxTexels, Butterworth, FastModelError, Placement, Plate, indent, indent_together
from fastmodel.errors import LifeCycleError, ParametersError
from meshes import Box, Cylinder, LetterH, Nut, RoundedTip, Sphere, TexelArray
from meshes.catalogue import ARRAYS
from tests.support.bent_array import bent_array
from tests.support.cover_data import WTS, cells, parameters
from tests.support.quaternions import rotate
from tests.support.scenes import add_body, bind, make_spec, run, simulate

NAMES = ("boxes", "foundation", "cover")
PARAMETERS = parameters()
SHAPES = [
    Sphere(radius=5e-3),
    Box(size=(12e-3, 6e-3, 5e-3)),
    Cylinder(radius=5e-3),
    Nut(across=13e-3, bore=8e-3),
    LetterH(size=(12e-3, 16e-3), bar=4e-3),
    RoundedTip(),
]


@pytest.mark.parametrize("method", NAMES)
@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: type(s).__name__)
def test_the_weight_is_carried_and_nothing_is_negative(shape, method):
    for yaw in (0.0, np.pi / 4, np.pi / 2):
        found = indent(PARAMETERS, shape, load=0.9, at=(0.7e-3, -1.1e-3), yaw=yaw, contact=method)
        assert found.total_force == pytest.approx(0.9, rel=1e-3)
        assert found.contact_forces.sum() <= found.total_force * (1 + 1e-9)
        if max(shape.footprint) < 8e-3:  # else it may reach beyond the texels
            assert found.contact_forces.sum() == pytest.approx(0.9, rel=1e-3)
        assert found.contact_forces.min() >= 0
        assert found.texel_forces.sum() + found.outside == pytest.approx(0.9, rel=1e-3)


@pytest.mark.parametrize("method", NAMES)
def test_mirrored_poses_mirror_the_image(method):
    shape = LetterH(size=(12e-3, 16e-3), bar=4e-3)
    right = indent(PARAMETERS, shape, load=2.0, at=(1.1e-3, 2.3e-3), yaw=0.3, contact=method)
    left = indent(PARAMETERS, shape, load=2.0, at=(-1.1e-3, 2.3e-3), yaw=-0.3, contact=method)
    # the boxes of an edge may touch in one more point on one side: their share jumps there
    tolerance = 0.2 if method == "boxes" else 2e-3
    apart = WTS.image(left.texel_forces) - WTS.image(right.texel_forces)[:, ::-1]
    assert np.abs(apart).max() < tolerance


@pytest.mark.parametrize("method", ["foundation", "cover"])
def test_a_flat_face_is_shared_by_area_not_by_contact_points(method):
    """What the boxes get wrong by a quarter."""
    shape, at = Box(size=(10e-3, 10e-3, 5e-3)), (0.7e-3, -1.1e-3)
    cells_ = (np.arange(40) + 0.5) / 40 - 0.5
    dx, dy = (cell.ravel() * 3.4e-3 for cell in np.meshgrid(cells_, cells_))
    share = np.isfinite(shape.gap(WTS.centres[:, :1] + dx - at[0], WTS.centres[:, 1:2] + dy - at[1])).mean(axis=1)
    share /= share.sum()
    apart = {
        name: np.abs(indent(PARAMETERS, shape, load=1.0, at=at, contact=name).contact_forces - share).sum() / 2
        for name in (method, "boxes")
    }
    # the cover itself presses harder along edges, so even shares are not its aim
    assert apart[method] < (0.8 if method == "cover" else 0.25) * apart["boxes"]


def test_a_flat_face_on_a_foundation_is_felt_as_uniform_pressure_through_the_cover():
    """Force on a texel: pressure times the Gaussian way to the base (sigma of half the thickness), off the grid."""
    half, at, load = np.array([4.9e-3, 3.1e-3]), np.array([1.1e-3, -0.6e-3]), 2.0
    found = indent(PARAMETERS, Box(size=(*(2 * half), 5e-3)), load=load, at=tuple(at), contact="foundation")
    shares = []
    for axis in range(2):
        place = np.linspace(at[axis] - half[axis], at[axis] + half[axis], 2001) - WTS.centres[:, axis, None]
        edge = WTS.texel_size[axis] / 2
        way = ndtr((edge - place) / 1e-3) - ndtr((-edge - place) / 1e-3)
        shares.append(np.trapezoid(way, axis=1) / 2000)
    assert np.abs(found.texel_forces - load * np.prod(shares, axis=0)).sum() / 2 < 0.025 * load
    spread = PARAMETERS.spread.operator(WTS) @ found.contact_forces
    assert np.abs(found.texel_forces - spread).sum() / 2 > 0.1 * load


@pytest.mark.parametrize("method", ["foundation", "cover"])
def test_a_free_body_presses_where_its_weight_stands(method):
    block = Box(size=(10e-3, 10e-3, 10e-3))
    at = (0.7e-3, -1.1e-3)
    placement = Placement(indenter=block, load=2.0, at=at, guided=False, centre=(2e-3, -1e-3))
    found = indent_together(PARAMETERS, [placement], contact=method)
    pressed = found.contact_forces @ WTS.centres[:, :2] / found.contact_forces.sum()
    np.testing.assert_allclose(pressed, np.add(at, [2e-3, -1e-3]), atol=0.6e-3)


def scene(turn, method="cover", speed=0.0, **settings):
    """A 200 g block on a tilted array, held on a slide along its normal and one along it."""
    spec = make_spec(gravity=rotate(turn, np.array([[0, 0, -9.80665]]))[0])
    holder = spec.worldbody.add_body(name="holder", quat=turn, pos=[0.1, -0.2, 0.3])
    sensor = fastmodel.attach(spec, "holder", PARAMETERS, contact=method, **settings)
    add_body(spec, "box", [4e-3, 3e-3, 5e-3], [-4e-3, 1e-3, 5e-3], slides="xz", parent=holder, mass=0.2, condim=1)
    model, data = simulate(spec, sensor, 0)
    data.qvel[0] = speed
    return sensor, model, data


@pytest.mark.parametrize("method", ["foundation", "cover"])
def test_sliding_is_smooth_and_carries_the_weight(method):
    frames = run(*scene(np.array([1.0, 0, 0, 0]), method, speed=20e-3), 400)
    total = np.array([frame.texel_forces.sum() for frame in frames[len(frames) // 2 :]])
    assert total.std() < 0.005 * 0.2 * 9.80665
    peak = np.array([frame.texel_forces.max() for frame in frames[len(frames) // 2 :]])
    assert np.abs(np.diff(peak)).max() < 0.05 * peak.max()


def test_a_reset_under_load_starts_in_the_steady_state():
    sensor, _, _ = scene(np.array([1.0, 0, 0, 0]))
    forces = np.zeros(84)
    forces[30] = 1.0
    sensor.reset(forces)
    image = WTS.image(sensor.frame().texel_forces)
    assert image.argmax() == 30
    assert image.sum() + sensor.outside() == pytest.approx(1)


def test_costly_methods_are_sampled_as_seldom_as_frames_and_filter_allow():
    for cutoff, every in ((10.0, 3), (100.0, 2), (200.0, 1)):
        changed = dataclasses.replace(PARAMETERS, filter=Butterworth(cutoff_hz=cutoff))
        spec = mujoco.MjSpec()
        spec.option.timestep = 1e-3
        sensor = fastmodel.attach(spec, "world", changed)
        bind(sensor, spec.compile())
        assert sensor._interval == every


def test_the_default_is_the_best_method_that_the_parameters_allow():
    assert indent(PARAMETERS, SHAPES[0], load=1.0).method == "cover"
    assert indent(PARAMETERS, SHAPES[0], load=1.0).depth > 0
    bare = dataclasses.replace(PARAMETERS, surface=None)
    assert indent(bare, SHAPES[0], load=1.0).method == "boxes"


def test_masked_texels_carry_but_do_not_measure_and_force_beside_the_texels_is_outside():
    array = ARRAYS["sdh2-distal"]
    found = indent(parameters(array), Sphere(radius=3e-3), load=1.0, at=tuple(array.centres[0, :2]), contact="cover")
    assert found.contact_forces[0] > 0.3
    assert np.all(found.texel_forces[~array.active] == 0)
    assert found.outside > 0.3
    edge = WTS.centres[:, 0].max() + 1.7e-3
    found = indent(PARAMETERS, Cylinder(radius=2e-3), load=1.0, at=(edge, 1.7e-3), contact="cover")
    assert found.total_force == pytest.approx(1, rel=1e-3)
    assert 0.3 < found.contact_forces.sum() < 0.7
    assert found.outside > 0.3


def test_wrong_use_raises_an_error_that_names_the_fault():
    sphere = SHAPES[0]
    bare = dataclasses.replace(PARAMETERS, surface=None)
    with pytest.raises(ParametersError, match="'cover' needs the cover's cells"):
        indent(bare, sphere, load=1.0, contact="cover")
    with pytest.raises(FastModelError, match="'area' was removed: use 'foundation'"):
        indent(PARAMETERS, sphere, load=1.0, contact="area")
    assert indent(dataclasses.replace(bare, array=bent_array()), sphere, load=1.0).method == "boxes"
    with pytest.raises(FastModelError, match="valid names: boxes, cover, curved, default, foundation"):
        indent(PARAMETERS, sphere, load=1.0, contact="covers")
    with pytest.raises(FastModelError, match="pitch"):
        dataclasses.replace(PARAMETERS, surface=cells(TexelArray.grid(2, 2, 3e-3)))
    spec = mujoco.MjSpec()
    sensor = fastmodel.attach(spec, "world", PARAMETERS)
    with pytest.raises(LifeCycleError, match="sensor/plate"):
        sensor.bind(mujoco.MjSpec().compile())
    for settings in ({"height": 0.0}, {"margin": -1}, {"contype": 2**31}, {"contype": -1}):
        for method in (Plate, BoxTexels):
            if method is Plate or "margin" not in settings:
                with pytest.raises(ValueError, match=next(iter(settings))):
                    method(**settings)
