"""Finite strain under foils and deep under sharp edges, against the exact layers and against other meshes."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference import IncompletePathError, press, press_path
from fem_reference.closed_form import indent
from fem_reference.finite_strain.axisymmetric_path import press_axisymmetric
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.indentation import finite_strain
from meshes import Cover, Cylinder, Layer, Material, Sphere, TexelArray
from meshes.catalogue import MATERIALS
from tests.support.bounded import bounded
from tests.support.rubber import make_cover

ARRAY = TexelArray.grid(15, 15, pitch=3.4e-3)
FOIL = Material(name="foil", model="linear-elastic", parameters={"youngs_modulus": 3e9}, poisson_ratio=0.38)


def stack(soft: Material) -> Cover:
    """A foil of 0.1 mm on 1.5 mm of a soft material."""
    return Cover(layers=(Layer(thickness=1.5e-3, material=soft), Layer(thickness=0.1e-3, material=FOIL)))


def soft(model: str) -> Material:
    """A rubber with a Young's modulus of 60 kPa, linear or neo-Hookean."""
    parameters = {"shear_modulus": 60e3 / 2.98} if model == "neo-hookean" else {"youngs_modulus": 60e3}
    return Material(name="soft", model=model, parameters=parameters, poisson_ratio=0.49)


@pytest.mark.slow
def test_a_light_contact_on_a_foil_has_the_area_of_the_exact_layers():
    ball, depth = Sphere(radius=8e-3), 8e-6
    found = press(stack(soft("neo-hookean")), ARRAY, ball, depth=depth)
    exact = indent(stack(soft("linear-elastic")), ball, depth=depth)
    wanted = np.pi * exact.contact_radius**2
    assert found.contact_area == pytest.approx(wanted, rel=max(0.05, found.error_estimate["contact_area"]))
    assert found.error_estimate["contact_area"] < 0.3


@pytest.mark.slow
def test_forces_under_a_foil_balance_although_it_reaches_beyond_the_mesh():
    found = press(stack(MATERIALS["ecoflex-00-30"]), ARRAY, Sphere(radius=4e-3), load=1.0)
    assert abs(found.balance) < 1e-4
    assert not any("differ from the load" in sentence for sentence in found.warnings)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "radius"), [pytest.param("ecoflex-00-10", 4e-3, marks=pytest.mark.bench), ("dragon-skin-10", 2e-3)]
)
def test_a_cylinder_reaches_half_of_the_thickness_of_a_soft_cover(name, radius):
    cover = Cover(layers=(Layer(thickness=2e-3, material=MATERIALS[name]),))
    found = press(cover, ARRAY, Cylinder(radius=radius), depth=1e-3)
    assert found.depth == 1e-3
    assert abs(found.balance) < 1e-3
    assert found.error_estimate["total_force"] < 0.05
    assert "rounded" in found.assumptions["edge"]


@pytest.mark.slow
def test_a_hopeless_load_is_told_with_the_load_that_was_reached():
    cover = Cover(layers=(Layer(thickness=2e-3, material=MATERIALS["ecoflex-00-10"]),))
    with bounded(8000), pytest.raises(IncompletePathError, match=r"of the 5 N asked for") as stopped:
        press(cover, ARRAY, Sphere(radius=4e-3), load=5.0)
    assert 1.5 < stopped.value.reached[-1].total_force < 5.0


#: A soft rubber under a wide face.
SOFT = Cover(layers=(Layer(thickness=1.6e-3, material=MATERIALS["ecoflex-00-50"]),))


@pytest.mark.slow
def test_a_wide_face_on_soft_rubber_sinks_as_deep_as_one_with_a_wider_edge():
    """The depth was computed with an edge of 0.192 mm; the edge is now as fine as elsewhere."""
    found = press(SOFT, ARRAY, Cylinder(radius=5e-3), load=4.2)
    assert "rounded with 0.08 mm" in found.assumptions["edge"]
    assert found.depth == pytest.approx(0.1516 * 1.6e-3, rel=0.01)
    assert found.error_estimate["depth"] < 0.02


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ratio", "radius", "share"),
    [
        pytest.param(0.4, 1.696e-3, 0.36, marks=pytest.mark.bench),
        (0.4, 1.0e-3, 0.22),
        pytest.param(0.49, 3e-3, 0.18, marks=pytest.mark.bench),
        (0.3, 2.2e-3, 0.45),
    ],
)
def test_a_load_and_its_depth_belong_together_deep_in_the_cover(ratio, radius, share):
    cover = make_cover(ratio, thickness=1.297e-3)
    face = Cylinder(radius=radius)
    by_depth = press(cover, ARRAY, face, depth=share * 1.297e-3)
    by_load = press(cover, ARRAY, face, load=by_depth.total_force)
    allowed = by_depth.error_estimate["total_force"] + by_load.error_estimate["depth"]
    assert by_load.depth == pytest.approx(by_depth.depth, rel=allowed)
    assert allowed < 0.04


@pytest.mark.slow
def test_a_rounded_disk_deep_in_rubber_carries_what_another_package_finds():
    """FElupe's force, 20.354 N, is printed by `benchmarks/disk_felupe.py`."""
    cover, face = make_cover(0.4, thickness=1.297e-3), Cylinder(radius=1.696e-3)
    path = LoadingPath(cover=cover, indenter=face, targets=(0.36 * 1.297e-3,), control="depth")
    (found,), _ = press_axisymmetric(
        path,
        elements_per_thickness=13,
        contact_radius=face.radius,
        fillet=0.0934e-3,
        reach=15e-3,
        approach=0.36 * 1.297e-3,
    )
    assert 2.423 * found.total_force == pytest.approx(20.354, rel=5e-4)  # the cover has 1 MPa, FElupe's 2.423 MPa


@pytest.mark.slow
@pytest.mark.bench
def test_loads_on_one_path_sink_as_deep_as_alone():
    cover = make_cover(0.4, thickness=1.297e-3)
    face, loads = Cylinder(radius=1.7e-3), (2.0, 5.5)
    together = press_path(cover, ARRAY, face, loads=loads)
    for load, found in zip(loads, together, strict=True):
        alone = press(cover, ARRAY, face, load=load)
        assert found.total_force == pytest.approx(load, rel=1e-9)
        allowed = found.error_estimate["depth"] + alone.error_estimate["depth"]
        assert found.depth == pytest.approx(alone.depth, rel=allowed)


@pytest.mark.slow
@pytest.mark.bench
def test_where_a_fine_and_a_wide_edge_serve_they_agree_within_the_stated_errors(monkeypatch):
    fine = press(SOFT, ARRAY, Cylinder(radius=5e-3), load=2.0)
    assert "rounded with 0.08 mm" in fine.assumptions["edge"]
    monkeypatch.setattr(finite_strain, "choose_fillet", lambda *_: 0.192e-3)
    wide = press(SOFT, ARRAY, Cylinder(radius=5e-3), load=2.0)
    for name in ("depth", "peak_texel"):
        one, other = (each.texel_forces.max() if name == "peak_texel" else each.depth for each in (fine, wide))
        assert abs(one / other - 1) < fine.error_estimate[name] + wide.error_estimate[name]
