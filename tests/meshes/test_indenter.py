from __future__ import annotations

import mujoco
import numpy as np
import pytest

from meshes import Box, Cylinder, RoundedTip, Sphere

SHAPES = [Sphere(radius=5e-3), RoundedTip(), Cylinder(radius=4e-3), Box(size=(10e-3, 6e-3, 5e-3))]
GEOMS = {
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
}


def height_by_ray(indenter, x, y):
    """Height of the lower surface, found by shooting a ray upwards at the solids."""
    spec = mujoco.MjSpec()
    for part in indenter.primitives():
        size = (*part.size, 0, 0)[:3]
        spec.worldbody.add_geom(type=GEOMS[part.kind], size=size, pos=part.position, quat=part.quaternion)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    hit = np.zeros(1, dtype=np.int32)
    return mujoco.mj_ray(model, data, np.array([x, y, -1.0]), np.array([0, 0, 1.0]), None, 1, -1, hit, None) - 1


@pytest.mark.parametrize("indenter", SHAPES, ids=lambda s: type(s).__name__)
def test_gap_and_solids_describe_the_same_surface(indenter):
    rng = np.random.default_rng(1)
    half = np.array(indenter.footprint)
    for x, y in rng.uniform(-1.2, 1.2, (60, 2)) * half:
        gap = float(indenter.gap(np.array(x), np.array(y)))
        ray = height_by_ray(indenter, x, y)
        if np.isfinite(gap):
            assert ray == pytest.approx(gap, abs=1e-9)
        else:
            assert ray < 0


@pytest.mark.parametrize("indenter", SHAPES, ids=lambda s: type(s).__name__)
def test_lowest_point_is_on_the_axis_and_the_footprint_holds_the_shape(indenter):
    assert float(indenter.gap(np.array(0.0), np.array(0.0))) == 0
    x = np.linspace(-2, 2, 401) * max(indenter.footprint)
    grid = np.meshgrid(x, x)
    finite = np.isfinite(indenter.gap(*grid))
    assert np.abs(grid[0][finite]).max() <= indenter.footprint[0] + 1e-12
    assert np.abs(grid[1][finite]).max() <= indenter.footprint[1] + 1e-12


def test_axisymmetric_shapes_are():
    for indenter in SHAPES:
        r, turn = 0.8 * indenter.footprint[1], np.linspace(0, np.pi, 7)
        gap = indenter.gap(r * np.cos(turn), r * np.sin(turn))
        assert (np.ptp(gap) < 1e-12) == (indenter.axisymmetric or isinstance(indenter, Box))


@pytest.mark.parametrize(
    "make",
    [
        lambda: Sphere(radius=0.0),
        lambda: Cylinder(radius=-1e-3),
        lambda: Box(size=(1e-3, 0.0, 1e-3)),
        lambda: RoundedTip(radius=float("nan")),
    ],
)
def test_degenerate_shapes_are_refused(make):
    with pytest.raises(ValueError, match="positive"):
        make()
