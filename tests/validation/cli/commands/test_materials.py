import json

import numpy as np
import pytest

from meshes.catalogue import MATERIALS


@pytest.fixture
def ask(softcover):
    """Run the command: the words that it prints without table lines, and with --json the numbers."""

    def run(*words):
        status, out, _ = softcover("materials", *words)
        assert status == 0
        return json.loads(out) if "--json" in words else " ".join(out.replace("│", " ").split())

    return run


def test_natural_rubbers_are_named_by_their_hardness_which_fits_their_modulus(ask):
    listed = ask("--json")["materials"]
    hardnesses = [int(name.removeprefix("natural-rubber-")) for name in listed if name.startswith("natural-rubber-")]
    assert hardnesses == [30, 40, 50, 60, 70]
    moduli = [listed[f"natural-rubber-{hardness}"]["youngs_modulus"] for hardness in hardnesses]
    assert (np.diff(moduli) > 0).all()
    for hardness, modulus in zip(hardnesses, moduli, strict=True):
        assert f"at {hardness} IRHD" in listed[f"natural-rubber-{hardness}"]["source"]
        band = ask("--hardness", hardness, "--json")
        assert band["low"] < modulus < band["high"]


@pytest.mark.parametrize(
    ("name", "told", "numbers"),
    [
        (
            "dragon-skin-30-ogden",
            ["mu 197 kPa", "alpha 2.72", "591 kPa at small strain, ±50 %", "Marechal", "drops out of the point spread"],
            {"parameters": {"mu": 197e3, "alpha": 2.72}, "bulk_modulus": None, "psf_deviation_per_thickness": 1.0},
        ),
        ("dragon-skin-30", ["nominal stress", "61 kPa at 10 %, 158 kPa at 30 %"], {"youngs_modulus": 669e3}),
        ("silicone-foam", ["0.15 ±0.15", "0.00 to 0.65"], {"poisson_spread": 0.15}),
        (
            "TPU",
            ["15 MPa at small strain, 5..45 MPa"],
            {"youngs_modulus_low": 5e6, "youngs_modulus_high": 45e6, "name": "tpu"},
        ),
        *[(name, [], {"name": "dragon-skin-30"}) for name in ("Dragon Skin 30", "DRAGON_SKIN_30", " dragonskin-30 ")],
    ],
)
def test_one_material(ask, name, told, numbers):
    words, found = ask(name), ask(name, "--json")
    assert all(each in words for each in told)
    for key, number in numbers.items():
        assert found[key] == (pytest.approx(number) if isinstance(number, float) else number)


def test_modulus_from_a_hardness(ask):
    found = ask("--hardness", "30 shore-a", "--json")
    assert found["youngs_modulus"] == pytest.approx(1.1515e6, rel=1e-3)
    assert found["by_relation"]["gent-1958"] == pytest.approx(1.1424e6, rel=1e-4)


def test_no_two_names_differ_by_their_separators_alone():
    assert len({name.replace("-", "") for name in MATERIALS}) == len(MATERIALS)


def test_the_curve_is_written_once(softcover, tmp_path):
    for name in ("curve.csv", "curve.png"):
        assert f"wrote {tmp_path / name}" in softcover("materials", "Sylgard 184", "--out", tmp_path / name)[2]
        assert (tmp_path / name).stat().st_size > 1000
        assert softcover("materials", "Sylgard 184", "--out", tmp_path / name)[0] == 2


@pytest.mark.parametrize("columns", ["0", "1", "30"])
def test_a_terminal_that_states_a_tiny_width_loses_no_column(ask, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", columns)
    assert "bulk modulus 4.861 GPa" in ask("pet")
