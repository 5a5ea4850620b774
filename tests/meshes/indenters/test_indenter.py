"""What every indenter offers: its gap, its solids, its properties."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from meshes import (
    Box,
    Cone,
    Cylinder,
    FlatPunch,
    LetterH,
    Nut,
    Prism,
    Roller,
    RoundedTip,
    Sphere,
    read_stl,
    tilt_indenter,
)
from tests.support.sampled_shapes import is_flat_where_sampled, is_symmetric_where_sampled

NUT, LETTER = Nut(across=13e-3, bore=8e-3), LetterH(size=(12e-3, 16e-3), bar=4e-3)
CONE = Cone(angle=np.radians(120), radius=4e-3)
ARROW = Prism(points=((0.0, 6e-3), (-5e-3, -4e-3), (0.0, -2e-3), (4e-3, -4e-3)))
SHAPES = [
    Sphere(radius=5e-3),
    RoundedTip(),
    Cylinder(radius=4e-3),
    Box(size=(10e-3, 6e-3, 5e-3)),
    Roller(radius=4e-3, length=12e-3),
    CONE,
    NUT,
    LETTER,
    ARROW,
]
GEOMS = {
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "hull": mujoco.mjtGeom.mjGEOM_MESH,
}
#: Largest height of a pyramid's faces over the cone that it replaces [m].
FACETS = {Cone: 0.0006 * 4e-3}


NAMES = [type(shape).__name__ for shape in SHAPES]
PUNCHES = [shape for shape in SHAPES if isinstance(shape, FlatPunch)]
PUNCH_NAMES = [type(punch).__name__ for punch in PUNCHES]


def build_solids(indenter):
    """Model and data of the solids of an indenter."""
    spec = mujoco.MjSpec()
    for number, part in enumerate(indenter.primitives()):
        size, mesh = (*part.size, 0, 0, 0)[:3], f"part{number}" if part.vertices else ""
        if mesh:
            spec.add_mesh(name=mesh, uservert=np.ravel(part.vertices).tolist())
        spec.worldbody.add_geom(
            type=GEOMS[part.kind], size=size, pos=part.position, quat=part.quaternion, meshname=mesh
        )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def height_by_ray(model, data, x, y):
    """Height at which a ray upwards first meets a solid; negative if it meets none."""
    hit = np.zeros(1, dtype=np.int32)
    return mujoco.mj_ray(model, data, np.array([x, y, -1.0]), np.array([0, 0, 1.0]), None, 1, -1, hit, None) - 1


@pytest.mark.parametrize("indenter", SHAPES, ids=NAMES)
def test_gap_and_solids_describe_the_same_surface(indenter):
    rng = np.random.default_rng(1)
    half = np.array(indenter.footprint)
    model, data = build_solids(indenter)
    tolerance = FACETS.get(type(indenter), 2e-8)
    for x, y in rng.uniform(-1.2, 1.2, (60, 2)) * half:
        gap = float(indenter.gap(np.array(x), np.array(y)))
        ray = height_by_ray(model, data, x, y)
        if np.isfinite(gap):
            assert ray == pytest.approx(gap, abs=tolerance)
        else:
            assert ray < 0


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        pytest.param("sphere", 1e-8, marks=pytest.mark.slow),
        ("pyramid", 1e-8),
        pytest.param("two-balls", 3e-5, marks=pytest.mark.slow),
    ],
)
def test_gap_and_hulls_of_a_body_from_a_file_describe_the_same_surface(write_stl, name, tolerance):
    """A hull contains its part of the body, so that it is nowhere higher; at 99 % of places it is hardly lower."""
    body = read_stl(write_stl(name))
    model, data = build_solids(body)
    places = np.random.default_rng(1).uniform(-1.1, 1.1, (400, 2)) * body.footprint
    gap = body.gap(*places.T)
    ray = np.array([height_by_ray(model, data, x, y) for x, y in places])
    assert ((ray > -0.5) == np.isfinite(gap)).mean() > 0.995
    both = np.isfinite(gap) & (ray > -0.5)
    assert both.sum() > 200
    assert np.quantile(np.abs(ray - gap)[both], 0.99) < tolerance
    assert (ray - gap)[both].max() < 1e-8


@pytest.mark.parametrize("indenter", [NUT, Box(size=(6e-3, 4e-3, 5e-3)), RoundedTip(radius=1e-3)], ids=type)
def test_tilted_solids_touch_at_the_height_of_the_tilted_gap(indenter):
    shape = tilt_indenter(indenter, (0.08, -0.05))
    model, data = build_solids(shape)
    places = np.random.default_rng(1).uniform(-1, 1, (400, 2)) * shape.footprint
    gap, ray = shape.gap(*places.T), np.array([height_by_ray(model, data, x, y) for x, y in places])
    both = (ray > -0.5) & np.isfinite(gap)
    assert both.sum() > 50
    assert ray[both] == pytest.approx(gap[both], abs=2e-6)


@pytest.mark.parametrize("indenter", SHAPES, ids=NAMES)
def test_lowest_point_footprint_flatness_and_mirror_symmetry_of_a_shape_are_those_of_its_gap(indenter):
    assert (float(indenter.gap(np.array(0.0), np.array(0.0))) == 0) == (indenter is not NUT)
    x = np.linspace(-2, 2, 401) * max(indenter.footprint)
    grid = np.array(np.meshgrid(x, x))
    inside = np.abs(grid[:, np.isfinite(indenter.gap(*grid))])
    assert (inside.max(axis=1) <= np.array(indenter.footprint) + 1e-12).all()
    assert indenter.is_flat == is_flat_where_sampled(indenter)
    assert indenter.mirror_symmetry == is_symmetric_where_sampled(indenter)


@pytest.mark.parametrize("indenter", PUNCHES, ids=PUNCH_NAMES)
def test_the_signed_distance_has_a_slope_of_one_and_is_positive_on_the_face(indenter):
    rng = np.random.default_rng(2)
    x, y = (rng.uniform(-1.3, 1.3, (2, 4000)).T * indenter.footprint).T
    step = 1e-8
    slope_x = (indenter.signed_distance(x + step, y) - indenter.signed_distance(x - step, y)) / (2 * step)
    slope_y = (indenter.signed_distance(x, y + step) - indenter.signed_distance(x, y - step)) / (2 * step)
    assert np.mean(np.abs(np.hypot(slope_x, slope_y) - 1) < 1e-5) > 0.99
    assert np.array_equal(indenter.signed_distance(x, y) >= 0, indenter.gap(x, y) == 0)


def test_the_distance_from_an_inset_is_measured_from_its_corners():
    corner = np.array(NUT.footprint) * [0, 1]
    inset = 0.5e-3
    left = corner - [0, inset * 2 / np.sqrt(3)]  # the inset hexagon's corner, where two sides meet at 120 degrees
    turn = np.radians(np.linspace(62, 118, 15))
    beyond = NUT.distance_from_inset(inset, left[0] + 0.3e-3 * np.cos(turn), left[1] + 0.3e-3 * np.sin(turn))
    assert beyond == pytest.approx(0.3e-3, rel=1e-9)


@pytest.mark.parametrize("indenter", PUNCHES, ids=PUNCH_NAMES)
def test_an_inset_deeper_than_the_face_is_refused(indenter):
    with pytest.raises(ValueError, match="leaves nothing"):
        indenter.distance_from_inset(1.01 * min(indenter.footprint), np.zeros(1), np.zeros(1))


@pytest.mark.parametrize(
    ("shape", "area"), [(NUT, np.sqrt(3) / 2 * 13e-3**2 - np.pi / 4 * 8e-3**2), (LETTER, (12 * 16 - 2 * 4 * 6) * 1e-6)]
)
def test_nut_and_letter_have_the_area_of_their_outlines(shape, area):
    cells = (np.arange(700) + 0.503) / 700 * 18e-3 - 9e-3
    assert (shape.gap(*np.meshgrid(cells, cells)) == 0).sum() * (18e-3 / 700) ** 2 == pytest.approx(area, rel=3e-3)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Sphere(radius=0.0),
        lambda: Cylinder(radius=-1e-3),
        lambda: Box(size=(1e-3, 0.0, 1e-3)),
        lambda: RoundedTip(radius=float("nan")),
        lambda: Roller(radius=1e-3, length=0.0),
        lambda: Cone(angle=4.0, radius=1e-3),
        lambda: Nut(across=8e-3, bore=9e-3),
        lambda: LetterH(size=(8e-3, 16e-3), bar=4e-3),
    ],
)
def test_shapes_without_size_or_room_are_refused(make):
    with pytest.raises(ValueError, match=r"positive|angle|wall|between the legs"):
        make()
