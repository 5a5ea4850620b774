"""Stress-strain curves against the strain energies of the finite elements."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from fem_reference.materials import create_finite_strain_energy, volume_ratio
from meshes import Material
from meshes.catalogue import MATERIALS
from validation.material_curve import compute_stress, trace_stress, write_curve

RUBBERS = [name for name, material in MATERIALS.items() if not material.small_strain_only]
MOONEY = Material(name="m", model="mooney-rivlin", parameters={"c10": 1e5, "c01": 4e4}, poisson_ratio=0.5)


@pytest.mark.parametrize("material", [*(MATERIALS[name] for name in RUBBERS), MOONEY], ids=lambda each: each.name)
def test_stress_is_the_slope_of_the_strain_energy(material):
    energy = create_finite_strain_energy(material)
    stretch, step = np.array([0.6, 0.9, 1.1, 1.8]), 1e-5

    def density(along):
        across = along**-0.5
        gradient = np.zeros((len(along), 3, 3))
        gradient[:, 0, 0], gradient[:, 1, 1], gradient[:, 2, 2] = along, across, across
        return energy.isochoric(gradient, volume_ratio(gradient)).energy

    slope = (density(stretch + step) - density(stretch - step)) / (2 * step)
    np.testing.assert_allclose(compute_stress(material, stretch - 1), slope, rtol=1e-6)


@pytest.mark.parametrize("stretch", [0.6, 1.8])
def test_a_foam_has_the_lateral_stretch_of_least_energy(stretch):
    foam = Material(name="foam", model="neo-hookean", parameters={"shear_modulus": 1e5}, poisson_ratio=0.2)

    def density(along):
        def energy(across):
            volume = along * across**2
            bulk = 2e5 * 1.2 / (3 * 0.6)
            return 5e4 * ((along**2 + 2 * across**2) * volume ** (-2 / 3) - 3) + bulk / 2 * (volume - 1) ** 2

        return minimize_scalar(energy, bounds=(0.5, 1.5), method="bounded", options={"xatol": 1e-10}).fun

    slope = (density(stretch + 1e-4) - density(stretch - 1e-4)) / 2e-4
    assert compute_stress(foam, np.array([stretch - 1])) == pytest.approx(slope, rel=1e-5)


@pytest.mark.parametrize(
    "material",
    [
        *(MATERIALS[name] for name in ("dragon-skin-30", "dragon-skin-30-yeoh", "dragon-skin-30-ogden", "pet")),
        Material(name="foam", model="neo-hookean", parameters={"shear_modulus": 1e5}, poisson_ratio=0.1),
    ],
    ids=lambda each: each.name,
)
def test_the_slope_at_zero_is_youngs_modulus(material):
    slope = np.diff(compute_stress(material, np.array([-1e-6, 1e-6])))[0] / 2e-6
    assert slope == pytest.approx(material.youngs_modulus, rel=1e-5)


def test_files_hold_the_curve(tmp_path):
    material = MATERIALS["tpu"]
    write_curve(material, tmp_path / "curve.csv")
    table = np.loadtxt(tmp_path / "curve.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(table, np.column_stack(trace_stress(material)), rtol=1e-5, atol=1e-9)
