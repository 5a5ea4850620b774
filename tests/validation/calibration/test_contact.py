"""Forces on texels under many loads: what is solved, and how shares are interpolated between loads."""

import numpy as np
import pytest

import fastmodel
from fastmodel import Gaussian
from meshes import Box, Sphere, TexelArray
from validation.calibration.model import ContactMethod, Pose, make_fast_method

ARRAY = TexelArray.grid(1, 2, 3e-3)
BALL, FACE = Sphere(radius=4e-3), Box(size=(3e-3, 3e-3, 2e-3))


@pytest.fixture
def solved():
    """Loads and poses that were solved."""
    return []


@pytest.fixture
def method(solved):
    def solve(_indenter, load, pose):
        solved.append((load, pose))
        first = 0.5 + 0.1 * np.log(load)  # linear in the logarithm of the load
        return load * np.array([first, 1 - first])

    return ContactMethod(name="made up", about="", array=ARRAY, solve=solve)


def expect(loads):
    first = 0.5 + 0.1 * np.log(np.maximum(loads, 1e-9))
    return loads[:, None] * np.column_stack([first, 1 - first])


@pytest.mark.parametrize("count", [1, 7, 8, 30])
def test_up_to_seven_loads_are_solved_and_others_interpolated(method, solved, count):
    loads = np.array([5.0]) if count == 1 else np.linspace(0.5, 8.0, count)
    found = method.texel_forces(BALL, np.append(loads, 0.0), Pose(0.0, 0.0))
    np.testing.assert_allclose(found[:-1], expect(loads))
    assert not found[-1].any()
    assert len(solved) == min(count, 7)
    expected = loads if count <= 7 else np.geomspace(0.5, 8.0, 7)
    np.testing.assert_allclose([load for load, _ in solved], expected)
    method.texel_forces(BALL, loads, Pose(0.0, 0.0))
    assert len(solved) == min(count, 7)  # nothing is solved twice
    method.texel_forces(BALL, loads[:1], Pose(1e-3, 0.0))
    assert len(solved) == min(count, 7) + 1


def test_under_a_flat_level_face_forces_are_in_proportion_to_the_load(method, solved):
    loads = np.array([0.0, 2.0, 4.0])
    np.testing.assert_allclose(method.texel_forces(FACE, loads, Pose(0.0, 0.0)), loads[:, None] * [0.5, 0.5])
    assert solved == [(1.0, Pose(0.0, 0.0))]
    for tilted in (Pose(0.0, 0.0, tilt_x=0.01), Pose(0.0, 0.0, tilt_y=0.01)):
        np.testing.assert_allclose(method.texel_forces(FACE, loads, tilted), expect(loads))


def test_the_fast_model_is_asked_at_the_pose_and_reads_nothing_beside_the_array():
    parameters = fastmodel.Parameters(
        array=TexelArray.grid(4, 3, 3e-3), spread=Gaussian.from_sigma(0.5), electronics=fastmodel.WTS_0614_34
    )
    boxes = make_fast_method(parameters)
    assert (boxes.name, boxes.gain_error) == ("fast model, boxes", 0.34)
    pose = Pose(1e-3, -2e-3, yaw=0.3)
    found = boxes.solve(FACE, 2.0, pose)
    alone = fastmodel.indent(parameters, FACE, load=2.0, at=(1e-3, -2e-3), yaw=0.3, contact="boxes")
    np.testing.assert_allclose(found, alone.texel_forces)
    assert not boxes.solve(FACE, 2.0, Pose(0.1, 0.0)).any()
    cover = make_fast_method(fastmodel.load("wts-0614-34"))
    assert (cover.name, cover.gain_error) == ("fast model, cover", 0.033)
    assert make_fast_method(fastmodel.load("wts-0614-34"), "boxes").gain_error == 0.34


@pytest.mark.parametrize("pose", [Pose(0.01, 0.02, 0.6), Pose(-0.012, -0.025, 0.3), Pose(0.0, 0.0)])
def test_the_cover_goes_on_under_an_indenter_at_the_edge_as_in_a_single_press(pose):
    parameters, face = fastmodel.load("wts-0614-34"), Box(size=(20e-3, 20e-3, 5e-3))
    found = make_fast_method(parameters, "cover").solve(face, 5.0, pose)
    alone = fastmodel.indent(parameters, face, load=5.0, at=(pose.x, pose.y), yaw=pose.yaw, contact="cover")
    np.testing.assert_allclose(found, alone.texel_forces, atol=1e-6)
