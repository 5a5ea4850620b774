"""Axisymmetric paths: the edge of the contact, and the balance of load and base pressure."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference import closed_form
from fem_reference.finite_strain.axisymmetric_path import press_axisymmetric
from fem_reference.finite_strain.loading_path import LoadingPath
from meshes import Cylinder, Sphere
from tests.support.rubber import make_cover


@pytest.mark.parametrize(
    ("elements", "count"),
    [
        pytest.param(6, 2, marks=pytest.mark.slow),
        pytest.param(6, 11, marks=pytest.mark.slow),
        pytest.param(9, 11, marks=pytest.mark.slow),
    ],
)
def test_the_contact_edge_is_found_between_the_nodes_at_every_depth(elements, count):
    cover, radius = make_cover(0.49), 5e-3
    edges = np.linspace(0.75e-3, 1.35e-3, count)
    depths = [closed_form.sphere(cover, radius, edge).depth for edge in edges]
    path = LoadingPath(
        cover=cover, indenter=Sphere(radius=radius), targets=tuple(depths), control="depth", load_scale=1e-3
    )
    states, _ = press_axisymmetric(
        path,
        elements_per_thickness=elements,
        contact_radius=edges[-1],
        fillet=0.1e-3,
        reach=30e-3,
    )
    assert np.sqrt([state.area / np.pi for state in states]) == pytest.approx(edges, rel=0.015)


@pytest.mark.parametrize("indenter", [pytest.param(Sphere(radius=4e-3), marks=pytest.mark.slow), Cylinder(radius=2e-3)])
def test_the_base_carries_the_load_at_every_target(indenter):
    path = LoadingPath(cover=make_cover(0.45), indenter=indenter, targets=(0.1, 0.4), control="load")
    options = {"elements_per_thickness": 4, "contact_radius": 1.5e-3, "fillet": 0.3e-3, "reach": 25e-3}
    coarse, solved = press_axisymmetric(path, **options)
    finer, _ = press_axisymmetric(path, **(options | {"elements_per_thickness": 5}), coarse=solved)
    for states in (coarse, finer):
        for state, load in zip(states, path.targets, strict=True):
            assert state.total_force == pytest.approx(load, rel=1e-9)
            assert state.base.spread.reaction == pytest.approx(1, rel=2e-3)
        assert states[0].depth < states[1].depth
    assert finer[1].depth == pytest.approx(coarse[1].depth, rel=0.03)
