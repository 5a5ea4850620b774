"""Cubes and wishes of sweeps against values that are computed by hand."""

import json
import math

import numpy as np
import pytest

from validation.errors import InputError
from validation.schema.sweep import SweepTables
from validation.sweeps.cube import Swept, read_wish
from validation.sweeps.designs import Design, find_numbers, list_designs
from validation.sweeps.measurements import Quantity

THICKNESS, PITCH = "cover.layer[0].thickness", "array.pitch"


def make_tables(designs, measure="derive", **options):
    given = {"sensor": "wts-0614-34", "measure": measure, "designs": designs, **options}
    return SweepTables.model_validate(given)


def make_swept(designs, rows, wish="", *, words=None, lost=None, measure="derive", **options):
    """A sweep of a grid whose designs have these quantities; None for a lost one."""
    tables = make_tables(designs, measure, **options)
    keys, lists = list(designs), [axis.values for axis in tables.designs.values()]
    combined = np.stack(np.meshgrid(*[range(len(each)) for each in lists], indexing="ij"), axis=-1)
    values = [
        {key: lists[k][i] for k, (key, i) in enumerate(zip(keys, row, strict=True))}
        for row in combined.reshape(-1, len(keys))
    ]
    results = [
        [None if one is None else {"words": text, "seconds": 1.5, "quantities": one} for one in row]
        for row, text in zip(rows, words or [""] * len(rows), strict=True)
    ]
    return Swept(
        tables=tables, designs=[Design(values=each, sensor="sensor") for each in values[: len(rows)]],
        results=results, lost=lost or {}, wish=read_wish(wish) if wish else (),
    )  # fmt: skip


def quantity(value, less=0.0, more=0.0, unit="N"):
    return Quantity(value, value - less, value + more, unit)


@pytest.mark.parametrize(
    ("text", "name", "sign", "limit", "unit"),
    [
        ("width_x < 4 mm", "width_x", -1, 4.0, "mm"), (" a>-2.5e-3N ", "a", 1, -2.5e-3, "N"),
        ("b2 > +.5", "b2", 1, 0.5, ""), ("c <7 % of load", "c", -1, 7.0, "% of load"),
    ],
)  # fmt: skip
def test_a_condition_has_name_sign_limit_and_unit(text, name, sign, limit, unit):
    (clause,) = read_wish(text)
    assert (clause.name, clause.sign, clause.limit, clause.unit) == (name, sign, limit, unit)
    assert clause.text == text.strip()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a = 3", "'a = 3' is no condition; write for example 'width_x < 4 mm'"), ("a < 3, b", "'b' is no condition"),
        ("a < 1.2.3 mm", "'1.2.3' in 'a < 1.2.3 mm' is no number"), ("a <", "is no condition"), ("", "is no condition"),
    ],
)  # fmt: skip
def test_what_is_no_condition_is_refused(text, words):
    with pytest.raises(InputError) as refused:
        read_wish(text)
    (fault,) = refused.value.faults
    assert fault.startswith("--wish: ")
    assert words in fault


@pytest.mark.parametrize(
    ("wish", "ends", "state"),
    [
        ("a < 4 N", (1.0, 0.5), "certain"), ("a < 3.5 N", (1.0, 0.5), "possible"),
        ("a < 3.4 N", (1.0, 0.5), "possible"),
        ("a < 2 N", (1.0, 0.5), "excluded"), ("a < 2.1 N", (1.0, 0.5), "possible"),
        ("a > 1.9 N", (1.0, 0.5), "certain"),
        ("a > 2 N", (1.0, 0.5), "possible"), ("a > 3.4 N", (1.0, 0.5), "possible"),
        ("a > 3.5 N", (1.0, 0.5), "excluded"),
        ("a > 2900 mN", (0.05, 0.5), "certain"), ("a > 2900 mN", (0.2, 0.5), "possible"),
        ("a < 3 N", (0.0, 0.0), "excluded"), ("a < 10 N, a > 2.5 N", (1.0, 0.5), "possible"),
        ("a > 2.5 N, a > 4 N", (1.0, 0.5), "excluded"),
    ],
)  # fmt: skip
def test_a_wish_is_certain_within_all_of_the_error_and_possible_within_some(wish, ends, state):
    swept = make_swept({THICKNESS: ["1 mm"]}, [[{"a": quantity(3.0, *ends)}]], wish)
    swept.check_wish()
    (judged,) = swept.judge()
    assert (judged.state, judged.between, judged.values) == (state, False, {THICKNESS: "1 mm"})
    assert (judged.reason == "") == (state == "certain")


def test_the_first_condition_that_is_not_certain_is_the_reason():
    row = {"a": quantity(3.0, 1.0, 0.5), "b": quantity(20.0, 4.0, 4.0, "mm")}
    swept = make_swept({THICKNESS: ["1 mm"]}, [[row]], "a > 1 N, a > 2.5 N, b < 22 mm")
    assert next(swept.judge()).reason == "a 3 (2 to 3.5) N, wished a > 2.5 N"
    swept = make_swept({THICKNESS: ["1 mm"]}, [[row]], "a > 2.5 N, b > 2.4 cm")
    (judged,) = swept.judge()
    assert (judged.state, judged.reason) == ("excluded", "b 20 (16 to 24) mm, wished b > 2.4 cm")


def test_designs_without_a_quantity_are_not_computed():
    rows = [[{"a": quantity(1.0)}], [{}], [None]]
    swept = make_swept(
        {THICKNESS: ["1 mm", "2 mm", "3 mm"]},
        rows,
        "a < 2",
        words=["", "too soft", ""],
        lost={2: "its worker was killed"},
    )  # fmt: skip
    assert [(each.state, each.reason) for each in swept.judge() if not each.between] == [
        ("certain", ""), ("not computed", "too soft"), ("not computed", "its worker was killed"),
    ]  # fmt: skip
    assert swept.words == ["", "too soft", "its worker was killed"]
    empty = make_swept({THICKNESS: ["1 mm"]}, [[{}]], "a < 2 N")
    assert [each.state for each in empty.judge()] == ["not computed"]
    empty.check_wish()  # nothing was measured, so that nothing is known


@pytest.mark.parametrize(
    ("wish", "words"),
    [("c < 2 N", "unknown quantity 'c'"), ("a < 2 mm", "a has the unit N; write for example '< 1 N'")],
)
def test_a_wish_that_no_quantity_meets_is_refused(wish, words):
    with pytest.raises(InputError) as refused:
        make_swept({THICKNESS: ["1 mm"]}, [[{"a": quantity(1.0)}]], wish).check_wish()
    assert words in str(refused.value)


def test_a_name_that_an_earlier_measurement_has_ends_with_the_number_of_the_measurement():
    rows = [
        [{"a": quantity(1.0), "b": quantity(2.0, unit="mm")}, {"a": quantity(3.0, 1.0)}, {"a": quantity(5.0)}],
        [None, {"a": quantity(4.0), "c": quantity(6.0)}, {}],
    ]
    swept = make_swept({THICKNESS: ["1 mm", "2 mm"]}, rows, measure=["derive", "derive", "derive"])
    found = swept.quantities
    assert list(found) == ["a", "b", "a_2", "c", "a_3"]
    nan = [math.nan] * 3
    np.testing.assert_array_equal(found["a"][1], [[1.0] * 3, nan])
    np.testing.assert_array_equal(found["a_2"][1], [[3.0, 2.0, 3.0], [4.0] * 3])
    np.testing.assert_array_equal(found["c"][1], [nan, [6.0] * 3])
    assert [found[name][0] for name in ("a", "b", "a_3")] == ["N", "mm", "N"]


def test_between_the_points_of_a_line_the_error_grows_by_what_leaving_one_out_makes():
    """1, 4, 2 and 3 at 1, 2, 4 and 5 mm: without the second and third point there are 4/3 and 11/3 instead."""
    rows = [[{"a": quantity(value, 0.1, 0.2)}] for value in (1.0, 4.0, 2.0, 3.0)]
    swept = make_swept({THICKNESS: ["1 mm", "2 mm", "4 mm", "5 mm"]}, rows, "a > 0 N")
    between = [each for each in swept.judge() if each.between]
    assert [each.values[THICKNESS] for each in between] == ["1.5 mm", "3 mm", "4.5 mm"]
    grown = max(4 - 4 / 3, 11 / 3 - 2)
    for middle, state in ((2.5, "possible"), (3.0, "certain"), (2.5, "possible")):
        assert (middle - 0.1 - grown > 0) == (state == "certain")
    assert [each.state for each in between] == ["possible", "certain", "possible"]
    assert between[0].reason == f"a 2.5 ({2.4 - grown:.4g} to {2.7 + grown:.4g}) N, wished a > 0 N"


def test_between_the_points_of_a_grid_the_differences_of_both_axes_add():
    """A product x y of 1, 2, 4 mm and 3, 5, 6 mm is linear along each axis, and a square is not."""
    lengths, pitches = (1.0, 2.0, 4.0), (3.0, 5.0, 6.0)
    rows = [[{"a": quantity(x * y), "b": quantity(x**2 + 10 * y**2)}] for x in lengths for y in pitches]
    designs = {THICKNESS: [f"{x:g} mm" for x in lengths], PITCH: [f"{y:g} mm" for y in pitches]}
    swept = make_swept(designs, rows, "a < 100 N, b < 0 N")
    found = {tuple(each.values.values()): each.reason for each in swept.judge() if each.between}
    assert len(found) == 25 - 9
    numbers = {key: [float(part) for part in reason.replace("(", " ").replace(")", " ").split()[1:5:1] if part != "to"]
               for key, reason in found.items()}  # fmt: skip
    along_x, along_y = 2.0, 20.0  # 1 + 5 instead of 4 at 2 mm; 10 (9 + 2 / 3 27) = 270 instead of 250 at 5 mm
    for (x, y), grown in (
        (("1.5 mm", "3 mm"), along_x), (("2 mm", "5.5 mm"), along_y), (("3 mm", "4 mm"), along_x + along_y),
    ):  # fmt: skip
        value, low, high = numbers[x, y]
        assert (value - low, high - value) == (pytest.approx(grown, abs=0.06), pytest.approx(grown, abs=0.06))
    assert numbers["1.5 mm", "3 mm"][0] == pytest.approx(92.5)
    assert numbers["2 mm", "5.5 mm"][0] == pytest.approx(309)


@pytest.mark.parametrize(
    ("values", "between"),
    [
        (["1 mm", "2 mm", "3 mm"], 2), (["1 mm", "2 mm"], 0), (["3 mm", "2 mm", "1 mm"], 0),
        (["1 mm", "1 mm", "2 mm"], 0),
        (["soft", "hard", "stiff"], 0),
    ],
)  # fmt: skip
def test_places_between_exist_along_three_or_more_ascending_numbers(values, between):
    rows = [[{"a": quantity(1.0)}] for _ in values]
    swept = make_swept({"cover.layer[0].name": values}, rows, "a < 2 N")
    assert sum(each.between for each in swept.judge()) == between


def test_where_a_neighbour_is_missing_everything_is_possible_between():
    rows = [[{"a": quantity(1.0)}], [{}], [{"a": quantity(3.0)}], [{"a": quantity(4.0)}]]
    swept = make_swept({THICKNESS: ["1 mm", "2 mm", "3 mm", "4 mm"]}, rows, "a < 2000 N")
    assert [each.state for each in swept.judge()] == [
        "certain", "not computed", "certain", "certain", "possible", "possible", "possible"
    ]  # fmt: skip


def test_a_sweep_is_told_in_numbers_and_words():
    rows = [[{"a": quantity(value, 0.5, 0.5)}] for value in (1.0, 2.0, 3.0)] + [[{}], [{}]]
    words = ["", "", "", "too soft", "too soft"]
    swept = make_swept({THICKNESS: [f"{k} mm" for k in range(1, 6)]}, rows, "a > 2 N", words=words)
    lines = list(swept.explain())
    assert lines[:2] == ["5 designs, 3 measured in full, in 7.5 s of processor time.", "2 x: too soft."]
    assert lines[2] == "Wish, designs: 1 excluded, 1 possible, 1 certain, 2 not computed."
    assert lines[3].startswith("Wish, places half-way between designs: ")
    found = swept.as_json()
    assert found["lost"] == 0
    assert found["units"] == {"a": "N"}
    assert found["designs"][1] == {
        "values": {THICKNESS: "2 mm"}, "words": "", "quantities": {"a": {"value": 2.0, "low": 1.5, "high": 2.5}},
    }  # fmt: skip
    assert [each["state"] for each in found["wish"]][:4] == ["excluded", "possible", "certain", "not computed"]
    silent = make_swept({THICKNESS: ["1 mm"]}, rows[:1])
    assert (len(list(silent.explain())), silent.as_json()["wish"]) == (1, [])


def test_a_cube_of_two_axes_has_values_ends_and_coordinates():
    pytest.importorskip("xarray")
    rows = [[{"a": quantity(float(k), 0.25, 0.5)}] for k in range(6)]
    swept = make_swept({THICKNESS: ["1 mm", "0.2 cm", "3 mm"], "cover.layer[0].name": ["soft", "hard"]}, rows)
    cube = swept.make_cube()
    assert cube.a.dims == (THICKNESS, "cover.layer[0].name")
    np.testing.assert_array_equal(cube.a, [[0, 1], [2, 3], [4, 5]])
    np.testing.assert_array_equal(cube.a_low - cube.a, np.full((3, 2), -0.25))
    np.testing.assert_array_equal(cube.a_high - cube.a, np.full((3, 2), 0.5))
    np.testing.assert_allclose(cube[THICKNESS], [1, 2, 3])
    assert (cube[THICKNESS].units, cube.a.units, cube["cover.layer[0].name"].units) == ("mm", "N", "")
    assert cube["cover.layer[0].name"].values.tolist() == ["soft", "hard"]
    assert json.loads(cube.attrs["sweep"])["sensor"] == "wts-0614-34"
    drawn = make_swept({THICKNESS: ["1 mm", "2 mm"]}, rows[:2], draw="random", count=2)
    assert drawn.shape == (2,)
    assert drawn.make_cube()[THICKNESS].dims == ("design",)


@pytest.mark.parametrize(
    ("values", "numbers", "unit"),
    [
        (["1 mm", "2 cm", "3e-3 m"], [1, 20, 3], "mm"), ([1, 2.5], [1, 2.5], ""), (["4", "5"], [4, 5], ""),
        (["1 mm", "2 N"], None, None), (["soft"], None, None), ([True, False], None, None), (["1 mm", 2], None, None),
        ([[1, 2]], None, None), (["0 mm", "1 mm"], [0, 1], "mm"),
    ],
)  # fmt: skip
def test_values_of_one_kind_are_numbers_in_the_unit_of_the_first(values, numbers, unit):
    found = find_numbers(values)
    if numbers is None:
        assert found is None
        return
    assert found[0] == pytest.approx(numbers)
    assert found[1] == unit


@pytest.mark.parametrize(
    ("key", "value", "take"),
    [
        (THICKNESS, "3.5 mm", lambda sensor: sensor.cover.layers[0].thickness * 1e3 - 3.5),
        ("electronics.rat", "123 Hz", None), ("array.pitch", "4 mm", lambda sensor: sensor.array.pitch[1] * 1e3 - 4),
        ("electronics.bits", 13, lambda sensor: sensor.electronics.bits - 13),
    ],
)  # fmt: skip
def test_a_design_is_the_sensor_with_the_key_changed(tmp_path, key, value, take):
    tables = make_tables({key: [value], "cover.layer[0].thickness" if key != THICKNESS else PITCH: ["3 mm"]})
    if take is None:
        with pytest.raises(InputError, match=r"every design is refused, the first by: .*electronics.rat"):
            list_designs(tables, tmp_path)
        return
    (design,) = list_designs(tables, tmp_path)
    assert take(design.sensor) == pytest.approx(0, abs=1e-9)
    assert design.refusal == ""


@pytest.mark.parametrize("key", ["cover.layer[3].thickness", "array.pitch.x", "cover.layer.thickness"])
def test_a_key_that_leads_nowhere_is_refused_by_its_name(tmp_path, key):
    with pytest.raises(InputError, match="has no such table or list") as refused:
        list_designs(make_tables({key: ["1 mm"]}), tmp_path)
    assert key in str(refused.value)


@pytest.mark.parametrize(("draw", "count", "seed"), [("random", 5, 3), ("sobol", 5, 3), ("sobol", 8, 1)])
def test_drawn_designs_take_shares_of_their_axes(tmp_path, draw, count, seed):
    axes = {THICKNESS: "1 mm : 3 mm", "electronics.bits": [12, 13, 14, 16]}
    designs = list_designs(make_tables(axes, draw=draw, count=count, seed=seed), tmp_path)
    if draw == "random":
        shares = np.random.default_rng(seed).random((count, 2))
    else:
        from scipy.stats import qmc

        shares = qmc.Sobol(2, rng=seed).random(8)[:count]
    assert len(designs) == count
    for design, (first, second) in zip(designs, shares, strict=True):
        assert float(design.values[THICKNESS].split()[0]) == pytest.approx(1 + 2 * first, rel=1e-9)
        assert design.values["electronics.bits"] == [12, 13, 14, 16][int(4 * second)]


def test_a_refused_design_says_why_beside_one_that_is_not(tmp_path):
    tables = make_tables({THICKNESS: ["1 mm", "-1 mm"]})
    good, bad = list_designs(tables, tmp_path)
    assert (good.refusal, bad.sensor) == ("", None)
    assert "must be positive" in bad.refusal
