"""Rubber disks between bonded plates: the series against itself, the elements against it, energy against work."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from meshes import Material
from tests.exact.bonded_disk import Disk, compress_disk, gent_lindley
from tests.exact.disk_series import _Edge, _evaluate_edge_fields, _evaluate_squeeze_film, bonded_disk
from validation.credibility import verification


def rubber(nu=0.5):
    return Material(name="rubber", model="neo-hookean", parameters={"shear_modulus": 1e6 / 3}, poisson_ratio=nu)


def apparent(squeezed, radius):
    """Over Young's modulus."""
    return squeezed.force / (np.pi * radius**2 * squeezed.strain * rubber().youngs_modulus)


@pytest.mark.parametrize("factor", [0.25, 1.0, 3.0])
def test_series_converges_from_above_near_gent_and_lindley(factor):
    """Their estimate is within 7 % of the exact value over the whole range, and no closer than 1 %."""
    found = [bonded_disk(factor, terms=n).value for n in (20, 40, 80)]
    assert found[1] == pytest.approx(found[2], rel=5e-5)
    assert abs(found[1] - found[2]) < abs(found[0] - found[2])
    assert abs(found[1] / found[2] - 1) < bonded_disk(factor, terms=40).error < 1e-3
    assert 0.01 < abs(gent_lindley(factor) / found[2] - 1) < 0.07


def test_the_report_compares_with_the_value_of_the_series():
    assert bonded_disk(verification._DISK_RADIUS / 4).value == pytest.approx(verification._DISK_MODULUS, rel=1e-12)


def test_series_fields_obey_betti():
    """Work of one field's edge traction on another's edge displacement is symmetric only for solutions."""
    z, weight = np.polynomial.legendre.leggauss(120)
    z, weight = (z + 1) / 2, weight / 2
    fields = _evaluate_edge_fields(1.7, z, 6)
    work = fields.work(fields, weight)
    assert np.abs(work - work.T).max() < 1e-12 * np.abs(work).max()
    assert np.linalg.eigvalsh(work).min() > 0
    wrong = replace(fields, t_r=fields.t_r + 2 * 0.01 * fields.u_r * z[:, None])  # a spring is symmetric, and yet
    film = _evaluate_squeeze_film(1.7, z)
    assert np.abs(film.work(wrong, weight) - wrong.work(film, weight).T).max() > 1e-3
    spoiled = _Edge(u_r=fields.u_r, u_z=fields.u_z, t_r=fields.t_r, t_z=1.01 * fields.t_z)
    work = spoiled.work(spoiled, weight)
    assert np.abs(work - work.T).max() > 1e-4 * np.abs(work).max()


def test_slender_and_flat_disks_have_known_limits():
    """A column keeps its Young's modulus but for two ends; a film is a squeeze film: 2 S^2 + 1.2, less an edge."""
    assert bonded_disk(0.02).value == pytest.approx(1.0, abs=0.02)
    assert bonded_disk(20.0).value == pytest.approx(2 * 20.0**2, rel=0.02)
    with pytest.raises(ValueError, match="must be positive"):
        bonded_disk(0.0)


@pytest.mark.parametrize("factor", [0.25, 1.0])
def test_small_strain_equals_the_series(factor):
    disk = Disk.mesh(rubber(), 4 * factor, 9)
    force = disk.compress([1e-6])[0].load
    assert force / (np.pi * (4 * factor) ** 2 * 3e-6) == pytest.approx(bonded_disk(factor).value, rel=1.5e-3)


@pytest.mark.slow
def test_energy_is_the_work_of_the_plates_and_force_its_derivative():
    squeezed = compress_disk(rubber(), radius=2e-3, height=2e-3, strains=np.linspace(0.01, 0.15, 8))
    travel = squeezed.strain * 2e-3
    slope = np.gradient(squeezed.energy, travel, edge_order=2)
    assert slope[2:-1] == pytest.approx(squeezed.force[2:-1], rel=3e-3)  # what is left is the differences' own error
    path = np.concatenate([[0], squeezed.force]), np.concatenate([[0], travel])
    simpson = np.polynomial.polynomial.Polynomial.fit(path[1], path[0], 6).integ()
    assert simpson(travel[-1]) - simpson(0) == pytest.approx(squeezed.energy[-1], rel=1e-5)
    assert (squeezed.error_estimate < 0.03).all()
    assert (np.diff(apparent(squeezed, 2e-3)) > 0).all()  # it stiffens


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "nu"), [(0.25, 0.5), (0.5, 0.499), (1.0, 0.45), (2.0, 0.5), (3.0, 0.45)])
def test_disks_are_squeezed_by_fifteen_percent(factor, nu):
    radius = 2 * factor * 2e-3
    squeezed = compress_disk(rubber(nu), radius=radius, height=2e-3, strains=[1e-4, 0.05, 0.1, 0.15])
    assert (squeezed.error_estimate < 0.03).all()
    if nu == 0.5:
        assert apparent(squeezed, radius)[0] == pytest.approx(bonded_disk(factor).value, rel=5e-3)
        assert apparent(squeezed, radius)[0] == pytest.approx(gent_lindley(factor), rel=0.07)


def test_estimates_cover_the_error_at_small_strain():
    """The true error is known from the series."""
    for factor in (0.25, 1.0):
        squeezed = compress_disk(rubber(), radius=4e-3 * factor, height=2e-3, strains=[1e-4])
        true = abs(apparent(squeezed, 4e-3 * factor)[0] / bonded_disk(factor).value - 1)
        assert true <= squeezed.error_estimate[0] < 5 * true


@pytest.fixture(scope="module")
def disk():
    return Disk.mesh(rubber(), 2.0, 4)


def test_plate_and_middle_plane_move_as_prescribed(disk):
    reached = disk.compress([0.1])[0]
    r, z = disk.solid.elements.nodes.T
    along_r, along_z = reached.state[: disk.solid.elements.displacements].reshape(-1, 2).T
    top, middle = z > 1 - 1e-9, z < 1e-9
    assert along_z[top] == pytest.approx(np.full(top.sum(), -0.1), rel=1e-9)
    assert np.abs(along_z[middle]).max() < 1e-12
    assert np.abs(along_r[top | (r < 1e-9)]).max() < 1e-12
    assert along_r[middle & (r > 1.9)].min() > 0


def test_the_middle_plane_carries_the_force_of_the_plate(disk):
    reached = disk.compress([0.1])[0]
    middle = np.flatnonzero(disk.solid.elements.nodes[:, 1] < 1e-9)
    assert reached.reaction[2 * middle + 1].sum() == pytest.approx(reached.load, rel=1e-6)


def test_disks_of_one_shape_scale_with_size_and_modulus():
    one = compress_disk(rubber(), radius=1e-3, height=2e-3, strains=[0.1])
    large = compress_disk(rubber(), radius=3e-3, height=6e-3, strains=[0.1])
    assert large.force == pytest.approx(9 * one.force, rel=1e-9)
    assert large.energy == pytest.approx(27 * one.energy, rel=1e-9)
