"""What `softcover derive` prints, against the numbers of a derivation of which every one differs."""

import math
from dataclasses import replace
from types import SimpleNamespace

import pytest

from validation.cli.commands.derive import _list_estimates, _list_results

POINT = SimpleNamespace(
    radius=1e-3, share=0.76, largest_load=1.25, saturation_load=2.5, lightest=0.81, heaviest=0.72
)  # fmt: skip
VALIDITY = SimpleNamespace(
    ball_radius=3.4e-3, strain="small", load_2_percent=1.5, load_5_percent=4.25, largest_load=4.25
)


@pytest.fixture
def made(wts_derivation):
    """The derivation with other numbers."""
    fit = wts_derivation.fit
    gaussian = replace(fit.gaussian, sigma_x=0.51, sigma_y=0.62, ksize_x=3, ksize_y=5)
    given = {name: getattr(wts_derivation, name) for name in ("sensor", "undetermined")} | {
        "fit": replace(fit, gaussian=gaussian, residual=0.0412, outside_kernel=0.0523),
        "error_estimate": {"total_force": 0.001, "peak_texel": 0.002, "sigma": 0.003},
        "resolution": 1.81e-3, "resolution_on_array": 8.5e-3,
        "sensitivity": {"thickness": 63.0, "poisson_ratio": -1.5},
        "depth": SimpleNamespace(
            foundation=SimpleNamespace(modulus=1.38e9, uncertainty=0.02e9, estimator="least-squares-force"),
            contact=SimpleNamespace(solref=(0.0242, 1.0), solimp=(0.95, 0.96), depth=0.287e-3, mass=0.151),
        ),
        "parameters": SimpleNamespace(validity=VALIDITY, electronics=wts_derivation.parameters.electronics),
        "tip": POINT, "seconds": 18.484,
    }  # fmt: skip
    return SimpleNamespace(**given)


def test_each_row_prints_its_own_number(made):
    rows, name = {}, ""
    for title, text in _list_results(made):
        name = title or name
        rows.setdefault(name, []).append(text)
    assert rows.pop("cover") == ["ASSUMED: 2 mm assumed elastomer (E 1 MPa, nu 0.49)"]
    assert rows.pop("not determined") == list(made.undetermined)
    (tip, fitted) = rows.pop("characteristic")
    assert tip.startswith("counts are a function of the force applied through the cover, tip 1 mm")
    assert fitted == "the share is fitted up to 1.25 N (0.8100 under a point load, 0.7200 under 1.25 N)"
    assert rows == {
        "sigma x, y": ["0.5100, 0.6200 pitches (least-squares-uniform)"],
        "ksize x, y": ["3, 5 texels"],
        "kernel's misfit": ["4.12 % of the load on wrong texels (residual)"],
        "beyond the kernel": ["5.23 % of the load"],
        "resolution": ["1.81 mm at the base", "8.50 mm with these texels, worst alignment"],
        "sigma / thickness": ["+0.063 pitches per mm"],
        "sigma / Poisson ratio": ["-0.0150 pitches per 0.01"],
        "sigma / Young's modulus": ["none: it drops out"],
        "foundation modulus": ["1.38 +- 0.02 N/mm3 (least-squares-force)"],
        "MuJoCo's plate": ["solref 0.0242 s, 1; impedance 0.9500: 0.287 mm under 151 g"],
        "range of fast model": [
            "misplaces at most 2 % up to 1.5 N (ball of 3.4 mm radius, small strain)",
            "and at most 5 % up to 4.25 N, the largest load compared",
        ],
        "error estimate": ["total force 0.1 %, largest texel 0.2 %, width of the kernel 0.3 %"],
        "time": ["18.48 s"],
    }


def test_what_is_not_known_is_said_or_left_out(made):
    made.resolution, made.depth, made.tip = None, None, None
    made.parameters.validity = SimpleNamespace(**{**vars(VALIDITY), "load_2_percent": 0})
    rows = dict(_list_results(made))
    assert rows["side edges"].startswith("free: the spread differs")
    assert not {"resolution", "foundation modulus", "MuJoCo's plate"} & set(rows)
    assert rows["range of fast model"].startswith("misplaces at most 2 % up to no load (")
    made.parameters.validity, made.resolution = None, math.nan
    rows = list(_list_results(made))
    assert ("range of fast model", "not stated") in rows
    assert ("resolution", "none at the base") in rows


def test_the_estimator_that_is_used_comes_first():
    fit = SimpleNamespace(estimator="b", estimates={"a": (0.1, 0.2), "b": (0.3, 0.45), "c": (math.nan, 0.6)})
    assert list(_list_estimates(fit)) == [
        ("b (used)", "0.3000", "0.4500"), ("a", "0.1000", "0.2000"), ("c", "none", "0.6000")
    ]  # fmt: skip
