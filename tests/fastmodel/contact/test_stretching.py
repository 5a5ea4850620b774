"""A cover whose tables depend on the load."""

import dataclasses

import numpy as np
import pytest

import fastmodel
from fastmodel.errors import FastModelError
from meshes import Box, Sphere

PLAIN = fastmodel.load("wts-0614-34")


@pytest.fixture(scope="module")
def parameters():
    """The cover becomes half as soft, and spreads 20 % less, at 1 N, under a ball that is then 0.1 mm deep."""
    cells = dataclasses.replace(
        PLAIN.surface,
        loads=np.array([1.0, 2.0]),
        load_depths=np.array([0.1e-3, 0.15e-3]),
        loaded_compliance=np.array([PLAIN.surface.compliance / 2] * 2),
        loaded_influence=np.array([0.8 * PLAIN.surface.influence] * 2),
    )
    return dataclasses.replace(PLAIN, surface=cells)


def press(parameters, indenter, load):
    return fastmodel.indent(parameters, indenter, load=load, at=(1.7e-3, 1.7e-3))


def test_texel_forces_follow_the_load(parameters):
    """A sharp ball is deeper than the ball of the tables, so the tables of its own load hold."""
    ball = Sphere(radius=2e-3)
    for load, factor in ((0.5, 0.9), (5.0, 0.8)):
        without, found = press(PLAIN, ball, load), press(parameters, ball, load)
        assert found.texel_forces.sum() == pytest.approx(factor * without.texel_forces.sum(), rel=2e-3)
    assert found.depth < 0.9 * without.depth


def test_a_large_face_that_sinks_little_is_pressed_on_the_cover_without_stretch(parameters):
    face = Box(size=(18e-3, 18e-3, 5e-3))
    without, found = press(PLAIN, face, 1.0), press(parameters, face, 1.0)
    assert without.depth < 0.02e-3
    assert found.texel_forces.sum() == pytest.approx(without.texel_forces.sum(), rel=0.05)


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


def test_tables_survive_saving(parameters, tmp_path):
    parameters.save(tmp_path)
    found = fastmodel.load(tmp_path).surface
    for name in ("loads", "load_depths", "loaded_compliance", "loaded_influence"):
        np.testing.assert_array_equal(getattr(found, name), getattr(parameters.surface, name))


def test_a_ball_smaller_than_a_cell_presses_where_it_stands():
    """At equal distances from a texel border the forces on both sides swap."""
    ball = Sphere(radius=1e-3)
    left, right = (fastmodel.indent(PLAIN, ball, load=0.01, at=(x, 1.7e-3)).texel_forces for x in (-0.2e-3, 0.2e-3))
    image = PLAIN.array.image
    np.testing.assert_allclose(image(left), image(right)[:, ::-1], atol=1e-5)
