"""A material law added by registration alone is read, changed and pressed; every known law has what a law needs."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from scipy.optimize import brentq

import fem_reference.materials
from meshes.material import MODELS, Material, Model
from tests.verification.test_materials import derivative_error, small_strain_error, symmetry_error

#: Parameters of each law, its Poisson ratio and its shear modulus at small strain [Pa].
EXAMPLES = {
    "linear-elastic": ({"youngs_modulus": 2.6e5}, 0.3, 1e5),
    "neo-hookean": ({"shear_modulus": 1e5}, 0.4, 1e5),
    "mooney-rivlin": ({"c10": 3e4, "c01": 2e4}, 0.5, 1e5),
    "yeoh": ({"c1": 5e4, "c2": 1e4, "c3": -2e2}, 0.49, 1e5),
    "ogden": ({"mu": (7e4, 3e4), "alpha": (1.5, -2.0)}, 0.45, 1e5),
}


@pytest.mark.parametrize("name", MODELS)
def test_every_law_has_an_energy_of_its_modulus(name):
    """A new law needs an example here, and, unless it is for small strain only, its energy."""
    parameters, ratio, shear_modulus = EXAMPLES[name]
    known = {} if MODELS[name].poisson_ratio else {"poisson_ratio": ratio}
    material = Material(name="example", model=name, parameters=parameters, **known)
    assert (material.poisson_ratio, material.shear_modulus) == pytest.approx((ratio, shear_modulus))
    moved = material.with_poisson_ratio(0.2)
    assert (moved.model, moved.poisson_ratio) == (name, pytest.approx(0.2))
    if not material.small_strain_only:
        assert name in fem_reference.materials.ENERGIES
        energy = fem_reference.materials.create_energy(material, unit=1e5)
        assert max(derivative_error(energy), symmetry_error(energy)) < 1e-7
        assert small_strain_error(energy, shear_modulus / 1e5) < 1e-9


def test_a_law_that_determines_its_poisson_ratio_must_take_another_one():
    with pytest.raises(ValueError, match="give both or neither"):
        Model(parameters={}, shear_modulus=lambda _: 1.0, poisson_ratio=lambda _: 0.3)


@pytest.fixture(scope="module")
def added():
    root = Path(__file__).parents[1]
    command = [sys.executable, "-m", "tests.support.added_law"]
    return json.loads(subprocess.run(command, cwd=root, capture_output=True, text=True, check=True).stdout)  # noqa: S603 -- ours


def squeeze(mu, a, K, stretch):
    """Nominal uniaxial stress [Pa] of the added law; the sides, of stretch t, are free.

    With slope = mu/2 + 2 a (I1 - 3), a principal Cauchy stress is 2 slope J^(-5/3) (l_i^2 - tr C / 3) + K (J - 1).
    """

    def find_cauchy(t):
        J = stretch * t**2
        slope = mu / 2 + 2 * a * (J ** (-2 / 3) * (stretch**2 + 2 * t**2) - 3)
        part = 2 / 3 * slope * J ** (-5 / 3) * (stretch**2 - t**2)
        return 2 * part + K * (J - 1), -part + K * (J - 1)

    t = brentq(lambda t: find_cauchy(t)[1], 0.5, 2.0, xtol=1e-14)
    return find_cauchy(t)[0] * t**2


@pytest.mark.slow
def test_an_added_law_is_read_changed_and_pressed(added):
    assert added["read"] == pytest.approx([1e5, 3e5, 0.35])
    assert (added["to the law"], added["from the law"]) == pytest.approx((0.35, 0.35))
    assert not added["assumed"]
    assert added["bulk"] == pytest.approx(1e6)
    assert added["scaled"] == pytest.approx({"mu": 2e5, "a": 8e4, "K": 6e5})
    assert added["moved"] == pytest.approx({"mu": 1e5, "a": 4e4, "K": 1e5 * 2.5 / 1.5})
    assert added["incompressible"] == pytest.approx(0.5, abs=2e-6)
    assert added["zero"] == [0.0] * 5


@pytest.mark.slow
def test_faults_of_an_added_law_name_what_the_user_wrote(added):
    missing, both, low, misspelt = added["faults"].values()
    assert "soft-quadratic takes mu [Pa], a [Pa], K [Pa]" in missing
    assert "determine poisson_ratio" in both
    assert "the Poisson ratio that the parameters of soft-quadratic determine must lie in 0..0.5, not -" in low
    assert "did you mean 'K'?" in misspelt


@pytest.mark.slow
def test_a_plate_squeezes_a_sliding_pad_of_an_added_law_evenly(added):
    """Uniaxial stress at 70 % of the thickness: twice the force of small strain."""
    parameters = {"mu": 1e5, "a": 4e4, "K": 3e5, "stretch": 0.7}
    assert added["strain"] == "finite"
    assert added["force"] == pytest.approx(-48e-6 * squeeze(**parameters), rel=1e-3)
    assert added["force"] != pytest.approx(-48e-6 * squeeze(**{**parameters, "a": 0.0}), rel=0.05)
