"""Arrays that are not flat, regular grids: bent sheets, texels anywhere in a plane, texels anywhere in space."""

import dataclasses

import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel import FastModelError, indent
from fastmodel.pressure.cell_grid import ScatteredBaseForces, divide_into_panels, lay_out
from meshes import Box, Sphere, TexelArray
from tests.support.cover_data import WTS, cells, parameters
from tests.support.quaternions import make_z_rotation, multiply, rotate
from tests.support.scenes import add_body, make_spec, simulate

PITCH = 3.4e-3
CELLS = cells(WTS)
#: So soft that a few micrometres of height do not matter.
SOFT = dataclasses.replace(CELLS, compliance=1e3 * CELLS.compliance, top_compliance=1e3 * CELLS.top_compliance)


def bent(radius, rows=7, columns=5, **changes):
    """A sheet bent about x, convex."""
    grid = TexelArray.grid(rows, columns, PITCH)
    angle = grid.centres[:, 1] / radius
    normals = np.stack([0 * angle, np.sin(angle), np.cos(angle)], axis=1)
    places = radius * (normals - [0, 0, 1]) + grid.centres * [1, 0, 0]
    return dataclasses.replace(grid, centres=places, normals=normals, **changes)


def shuffled(array, seed=1):
    """The same texels in random order, and that order."""
    order = np.random.default_rng(seed).permutation(array.count)
    scattered = dataclasses.replace(
        array,
        centres=array.centres[order],
        normals=array.normals[order],
        active=array.active[order],
        rows=1,
        columns=array.count,
    )
    return scattered, order


@pytest.mark.parametrize("method", ["foundation", "cover"])
@pytest.mark.parametrize(
    "array", [bent(10e-3), pytest.param(shuffled(bent(10e-3))[0], marks=pytest.mark.slow)], ids=["sheet", "scattered"]
)
def test_a_curved_array_carries_the_load_as_a_vector(array, method):
    touched = set()
    for shape in (Sphere(radius=5e-3), Box(size=(8e-3, 12e-3, 5e-3))):
        for at in ((0.7e-3, -1.1e-3), (1.0e-3, 6e-3)):
            found = indent(parameters(array, surface=CELLS), shape, load=1.5, at=at, contact=method)
            # guided along z: the guide takes up the lateral force
            assert found.contact_forces @ array.normals[:, 2] == pytest.approx(1.5, rel=1e-6)
            assert found.contact_forces.min() >= 0
            assert found.total_force == pytest.approx(found.contact_forces.sum())
            assert found.depth is None
            touched |= set((found.contact_forces > 0).nonzero()[0].tolist())
    assert len({tuple(array.normals[t].round(6)) for t in touched}) >= 3


@pytest.mark.parametrize("method", ["foundation", "cover"])
@pytest.mark.parametrize("shape", [Sphere(radius=5e-3), Box(size=(9e-3, 9e-3, 5e-3))], ids=["sphere", "box"])
def test_a_flat_array_in_two_panels_reads_as_one_panel(shape, method):
    lift = np.where(np.arange(WTS.count) < WTS.count // 2, 0.0, 4e-6)
    cut = dataclasses.replace(WTS, centres=WTS.centres + lift[:, None] * [0, 0, 1])
    assert (len(divide_into_panels(WTS, 0)), len(divide_into_panels(cut, 0))) == (1, 2)
    # the seam lies under the shape; boxes put whole contact points on either side of it
    whole, halves = (
        indent(parameters(array, surface=SOFT), shape, load=2.0, at=(0.9e-3, 1.3e-3), contact=method)
        for array in (WTS, cut)
    )
    assert np.abs(halves.contact_forces - whole.contact_forces).sum() < 2e-3
    np.testing.assert_allclose(halves.texel_forces, whole.texel_forces, atol=1e-3)


def test_boxes_on_a_ridge_carry_too_little():
    array = bent(10e-3)
    found = indent(parameters(array, surface=CELLS), Sphere(radius=5e-3), load=2.0, at=(0, 1.7e-3), contact="boxes")
    assert 0.03 < 1 - found.contact_forces @ array.normals[:, 2] / 2.0 < 0.08


@pytest.mark.parametrize("method", ["foundation", "cover"])
def test_order_of_texels_does_not_matter_in_a_plane(method):
    scattered, order = shuffled(WTS)
    here, there = (
        indent(
            parameters(array, surface=CELLS), Box(size=(9e-3, 5e-3, 5e-3)), load=1.0, at=(9e-3, 2e-3), contact=method
        )
        for array in (WTS, scattered)
    )
    np.testing.assert_allclose(there.contact_forces, here.contact_forces[order], atol=1e-9)
    assert here.outside > 0.1
    if method == "cover":
        np.testing.assert_allclose(there.texel_forces, here.texel_forces[order], atol=1e-6)
        assert there.outside == pytest.approx(here.outside, abs=1e-6)


def test_scattered_texels_have_the_base_force_at_their_place():
    from scipy.special import erf

    places = np.array([[0, 0, 0], [4.1e-3, 0.29e-3, 0], [-1.3e-3, 3.7e-3, 0]])
    array = dataclasses.replace(WTS, centres=places, normals=WTS.normals[:3], active=WTS.active[:3], rows=1, columns=3)
    layout = lay_out(array, 1, CELLS.per_texel, 1)
    base, window = ScatteredBaseForces(CELLS, layout, array), np.ones((1, 1))
    grid, panel = layout.panels[0].grid, layout.panels[0].panel
    for row, column in ((9, 11), (7, 6)):
        cell = panel.origin[:2] + grid.low + (np.array([column, row]) + 0.5) * grid.edge
        ends = (places[:, None, :2] - cell + np.array([[-0.5], [0.5]]) * PITCH) / (np.sqrt(2) * 0.5 * CELLS.thickness)
        exact = (0.5 * np.diff(erf(ends), axis=1)[:, 0]).prod(axis=1)
        np.testing.assert_allclose(base.from_window(window, (row, column)), exact, atol=3e-3)


@pytest.mark.parametrize("radius", [12e-3, 40e-3])
def test_foundation_on_a_bent_sheet_accounts_for_both_curvatures(radius):
    """On a sheet of narrow rows: k (d - x^2 / 2 r - y^2 / 2 (1 / r + 1 / R)), both curvatures added."""
    ball, modulus, load = 8e-3, 1e9, 2.0
    array = bent(radius, rows=27, columns=5)
    pitch = (PITCH, PITCH / 6)
    angle = (np.repeat(np.arange(27), 5) - 13) * pitch[1] / radius
    normals = np.stack([0 * angle, np.sin(angle), np.cos(angle)], axis=1)
    places = radius * (normals - [0, 0, 1]) + array.centres * [1, 0, 0]
    array = dataclasses.replace(array, centres=places, normals=normals, pitch=pitch, texel_size=pitch)
    bare = parameters(array, surface=None)
    found = indent(bare, Sphere(radius=ball), load=load, contact=fastmodel.Foundation(modulus=modulus))
    a, b = 1 / (2 * ball), 1 / (2 * ball) + 1 / (2 * radius)
    # volume of the paraboloid: load = k pi d^2 / (2 sqrt(a b))
    depth = np.sqrt(2 * load * np.sqrt(a * b) / (np.pi * modulus))
    along = np.linspace(-2.5 * PITCH, 2.5 * PITCH, 2001)
    y = (np.arange(27) - 13) * pitch[1]
    fine = y[:, None] + (np.arange(9) - 4) / 9 * pitch[1]

    def rows(depth, b):
        pressure = modulus * np.maximum(depth - a * along**2 - b * fine[..., None] ** 2, 0)
        return np.trapezoid(pressure, along).mean(axis=1) * pitch[1]

    felt, exact = array.image(found.contact_forces).sum(axis=1), rows(depth, b)
    assert exact.sum() == pytest.approx(load, rel=0.01)
    assert np.abs(felt - exact).sum() / 2 < 0.02 * load
    flat = rows(np.sqrt(2 * load * a / (np.pi * modulus)), a)
    assert np.abs(felt - flat).sum() / 2 > 0.03 * load


def scene(array, turn, method):
    """A free 100 g ball held by gravity and a slide-less pose on a bent array, the whole scene turned."""
    spec = make_spec(gravity=rotate(turn, np.array([[0, 0, -9.80665]]))[0])
    holder = spec.worldbody.add_body(name="holder", quat=turn, pos=[0.1, -0.2, 0.3])
    sensor = fastmodel.attach(spec, "holder", parameters(array, surface=CELLS), contact=method)
    ball = add_body(spec, "sphere", [6e-3], [0.4e-3, 1.2e-3, 6e-3], parent=holder, mass=0.1, condim=1)
    for axis in ([0, 1, 0], [0, 0, 1]):
        ball.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, stiffness=50, damping=2)
    simulate(spec, sensor, 300)
    return sensor


@pytest.mark.parametrize("method", ["foundation", pytest.param("cover", marks=pytest.mark.slow)])
def test_turning_a_bent_array_and_its_object_together_changes_no_texel(method):
    array = bent(15e-3)
    turn = multiply(np.array([np.cos(0.4), np.sin(0.4), 0, 0]), make_z_rotation(1.1))
    level, turned = (scene(array, each, method) for each in (np.array([1.0, 0, 0, 0]), turn))
    assert level.contact_forces().sum() > 0.5
    np.testing.assert_allclose(turned.contact_forces(), level.contact_forces(), atol=1e-6)
    np.testing.assert_allclose(turned.frame().texel_forces, level.frame().texel_forces, atol=1e-6)


def test_a_table_on_a_bent_array_is_refused_with_the_alternatives():
    with_table = dataclasses.replace(CELLS, table=np.zeros((35, 28, 20)))
    with pytest.raises(FastModelError, match="'foundation' or 'boxes'"):
        parameters(bent(15e-3), surface=with_table)
