"""The statement of a path, its baseline, and the text of its progress."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fem_reference.finite_strain.loading_path import LoadingPath, Units, name_grid
from meshes import Cover, Layer, Material, Sphere
from tests.support.rubber import make_cover


def make_path(model, targets=(1.0, 2.0), friction=0.3):
    return LoadingPath(
        cover=make_cover(0.45, model), indenter=Sphere(radius=4e-3), targets=targets, control="load", friction=friction
    )


@pytest.mark.parametrize("model", ["linear-elastic", "neo-hookean"])
def test_the_baseline_is_at_small_strain_without_friction(model):
    baseline = make_path(model).baseline
    assert baseline.friction == 0
    assert baseline.load_scale < 0.01
    assert baseline.targets == (1.0, 2.0)
    assert baseline.baseline == baseline


def test_the_materials_decide_whether_strain_is_small():
    assert make_path("linear-elastic").at_model_strain.load_scale == make_path("linear-elastic").baseline.load_scale
    assert make_path("neo-hookean").at_model_strain == make_path("neo-hookean")


@given(targets=st.lists(st.floats(1e-6, 1e3), min_size=1, max_size=5))
def test_scaled_targets_are_proportional_to_the_targets(targets):
    path = make_path("linear-elastic", tuple(sorted(targets)))
    for each in (path, path.baseline):
        assert each.scaled_targets == pytest.approx(
            [each.load_scale * target / path.units.force for target in path.targets]
        )


def test_progress_names_the_grid_first():
    lines = []
    name_grid(lines.append, 6)("1 N at 0.1 mm")
    assert lines == ["6 elements through the cover: 1 N at 0.1 mm"]
    assert name_grid(None, 6) is None


def test_a_cover_is_one_thick_and_targets_are_in_its_units():
    soft, stiff = (
        Material(name="m", model="neo-hookean", parameters={"shear_modulus": mu}, poisson_ratio=0.5)
        for mu in (1e5, 3e6)
    )
    cover = Cover(layers=(Layer(thickness=3e-3, material=soft), Layer(thickness=1e-3, material=stiff)))
    scaled = Units.of(cover).scale_cover(cover)
    assert [layer.thickness for layer in scaled.layers] == pytest.approx([0.75, 0.25])
    assert [layer.material for layer in scaled.layers] == [soft, stiff]
    path = LoadingPath(cover=cover, indenter=Sphere(radius=4e-3), targets=(0.4e-3,), control="depth")
    assert path.scaled_targets == pytest.approx([0.1])
    loaded = LoadingPath(cover=cover, indenter=Sphere(radius=4e-3), targets=(6.0,), control="load")
    assert loaded.scaled_targets == pytest.approx([6.0 / (3e6 * 4e-3**2)])
