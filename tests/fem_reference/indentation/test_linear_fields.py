"""Fields under wide faces, whose middle is compressed without lateral strain: E (1 - nu) / ((1 + nu) (1 - 2 nu))."""

import numpy as np
import pytest

from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.indentation import linear_fields
from fem_reference.indentation.linear_fields import solve_linear_fields, state_missing_fields
from meshes import Box, Cylinder, TexelArray
from meshes.pose import Place, Pose
from tests.support.rubber import YOUNGS_MODULUS, make_cover

ARRAY = TexelArray.grid(3, 3, pitch=3.4e-3)
NU, THICKNESS, PRESSURE, DEPTH = 0.3, 2e-3, 5e3, 3e-5
OEDOMETRIC = YOUNGS_MODULUS * (1 - NU) / ((1 + NU) * (1 - 2 * NU))
BOX = Box(size=(16e-3, 12e-3, 4e-3))


@pytest.fixture(autouse=True)
def coarse(monkeypatch):
    """Few elements: the middle under a wide face needs no more."""
    for name, value in (("_SOLID_COUNT", 2), ("_MOST", 4), ("_COUNT", 4)):
        monkeypatch.setattr(linear_fields, name, value)


def lay_contact(indenter):
    """Points and forces of a uniform pressure under a face, in the frame of the indenter."""
    half = indenter.footprint
    if indenter.axisymmetric:
        radius = (np.arange(500) + 0.5) / 500 * half[0]
        return np.column_stack([radius, 0 * radius, 2 * np.pi * radius * PRESSURE * half[0] / 500])
    lines = [(np.arange(48) + 0.5) / 24 * each - each for each in half]
    x, y = (each.ravel() for each in np.meshgrid(*lines))
    return np.column_stack([x, y, np.full(len(x), PRESSURE * 4 * half[0] * half[1] / len(x))])


def solve(indenter, pose, *, friction=0.0, size=None, base="bonded"):
    cover = make_cover(NU, "linear-elastic", thickness=THICKNESS, size=size, base=base)
    path = LoadingPath(cover=cover, indenter=indenter, targets=(DEPTH,), control="depth", friction=friction)
    return solve_linear_fields(path, lay_contact(indenter), Place(array=ARRAY, pose=pose), DEPTH)


CASES = pytest.mark.parametrize(
    ("indenter", "pose", "size"),
    [
        (BOX, Pose.planar(at=(1e-3, -0.5e-3), yaw=0.4), None),
        pytest.param(BOX, Pose.planar(at=(0.7e-3, 0.0)), (24e-3, 18e-3), marks=pytest.mark.slow),
        pytest.param(BOX, Pose.planar(yaw=np.pi / 2), (18e-3, 24e-3), marks=pytest.mark.slow),
        (Cylinder(radius=8e-3), Pose.planar(at=(1e-3, -0.5e-3)), None),
    ],
    ids=["wide", "bounded", "bounded, turned", "round"],
)


def find_middle(fields, indenter, pose):
    """Nodes under the middle of the face, two thicknesses from its sides, and their positions in its frame."""
    x, y = pose.to_indenter(*fields.position[:, :2].T)
    rest = np.array(indenter.footprint) - 2 * THICKNESS
    return (np.abs(x) < rest[0]) & (np.abs(y) < rest[1]), np.column_stack([x, y])


@CASES
def test_a_uniform_pressure_compresses_the_middle_without_lateral_strain(indenter, pose, size):
    fields = solve(indenter, pose, size=size)
    middle, _ = find_middle(fields, indenter, pose)
    z = fields.position[middle, 2]
    assert middle.sum() > 5
    assert set(np.round(z / THICKNESS, 6)) >= {0.0, 1.0}
    for axis, expected in ((0, PRESSURE * NU / (1 - NU)), (1, PRESSURE * NU / (1 - NU)), (2, PRESSURE)):
        assert np.median(fields.stress[middle, axis, axis]) == pytest.approx(-expected, rel=0.06)
        np.testing.assert_allclose(fields.stress[middle, axis, axis], -expected, rtol=0.2)
    sunk = fields.displacement[middle, 2]
    np.testing.assert_allclose(sunk, -PRESSURE * z / OEDOMETRIC, atol=0.05 * PRESSURE * THICKNESS / OEDOMETRIC)
    if size is not None:
        np.testing.assert_allclose(np.abs(fields.position[:, :2]).max(axis=0), np.array(size) / 2)
    elif not fields.axisymmetric:  # in the frame of the array, turned about the axis of the indenter
        centre = (fields.position[:, :2].max(axis=0) + fields.position[:, :2].min(axis=0)) / 2
        np.testing.assert_allclose(centre, pose.at, atol=1e-9)
    assert fields.axisymmetric == indenter.axisymmetric
    # the base beyond the face carries nothing
    far, place = find_middle(fields, indenter, pose)
    beyond = (np.abs(place) > np.array(indenter.footprint) + 2.5 * THICKNESS).any(axis=1)
    assert not (far & beyond).any()
    if beyond.any():
        assert np.abs(fields.stress[beyond, 2, 2]).max() < 0.15 * PRESSURE


@CASES
def test_a_face_without_slip_takes_the_top_along(indenter, pose, size):
    fields = solve(indenter, pose, size=size, friction=np.inf)
    x, y = pose.to_indenter(*fields.position[:, :2].T)
    top = fields.position[:, 2] > THICKNESS * (1 - 1e-9)
    half = np.array(indenter.footprint) * (1 + 1e-9)
    under = top & (
        (np.hypot(x, y) < half[0]) if indenter.axisymmetric else (np.abs(x) < half[0]) & (np.abs(y) < half[1])
    )
    assert under.sum() > 5
    np.testing.assert_allclose(
        fields.displacement[under], np.broadcast_to([0, 0, -DEPTH], (under.sum(), 3)), atol=1e-12
    )
    assert (fields.displacement[top & ~under, 2] > -0.999 * DEPTH).all()
    middle, _ = find_middle(fields, indenter, pose)
    np.testing.assert_allclose(fields.stress[middle, 2, 2], -OEDOMETRIC * DEPTH / THICKNESS, rtol=0.03)


def test_a_sliding_cover_of_limited_size_needs_a_load_that_mirrors():
    cover = make_cover(NU, "linear-elastic", size=(20e-3, 20e-3), base="sliding")
    path = LoadingPath(cover=cover, indenter=BOX, targets=(DEPTH,), control="depth")
    assert state_missing_fields(path, Pose()) == ""
    assert "press its middle or bond its base" in state_missing_fields(path, Pose.planar(at=(1e-3, 0.0)))
    assert len(solve(BOX, Pose(), size=(20e-3, 20e-3), base="sliding").position)


def test_shear_away_from_the_axis_is_the_shear_stress_of_the_top():
    """In proportion to the distance from the axis, without pressure; the fields are along x from the axis."""
    pin, slope = Cylinder(radius=8e-3), 4e3 / 8e-3
    cover = make_cover(NU, "linear-elastic", thickness=THICKNESS)
    path = LoadingPath(cover=cover, indenter=pin, targets=(DEPTH,), control="depth", friction=0.3)
    radius = lay_contact(pin)[:, 0]
    shear = slope * radius * 2 * np.pi * radius * 8e-3 / 500
    angle = 0.7 * np.arange(500)
    c, s = np.cos(angle), np.sin(angle)
    contact = np.column_stack([radius * c, radius * s, 0 * c, shear * c, shear * s])
    fields = solve_linear_fields(path, contact, Place(array=ARRAY, pose=Pose()), DEPTH)
    top = fields.position[:, 2] > THICKNESS * (1 - 1e-9)
    x = fields.position[:, 0]
    inside = top & (x > 2e-3) & (x < 6e-3)
    assert inside.sum() > 5
    assert fields.stress[inside, 0, 2] == pytest.approx(slope * x[inside], rel=0.1)
    assert (fields.displacement[inside, 0] > 0).all()
    assert np.abs(fields.stress[inside, 2, 2]).max() < 0.1 * slope * 6e-3
