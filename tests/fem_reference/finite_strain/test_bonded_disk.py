"""Bonded disks: scaling, the path to each compression, requests that are refused, and grids that fold over."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference.errors import ConvergenceError
from fem_reference.finite_strain import bonded_disk
from fem_reference.finite_strain.bonded_disk import Disk, compress_disk
from tests.support.rubber import make_rubber


def rubber():
    return make_rubber(0.5)


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


def test_a_compression_has_the_same_solution_alone_as_after_others(disk):
    after, alone = disk.compress([0.02, 0.05, 0.15])[-1], disk.compress([0.15])[-1]
    assert after.load == pytest.approx(alone.load, rel=1e-7)
    assert after.state == pytest.approx(alone.state, abs=1e-6)


def test_disks_of_one_shape_scale_with_size_and_modulus():
    one = compress_disk(rubber(), radius=1e-3, height=2e-3, strains=[0.1])
    large = compress_disk(rubber(), radius=3e-3, height=6e-3, strains=[0.1])
    assert large.force == pytest.approx(9 * one.force, rel=1e-9)
    assert large.energy == pytest.approx(27 * one.energy, rel=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"radius": 0.0}, "positive radius"),
        ({"strains": [0.1, 0.05]}, "ascend"),
        ({"strains": [0.1, 0.3, 0.2]}, "ascend"),
        ({"strains": [0.1, 0.1]}, "ascend"),
        ({"strains": []}, "ascend"),
        ({"strains": [1.0]}, "ascend"),
    ],
)
def test_bad_requests_are_refused_in_words(change, message):
    with pytest.raises(ValueError, match=message):
        compress_disk(rubber(), **{"radius": 1e-3, "height": 1e-3, "strains": [0.1], **change})


@pytest.mark.slow
def test_a_disk_that_folds_says_where(monkeypatch):
    monkeypatch.setattr(bonded_disk, "GRIDS", (3, 4, 5))
    with pytest.raises(ConvergenceError, match="no convergence beyond a compression of"):
        compress_disk(rubber(), radius=1e-3, height=2e-3, strains=[0.999])


@pytest.mark.slow
def test_a_disk_that_cannot_be_compressed_returns_what_it_reached():
    with pytest.raises(bonded_disk.IncompleteCompressionError, match=r"compressed to 0\.1, not to 0\.3") as stopped:
        compress_disk(rubber(), radius=12e-3, height=2e-3, strains=[0.05, 0.1, 0.3])
    alone = compress_disk(rubber(), radius=12e-3, height=2e-3, strains=[0.05, 0.1])
    assert stopped.value.reached.force == pytest.approx(alone.force)
