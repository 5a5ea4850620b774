"""Problems of indenters of revolution as they are set up: meshes, materials, first steps and guesses.

The loading path stops at once, so that nothing is solved.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from fem_reference.elements.grading import grade_around_edge, grade_outward
from fem_reference.errors import PathConvergenceError
from fem_reference.finite_strain import axisymmetric_path as module
from fem_reference.finite_strain.axisymmetric_path import press_axisymmetric
from fem_reference.finite_strain.loading_path import LoadingPath
from meshes import Cylinder, Sphere
from tests.support.rubber import stack_layers

H, FILLET, REACH = 2.5e-3, 0.2e-3, 20e-3
COVER = stack_layers((1.5e-3, 1e6, 0.45), (1e-3, 3e6, 0.4))
BALL, DISK = Sphere(radius=6e-3), Cylinder(radius=2e-3)


class Problem:
    """A problem that takes one step and stops."""

    asked: SimpleNamespace

    def __init__(self, **options):
        self.options = options

    def follow(self, targets, *, record, **options):
        Problem.asked = SimpleNamespace(targets=targets, **self.options, **options)
        record("a step")
        raise PathConvergenceError("stopped", cause="too far", load=1.0)


class Coarse:
    """A path on a coarser mesh, whose guesses are known by name."""

    def transfer_guesses(self, elements):
        return "guesses", elements

    def transfer_steps(self, elements):
        return "steps", elements


def ask(monkeypatch, indenter, *, count=4, radius=2e-3, approach=0.0, coarse=None, **options):
    path = LoadingPath(
        **({"cover": COVER, "indenter": indenter, "targets": (0.1e-3, 0.3e-3), "control": "depth"} | options)
    )
    monkeypatch.setattr(module, "ContactProblem", Problem)
    with pytest.raises(PathConvergenceError) as told:
        press_axisymmetric(
            path, elements_per_thickness=count, contact_radius=radius, fillet=FILLET, reach=REACH, approach=approach,
            coarse=coarse, progress=print,
        )  # fmt: skip
    asked = Problem.asked
    assert asked.solid.elements is told.value.solved.elements
    assert (told.value.solved.steps, told.value.solved.equilibria, told.value.solved.coarse) == (["a step"], (), coarse)
    assert (asked.units.length, asked.control, asked.progress) == (pytest.approx(H), "depth", print)
    return asked


def edges(asked, axis):
    """Edges of the elements along the radius or the height [thicknesses]."""
    mesh = asked.solid.elements.basis.mesh
    return np.unique(mesh.p[axis].round(9))


@pytest.mark.parametrize(("count", "radius", "size"), [(4, 2e-3, 0.8 / 4), (3, 4e-3, 1 / 3), (5, 0.5e-3, 0.2 / 5)])
def test_elements_under_a_ball_are_even_to_five_fourths_of_its_contact(monkeypatch, count, radius, size):
    asked = ask(monkeypatch, BALL, count=count, radius=radius)
    expected = grade_outward(size, 1.25 * radius / H, REACH / H, 1 + 1.2 / count)
    assert edges(asked, 0) == pytest.approx(expected, abs=1e-8)
    # Elements of the top layer shrink to that size; three in five of the thickness are below it.
    top = np.diff(edges(asked, 1)[edges(asked, 1) > 0.6 - 1e-9])
    even = 0.4 / max(2, round(0.4 * count))
    assert top[-1] == pytest.approx(min(size, even), rel=0.3)
    assert asked.contact.multiple == 1.0


@pytest.mark.parametrize(("approach", "deep"), [(0.24 * H, False), (0.26 * H, True)])
@pytest.mark.parametrize("count", [4, 6])
def test_elements_at_an_edge_follow_its_rounding_and_fill_half_the_radius_where_it_is_deep(
    monkeypatch, count, approach, deep
):
    asked = ask(monkeypatch, DISK, count=count, approach=approach)
    fine, edge = 0.46 * FILLET / H, 2e-3 / H
    expected = grade_around_edge(
        fine, 0.8 / count, edge, REACH / H, 1 + 1.2 / count, even=edge / 2 if deep else 0.0
    )  # fmt: skip
    assert edges(asked, 0) == pytest.approx(expected, abs=1e-8)
    moduli = np.array([1.0 / 2.9, 3.0 / 2.8]) / (3.0 / 2.8)
    bulk = np.array([1 / 0.3, 3 / 0.6]) / (3.0 / 2.8)
    direct = np.minimum(50 * moduli, bulk / 2) if deep else [0.0, 0.0]
    assert asked.solid.direct_bulk == pytest.approx(direct)


@pytest.mark.parametrize(("indenter", "scale", "acts"), [(BALL, 1.0, True), (BALL, 1e-3, False), (DISK, 1.0, False)])
def test_a_part_of_the_bulk_modulus_acts_directly_under_balls_at_finite_strain(monkeypatch, indenter, scale, acts):
    asked = ask(monkeypatch, indenter, load_scale=scale)
    assert asked.solid.direct_bulk.any() == acts
    assert (asked.load_scale, asked.first) == (scale, pytest.approx(0.02 * scale))
    assert asked.targets == pytest.approx([scale * each / H for each in (0.1e-3, 0.3e-3)])


@pytest.mark.parametrize(("count", "steps"), [(4, 5), (5, 6), (6, 8), (9, 11)])
def test_friction_takes_more_steps_on_finer_grids_and_no_guess(monkeypatch, count, steps):
    asked = ask(monkeypatch, BALL, count=count, friction=0.3, coarse=Coarse())
    assert (asked.friction_steps, asked.contact.friction) == (steps, 0.3)
    assert (asked.guesses, asked.between) == ((), ())
    smooth = ask(monkeypatch, BALL, count=count, coarse=Coarse())
    assert smooth.guesses == ("guesses", smooth.solid.elements)
    assert smooth.between == ("steps", smooth.solid.elements)
    alone = ask(monkeypatch, BALL, count=count)
    assert (alone.guesses, alone.between) == ((), ())


@pytest.mark.parametrize(("count", "radius", "stiff"), [(4, 2e-3, 300 * 4 / 0.8), (3, 4e-3, 300 * 3)])
def test_the_penalty_is_three_hundred_moduli_per_element(monkeypatch, count, radius, stiff):
    """A rigid rise of the top by a thousandth, under the lowest point of a ball that is that deep."""
    asked = ask(monkeypatch, BALL, count=count, radius=radius)
    elements = asked.solid.elements
    state = np.zeros(elements.displacements + elements.pressures)
    found = asked.contact.evaluate(state, 1e-3)
    overlap = np.maximum(-found.gap, 0.0)
    assert overlap.max() > 0
    assert found.pressure == pytest.approx(stiff * overlap)
    r = found.position[..., 0]
    near = r < 1.5
    assert found.gap[near] == pytest.approx(2.4 - np.sqrt(2.4**2 - r[near] ** 2) - 1e-3)
