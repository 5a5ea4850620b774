"""A sphere pressed into a small mesh: balance of forces and energy, penetration, and where a path ends."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference.elements.grading import grade_outward
from fem_reference.elements.taylor_hood import prepare_elements
from fem_reference.finite_strain.axisymmetric_path import PENALTY
from fem_reference.finite_strain.contact import SurfaceContact
from fem_reference.finite_strain.contact_problem import ContactProblem, Guess, SolvedPath
from fem_reference.finite_strain.hyperelastic import Solid
from fem_reference.finite_strain.indenter_surface import IndenterSurface
from fem_reference.finite_strain.loading_path import Units
from fem_reference.linear_response.axisymmetric import find_constrained, mesh_cover
from meshes import Sphere
from tests.support.rubber import make_cover


def path_problem(nu=0.45, count=4, penalty=PENALTY, friction=0.0):
    cover = make_cover(nu)
    units = Units.of(cover)
    mesh, _ = mesh_cover(units.scale_cover(cover), count, grade_outward(1 / count, 1.5, 8.0, 1.3))
    elements = prepare_elements(mesh, axisymmetric=True)
    surface = IndenterSurface(indenter=Sphere(radius=4e-3), fillet=0.05, unit=units.length)
    return ContactProblem(
        solid=Solid.from_cover(elements, cover, units),
        contact=SurfaceContact(elements, 1.0, surface, penalty=penalty * count, friction=friction),
        constrained=find_constrained(units.scale_cover(cover), elements.nodes[:, 0], elements.nodes[:, 1], 8.0),
        units=units,
        friction_steps=6,
    )


def test_contact_keeps_the_balance_and_leaves_little_overlap():
    problem = path_problem()
    reached = problem.follow([0.2], control="depth", first=0.02)[0]
    base = problem.solid.elements.nodes[:, 1] < 1e-9
    vertical = reached.reaction[1 : problem.solid.elements.displacements : 2]
    assert vertical[base].sum() == pytest.approx(reached.load, rel=2e-3)
    assert reached.contact.overlap < 1e-3 * reached.depth


@pytest.mark.parametrize("nu", [0.45, pytest.param(0.5, marks=pytest.mark.slow)])
def test_stored_energy_is_the_work_of_the_load(nu):
    """Without friction nothing is lost: the load is the derivative of the energy by the depth, all along the path."""
    problem = path_problem(nu)
    depths = np.array([0.015, 0.04, 0.08, 0.12, 0.16, 0.195, 0.2, 0.205])
    path = problem.follow(list(depths), control="depth", first=0.02)
    energy = np.array([problem.solid.energy(reached.state) for reached in path])
    load = np.array([reached.load for reached in path])
    assert (energy[-1] - energy[-3]) / (depths[-1] - depths[-3]) == pytest.approx(load[-2], rel=3e-3)
    # the load grows like depth^1.5 at first: the polynomial is in the root of the depth
    root = np.sqrt(depths)
    fit = np.polynomial.Polynomial.fit(np.append(0, root), np.append(0, load), 4).convert()
    work = (fit * np.polynomial.Polynomial([0, 2])).integ()
    assert work(root[-1]) - work(0) == pytest.approx(energy[-1], rel=5e-3)


@pytest.mark.parametrize(
    ("control", "target", "first"),
    [
        pytest.param("load", 0.05, 2.0, marks=pytest.mark.slow),
        ("depth", 0.1, 2.0),
        pytest.param("load", 0.05, 5e-4, marks=pytest.mark.slow),
    ],
)
def test_a_first_step_that_fails_is_halved_or_doubled_until_one_succeeds(control, target, first):
    """At 2 the base is pressed through; at 5e-4 the sphere lies above the first quadrature point."""
    plain, other = (path_problem(count=2).follow([target], control=control, first=each)[0] for each in (0.02, first))
    assert getattr(plain, control) == pytest.approx(target)
    assert (other.load, other.depth) == pytest.approx((plain.load, plain.depth), rel=1e-5)


def solve_steps(problem, control, target, **options):
    """A path to one target with its steps."""
    steps = []
    reached = problem.follow([target], control=control, first=0.02, record=steps.append, **options)
    return SolvedPath(elements=problem.solid.elements, equilibria=reached, steps=steps)


@pytest.mark.slow
@pytest.mark.parametrize(("control", "target"), [("load", 0.6), ("depth", 0.3)])
def test_steps_of_a_coarse_mesh_start_a_finer_one_where_its_guess_fails(control, target):
    """The path comes to the same equilibrium, in fewer steps, the first of them beyond the guess that converged."""
    coarse, problem = solve_steps(path_problem(count=3), control, target), path_problem()
    plain = solve_steps(problem, control, target)
    useless = Guess(state=np.full_like(plain.equilibria[0].state, 1e3), depth=5.0)
    steps = coarse.transfer_steps(problem.solid.elements)
    between = [guess for guess in steps if getattr(guess, control) < target]
    assert between
    guided = solve_steps(problem, control, target, guesses=[useless], between=[useless, *between])
    assert len(guided.steps) < len(plain.steps)
    assert getattr(guided.steps[0], control) > getattr(between[0], control)
    assert guided.equilibria[0].depth == pytest.approx(plain.equilibria[0].depth, rel=1e-5)
    assert guided.equilibria[0].load == pytest.approx(plain.equilibria[0].load, rel=1e-5)


@pytest.mark.parametrize(
    ("control", "target"),
    [pytest.param("load", 0.4, marks=pytest.mark.slow), pytest.param("depth", 0.2, marks=pytest.mark.slow)],
)
def test_friction_takes_at_least_its_number_of_steps(control, target):
    """Slip depends on the path; the first step is not recorded."""
    path = solve_steps(path_problem(count=3, friction=0.3), control, target)
    reached = [getattr(step, control) for step in path.steps]
    assert reached[-1] == pytest.approx(target)
    assert np.diff(reached).max() <= target / 6 * (1 + 1e-9)
    plain = solve_steps(path_problem(count=3), control, target)
    assert len(plain.steps) + 1 < 6 <= len(path.steps) + 1
