"""A cover whose tables depend on the load."""

import dataclasses

import numpy as np
import pytest

import fastmodel
from fastmodel.errors import FastModelError
from fastmodel.pressure.cell_grid import CellGrid
from meshes import Box, Sphere, TexelArray


@pytest.fixture(scope="module")
def parameters(wts_derivation):
    """The cover becomes half as soft, and spreads 20 % less, at 1 N, under a ball that is then 0.1 mm deep."""
    parameters = wts_derivation.parameters
    cells = dataclasses.replace(
        parameters.surface,
        loads=np.array([1.0, 2.0]),
        load_depths=np.array([0.1e-3, 0.15e-3]),
        loaded_compliance=np.array([parameters.surface.compliance / 2] * 2),
        loaded_influence=np.array([0.8 * parameters.surface.influence] * 2),
    )
    return dataclasses.replace(parameters, surface=cells)


def press(parameters, indenter, load):
    return fastmodel.indent(parameters, indenter, load=load, at=(1.7e-3, 1.7e-3))


def test_texel_forces_follow_the_load(parameters, wts_derivation):
    """A sharp ball is deeper than the ball of the tables, so the tables of its own load hold."""
    ball = Sphere(radius=2e-3)
    for load, factor in ((0.5, 0.9), (5.0, 0.8)):
        without, found = press(wts_derivation.parameters, ball, load), press(parameters, ball, load)
        assert found.texel_forces.sum() == pytest.approx(factor * without.texel_forces.sum(), rel=2e-3)
    assert found.depth < 0.9 * without.depth


def test_a_large_face_that_sinks_little_is_pressed_on_the_cover_without_stretch(parameters, wts_derivation):
    face = Box(size=(18e-3, 18e-3, 5e-3))
    without, found = press(wts_derivation.parameters, face, 1.0), press(parameters, face, 1.0)
    assert without.depth < 0.02e-3
    assert found.texel_forces.sum() == pytest.approx(without.texel_forces.sum(), rel=0.05)


def test_tables_survive_saving(parameters, tmp_path):
    parameters.save(tmp_path)
    found = fastmodel.load(tmp_path).surface
    for name in ("loads", "load_depths", "loaded_compliance", "loaded_influence"):
        np.testing.assert_array_equal(getattr(found, name), getattr(parameters.surface, name))


@pytest.mark.parametrize(
    ("changes", "error"),
    [
        ({"loaded_influence": None}, FastModelError),
        ({"loads": np.array([1.0, 2.0, 3.0])}, FastModelError),
        ({"loads": np.array([2.0, 1.0])}, ValueError),
        ({"load_depths": np.array([1e-3])}, FastModelError),
        ({"loads": None}, FastModelError),
    ],
)
def test_incomplete_tables_are_refused(parameters, changes, error):
    with pytest.raises(error, match="load"):
        dataclasses.replace(parameters.surface, **changes)


def test_shifted_forces_keep_their_sum_and_act_around_the_wanted_centre():
    grid = CellGrid.over(TexelArray.grid(4, 5, 2e-3), 4, 1)
    forces = np.zeros((4, 4))
    forces[1, 2], forces[2, 2] = 0.3, 0.1
    wanted = grid.low + np.array(grid.edge) * (10.2, 8.4)
    found, origin = grid.shift_window(forces, (6, 8), wanted)
    row, column = np.indices(found.shape)
    centre = [(found * (column + origin[1] + 0.5)).sum(), (found * (row + origin[0] + 0.5)).sum()] / found.sum()
    assert found.sum() == pytest.approx(0.4)
    np.testing.assert_allclose(centre, (wanted - grid.low) / grid.edge, atol=1e-12)
    far, origin = grid.shift_window(forces, (6, 8), wanted + 3e-3)
    assert far is forces
    assert origin == (6, 8)


def test_a_ball_smaller_than_a_cell_presses_where_it_stands(wts_derivation):
    """At equal distances from a texel border the forces on both sides swap."""
    ball = Sphere(radius=1e-3)
    left, right = (
        fastmodel.indent(wts_derivation.parameters, ball, load=0.01, at=(x, 1.7e-3)).texel_forces
        for x in (-0.2e-3, 0.2e-3)
    )
    image = wts_derivation.sensor.array.image
    np.testing.assert_allclose(image(left), image(right)[:, ::-1], atol=1e-5)
