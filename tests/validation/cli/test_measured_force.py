import json

import numpy as np
import pytest

from fem_reference.closed_form import sphere
from meshes import Cover, Layer, Material, Sphere
from tests.exact.no_slip import stuck_shape

RADIUS, CONTACTS, FACTOR = 5e-3, (0.8e-3, 1.2e-3, 1.6e-3), 0.7
FILE = """
name = "made up"
indenter = "sphere:radius=5mm"
uncertainty = {{ force = "1 mN" }}
[[cover.layer]]
thickness = "2 mm"
material = {{ model = "linear-elastic", youngs_modulus = "1 MPa", poisson_ratio = 0.45 }}
{}
"""
POINT = '[[point]]\ndepth = "{:.12g} m"\nforce = "{:.12g} N"\nuse = "{}"\n'


def made_up(solve):
    """The file of a ball on a layer whose true modulus is 0.7 times the one given, from an exact solution."""
    true = Material(name="", model="linear-elastic", parameters={"youngs_modulus": FACTOR * 1e6}, poisson_ratio=0.45)
    cover = Cover(layers=(Layer(thickness=2e-3, material=true),))
    found = [solve(cover, contact) for contact in CONTACTS]
    points = zip(found, ("fit", "fit", "score"), strict=True)
    return FILE.format("".join(POINT.format(each.depth, each.force, use) for each, use in points))


def press_smooth(cover, contact):
    return sphere(cover, RADIUS, contact)


def press_stuck(cover, contact):
    return stuck_shape(cover, lambda r: Sphere(radius=RADIUS).gap(r, np.zeros_like(r)), contact)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("solve", "index", "bound"),
    [pytest.param(press_smooth, 0, "frictionless", marks=pytest.mark.bench), (press_stuck, 1, "no slip")],
)
def test_the_modulus_and_the_bound_of_an_exact_solution_come_back(softcover, tmp_path, solve, index, bound):
    (tmp_path / "pad.toml").write_text(made_up(solve))
    status, out, _ = softcover("validate", "wts-0614-34", "--measured", "pad.toml", "--json")
    found = json.loads(out)
    row = found["rows"][index]
    assert status == 0
    assert row["name"] == bound
    assert row["scale"] == pytest.approx(FACTOR, rel=2e-3)
    assert row["interval"][0] < FACTOR < row["interval"][1]
    assert abs(row["error"][2]) < row["u_val"][2]
    errors = [abs(each["error"][2]) for each in found["rows"]]
    assert errors[index] < 0.2 * errors[1 - index]


@pytest.mark.slow
def test_the_table_fits_a_terminal_and_names_the_bounds(softcover, tmp_path):
    (tmp_path / "pad.toml").write_text(made_up(press_smooth))
    status, out, _ = softcover("validate", "wts-0614-34", "--measured", "pad.toml")
    assert status == 0
    assert "shear modulus 0.2414 MPa" in out
    assert max(len(line) for line in out.splitlines() if "\u2502" in line) <= 80
    assert "The uncertainty of zero of depth is not stated" in out


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (FILE.format("")[: -len("\n\n")], "pad.toml: point: is missing; write for example the tables [[point]]\n"),
        ("name =", "pad.toml: not a TOML file"),
    ],
)
def test_faults_are_lines(softcover, tmp_path, text, said):
    (tmp_path / "pad.toml").write_text(text)
    status, _, err = softcover("validate", "wts-0614-34", "--measured", "pad.toml")
    assert status == 2
    assert err.startswith(f"softcover: {said}")
