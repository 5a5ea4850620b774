import json

import numpy as np
import pytest

from meshes.catalogue import MATERIALS


def test_materials_are_listed_as_a_table_and_as_json(softcover):
    status, out, _ = softcover("materials", "--json")
    assert status == 0
    assert json.loads(out)["materials"]["dragon-skin-30"]["youngs_modulus"] == pytest.approx(669e3)
    assert "dragon-skin-30" in softcover("materials")[1]


def test_natural_rubbers_are_named_by_their_hardness_which_fits_their_modulus(softcover):
    listed = json.loads(softcover("materials", "--json")[1])["materials"]
    hardnesses = [int(name.removeprefix("natural-rubber-")) for name in listed if name.startswith("natural-rubber-")]
    assert hardnesses == [30, 40, 50, 60, 70]
    moduli = [listed[f"natural-rubber-{hardness}"]["youngs_modulus"] for hardness in hardnesses]
    assert (np.diff(moduli) > 0).all()
    for hardness in hardnesses:
        found = json.loads(softcover("materials", f"natural-rubber-{hardness}", "--json")[1])
        assert f"at {hardness} IRHD" in found["source"]
        band = json.loads(softcover("materials", "--hardness", hardness, "--json")[1])
        assert band["low"] < found["youngs_modulus"] < band["high"]


def test_all_materials_with_source_and_spread(softcover):
    status, out, _ = softcover("materials")
    assert status == 0
    for name in MATERIALS:
        assert f"{name} " in out
    assert "Marechal" in out
    assert "±50 %" in out
    assert "drops out" in " ".join(out.split())
    assert max(map(len, out.splitlines())) <= 80


def test_one_material(softcover):
    status, out, _ = softcover("materials", "dragon-skin-30-ogden")
    flat = " ".join(out.replace("│", " ").split())
    assert status == 0
    assert "mu 197 kPa" in flat
    assert "alpha 2.72" in flat
    assert "591 kPa at small strain, ±50 %" in flat
    assert "Marechal" in flat
    assert "drops out of the point spread function" in flat
    found = json.loads(softcover("materials", "dragon-skin-30-ogden", "--json")[1])
    assert found["parameters"] == {"mu": 197e3, "alpha": 2.72}
    assert found["bulk_modulus"] is None
    assert found["psf_deviation_per_thickness"] == pytest.approx(1.0)


def test_foam_shows_what_its_poisson_ratio_does(softcover):
    out = " ".join(softcover("materials", "silicone-foam")[1].replace("│", " ").split())
    assert "0.15 ±0.15" in out
    assert "0.00 to 0.65" in out


def test_modulus_from_a_hardness(softcover):
    status, out, _ = softcover("materials", "--hardness", "30")
    assert status == 0
    assert "1.151 MPa" in out
    assert "gent-1958" in out
    found = json.loads(softcover("materials", "--hardness", "30 shore-a", "--json")[1])
    assert found["youngs_modulus"] == pytest.approx(1.1515e6, rel=1e-3)
    assert found["by_relation"]["gent-1958"] == pytest.approx(1.1424e6, rel=1e-4)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["dragonskn-30"], "did you mean 'dragon-skin-30'"),
        (["--hardness", "90"], "--hardness: the relations hold for 20..80 Shore A"),
        (["--hardness", "soft"], "--hardness: 'soft' is not a hardness"),
        (["rtv615", "--hardness", "30"], "leave out the name"),
    ],
)
def test_bad_words(softcover, words, expected):
    status, out, err = softcover("materials", *words)
    assert (status, out) == (2, "")
    assert expected in err


@pytest.mark.parametrize("name", ["Dragon Skin 30", "DRAGON_SKIN_30", " dragonskin-30 ", "Dragon-Skin 30"])
def test_names_in_any_case_with_blanks_and_underscores(softcover, name):
    assert json.loads(softcover("materials", name, "--json")[1])["name"] == "dragon-skin-30"


def test_no_two_names_differ_by_their_separators_alone():
    assert len({name.replace("-", "") for name in MATERIALS}) == len(MATERIALS)


def test_a_range_that_is_not_symmetric(softcover):
    assert "15 MPa at small strain, 5..45 MPa" in softcover("materials", "TPU")[1]
    found = json.loads(softcover("materials", "tpu", "--json")[1])
    assert (found["youngs_modulus_low"], found["youngs_modulus_high"]) == pytest.approx((5e6, 45e6))


def test_the_curve_is_shown_and_written(softcover, tmp_path):
    status, out, err = softcover("materials", "Sylgard 184", "--out", tmp_path / "curve")
    assert status == 0
    assert "nominal stress [kPa] over strain [%], uniaxial" in out
    assert "wrote material.csv, material.svg, material.png" in err
    assert {path.name for path in (tmp_path / "curve").glob("material.*")} == {
        "material.csv",
        "material.svg",
        "material.png",
    }
    status, _, err = softcover("materials", "--out", tmp_path / "curve")
    assert status == 2
    assert "name it" in err
