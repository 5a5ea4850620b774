"""Designs, measurements, cube and wishes of sweeps in one process."""

from __future__ import annotations

import dataclasses
import json
import math
import re
import tomllib

import numpy as np
import pytest
import xarray

import validation
from fem_reference import result_store
from fem_reference.errors import ConvergenceError
from validation.cli import main
from validation.errors import InputError
from validation.sensor_file import BUILT_IN, load, parse
from validation.sensor_file.sensor import read_tables
from validation.sweeps import measurements, page
from validation.sweeps.cube import read_wish
from validation.sweeps.measurements import Quantity

pytestmark = pytest.mark.usefixtures("store")

THICKNESS, PITCH = "cover.layer[0].thickness", "array.pitch"


@pytest.fixture
def computed(monkeypatch):
    """Replaces `derive` by closed forms of thickness and pitch; the list of the sensors that it was called with."""
    called = []

    def measure(subject):
        h, p = 1e3 * subject.sensor.cover.thickness, 1e3 * subject.sensor.array.pitch[0]
        called.append((round(h, 9), round(p, 9)))
        if h > 6:
            raise ConvergenceError(f"no solution at {h:g} mm")
        bent, wave = h**2 / p, 10 + math.sin(h) * p
        return {
            "bent": Quantity(bent, 0.99 * bent, 1.01 * bent, "mm"),
            "wave": Quantity(wave, wave, wave, "N"),
            "end": Quantity(h, h, math.inf, "N"),
        }

    monkeypatch.setitem(measurements.COMMANDS, "derive", measure)
    monkeypatch.setitem(measurements.NAMES, "derive", lambda _: {"bent", "wave", "end"})
    return called


def write(folder, designs, *, measure="derive", more="", sensor="wts-0614-34"):
    text = f'sensor = "{sensor}"\nmeasure = {json.dumps(measure)}\n{more}\n[designs]\n'
    path = folder / "sweep.toml"
    path.write_text(text + "".join(f"{json.dumps(key)} = {json.dumps(each)}\n" for key, each in designs.items()))
    return path


def refuse(path, **options):
    with pytest.raises(InputError) as caught:
        validation.sweep(path, **options)
    assert len(caught.value.faults) == 1
    return caught.value.faults[0]


def test_the_tables_of_a_built_in_sensor_describe_it(tmp_path):
    for name, known in BUILT_IN.items():
        made = parse(read_tables(name), source=tmp_path / "made.toml")
        assert result_store.describe(made.array) == result_store.describe(known.array)
        assert made.electronics == known.electronics
        assert made.cover.assumed
        (layer,) = made.cover.layers
        assert layer.thickness == known.cover.thickness
        assert layer.material.youngs_modulus == pytest.approx(known.cover.layers[0].material.youngs_modulus)


@pytest.mark.slow
def test_limits_of_a_sweep_are_those_of_the_command(tmp_path):
    found = validation.sweep(write(tmp_path, {THICKNESS: ["1.5 mm"]}, measure=["limits", "limits --load 2N"]))
    for load_text, end in (("1 N", ""), ("2 N", "_2")):
        by_hand = validation.limits(load("wts-0614-34", thickness="1.5mm"), load=load_text)
        numbers = {each.name: each.value for each in by_hand.counted}
        for name, title, unit, factor in (
            ("force", "force", "mN", 1e3),
            ("place_x_force_known", "place x, force known", "um", 1e6),
        ):
            printed, ((value, low, high),) = found.quantities[name + end]
            assert (printed, value) == (unit, pytest.approx(factor * numbers[title], rel=1e-9))
            assert low < value < high


@pytest.mark.slow
def test_a_derivation_of_a_sweep_is_that_of_the_command(tmp_path):
    path = write(tmp_path, {THICKNESS: ["1.5 mm"]}, measure=["derive", "regress kernel"])
    found = validation.sweep(path)
    by_hand = validation.derive(load("wts-0614-34", thickness="1.5mm")).result
    assert found.words == [""]
    assert found.quantities["sigma_x"][1][0, 0] == pytest.approx(by_hand.psf.sigma_x, rel=1e-9)
    assert found.quantities["sigma_x_2"][1][0, 0] == pytest.approx(by_hand.psf.sigma_x, rel=1e-4)
    assert found.quantities["width_x"][1][0, 0] == pytest.approx(3.4 * by_hand.psf.sigma_x, rel=1e-9)
    load_5 = found.quantities["load_5_percent"][1][0]
    assert load_5[0] == pytest.approx(by_hand.load_5_percent, rel=1e-9)
    is_end = by_hand.load_5_percent == by_hand.validity["largest_load"]
    assert math.isinf(load_5[2]) == is_end


def test_a_grid_is_a_cube_with_units_errors_and_words(tmp_path, computed):
    path = write(tmp_path, {THICKNESS: "1 mm : 0.7 cm : 4", PITCH: ["3 mm", "4mm"], "cover.base": ["bonded"]})
    found = validation.sweep(path, out=tmp_path / "out")
    with xarray.open_dataset(tmp_path / "out" / "sweep.nc") as cube:
        np.testing.assert_allclose(cube[THICKNESS], [1, 3, 5, 7])
        assert cube[THICKNESS].units == "mm"
        assert cube["cover.base"].values.astype(str).tolist() == ["bonded"]
        np.testing.assert_allclose(cube.bent[:3, :, 0], np.divide.outer([1, 9, 25], [3, 4]))
        np.testing.assert_allclose(cube.bent_low[:3], 0.99 * cube.bent[:3])
        assert cube.bent.units == "mm"
        assert np.isnan(cube.bent[3]).all()
        words = cube.words.values.astype(str)[..., 0]
        assert (words[:3] == "").all()
        assert (words[3] == "derive: did not converge: no solution at 7 mm").all()
        assert "mujoco" in json.loads(cube.versions)
    assert "no solution at 7 mm" in (tmp_path / "out" / "index.html").read_text()
    assert len(computed) == 8
    assert found.as_json()["designs"][0]["quantities"]["end"]["value"] == 1


@pytest.mark.slow
def test_maps_of_two_parameters_are_drawn(tmp_path, computed, monkeypatch):
    monkeypatch.setattr(page, "_MAPS", 2)
    validation.sweep(write(tmp_path, {THICKNESS: "1 mm : 3 mm : 3", PITCH: "3 mm : 4 mm : 3"}), out=tmp_path / "two")
    validation.sweep(write(tmp_path, {THICKNESS: "1 mm : 3 mm : 3"}), out=tmp_path / "one")
    for folder in ("one", "two"):
        assert {path.name for path in (tmp_path / folder).glob("*.png")} == {"bent.png", "wave.png"}


def test_a_missing_table_of_designs_is_told_with_one_that_is_accepted(tmp_path, computed):
    (tmp_path / "none.toml").write_text('sensor = "wts-0614-34"\nmeasure = "derive"\n')
    with pytest.raises(InputError) as raised:
        validation.sweep(tmp_path / "none.toml")
    (fault,) = raised.value.faults
    example = fault.partition("write for example ")[2]
    assert tomllib.loads(example)["designs"] == {THICKNESS: "1 mm : 5 mm : 5"}


def test_drawn_designs_lie_in_their_ranges(tmp_path, computed):
    for draw in ("sobol", "random"):
        more = f'draw = "{draw}"\ncount = 20\nseed = 3'
        path = write(
            tmp_path, {THICKNESS: "1 mm : 5 mm", PITCH: ["3 mm", "4 mm"], "electronics.bits": "8 : 12 : 5"}, more=more
        )
        found = validation.sweep(path)
        values = [each.values for each in found.designs]
        heights = np.array([float(each[THICKNESS].removesuffix(" mm")) for each in values])
        assert len(set(heights)) == 20
        assert 1 <= heights.min() < 1.5
        assert 4.5 < heights.max() <= 5
        assert {each[PITCH] for each in values} == {"3 mm", "4 mm"}
        assert {each["electronics.bits"] for each in values} <= {8, 9, 10, 11, 12}
        assert found.make_cube().bent.dims == ("design",)
        assert values == [each.values for each in validation.sweep(path).designs]


def test_a_killed_sweep_goes_on_where_it_stopped(tmp_path, computed, monkeypatch):
    path = write(tmp_path, {THICKNESS: "1 mm : 5 mm : 5"})
    measure, failing = measurements.COMMANDS["derive"], True

    def fail(subject):
        if failing and len(computed) == 3:
            raise MemoryError
        return measure(subject)

    monkeypatch.setitem(measurements.COMMANDS, "derive", fail)
    with pytest.raises(MemoryError):
        validation.sweep(path)
    assert len(computed) == 3
    failing = False
    lines = []
    found = validation.sweep(path, announce=lines.append)
    assert lines[0] == "5 designs: 3 stored, 0 refused, 2 to compute"
    assert computed == [(h, 3.4) for h in (1, 2, 3, 4, 5)]
    np.testing.assert_allclose(found.quantities["end"][1][:, 0], [1, 2, 3, 4, 5])
    validation.sweep(path)
    assert len(computed) == 5


def test_a_plan_states_number_and_cost_and_computes_nothing(tmp_path, computed):
    path, lines = write(tmp_path, {THICKNESS: "1 mm : 5 mm : 5", PITCH: ["3 mm", "-3 mm"]}), []
    validation.sweep(path, only_plan=True, announce=lines.append)
    assert lines == ["10 designs: 0 stored, 5 refused, 5 to compute"]
    validation.sweep(write(tmp_path, {THICKNESS: ["2 mm"], PITCH: ["3 mm"]}))
    assert len(computed) == 1
    validation.sweep(
        write(tmp_path, {THICKNESS: "1 mm : 5 mm : 5", PITCH: ["3 mm"]}), only_plan=True, announce=lines.append
    )
    assert lines[1] == "5 designs: 1 stored, 0 refused, 4 to compute"
    assert lines[2].startswith("one design takes ")
    assert len(computed) == 1


def test_refused_designs_are_listed_with_their_words(tmp_path, computed):
    found = validation.sweep(write(tmp_path, {THICKNESS: ["1 mm", "-1 mm", "2 m"], PITCH: ["3 mm", "4 mm"]}))
    assert [bool(each) for each in found.words] == [False, False, True, True, True, True]
    assert "must be positive, not '-1 mm'" in found.words[2]
    assert len(computed) == 2


@pytest.mark.slow
def test_no_certain_design_fails_and_none_outside_possible_succeeds(tmp_path, computed):
    fine = validation.sweep(write(tmp_path, {THICKNESS: "1 mm : 5 mm : 17", PITCH: "3 mm : 5 mm : 9"}))
    truth = {tuple(each.values.values()): row for row, each in enumerate(fine.designs)}
    path, random = write(tmp_path, {THICKNESS: "1 mm : 5 mm : 9", PITCH: "3 mm : 5 mm : 5"}), np.random.default_rng(1)
    swept, seen = validation.sweep(path), set()
    for _ in range(50):
        signs = random.choice(["<", ">"], 2)
        wish = f"bent {signs[0]} {random.uniform(0.3, 6):.3f} mm, wave {signs[1]} {random.uniform(6, 14):.3f} N"
        for each in dataclasses.replace(swept, wish=read_wish(wish)).judge():
            row = truth[tuple(each.values.values())]
            bent, wave = (fine.quantities[name][1][row, 0] for name in ("bent", "wave"))
            meets = all(
                value > clause.limit if clause.sign > 0 else value < clause.limit
                for value, clause in zip((bent, wave), read_wish(wish), strict=True)
            )
            seen.add((each.state, each.between, meets))
    assert {("certain", True, True), ("certain", False, True), ("excluded", True, False)} <= seen
    assert {("possible", True, True), ("possible", True, False)} <= seen
    assert not seen & {
        ("certain", True, False),
        ("certain", False, False),
        ("excluded", True, True),
        ("excluded", False, True),
    }


def test_what_is_only_known_to_a_limit_is_possible_beyond_it(tmp_path, computed):
    path = write(tmp_path, {THICKNESS: ["1 mm", "4 mm", "7 mm"]})
    states = [each.state for each in validation.sweep(path, wish="end > 3000 mN").judge() if not each.between]
    assert states == ["possible", "certain", "not computed"]
    first = next(iter(validation.sweep(path, wish="end < 500 mN").judge()))
    assert (first.state, first.reason) == ("excluded", "end 1 (1 to inf) N, wished end < 500 mN")


@pytest.mark.parametrize(
    ("designs", "options", "words"),
    [
        ({THICKNESS: "1 : 5 : 9"}, {}, "has no unit"),
        ({THICKNESS: "1 mm : 5 N : 9"}, {}, "both ends need a unit of one kind"),
        ({THICKNESS: "1 mm : 5 mm"}, {}, "is a range; add a count"),
        ({THICKNESS: []}, {}, "a list holds 0 values; accepted: 1..100000"),
        ({THICKNESS: "1 mm : 5 mm : 1000", PITCH: "3 mm : 4 mm : 1000"}, {}, "1000000 designs; at most 100000"),
        ({"cover.layer[0].thicknes": "1 mm : 5 mm : 9"}, {}, "did you mean 'thickness'?"),
        ({"cover.layer[1].thickness": "1 mm : 5 mm : 9"}, {}, "no such table or list"),
        ({THICKNESS: ["1 mm"]}, {"wish": "wafe < 3"}, "did you mean 'wave'?"),
        ({THICKNESS: ["1 mm"]}, {"wish": "bent < 3 N"}, "bent has the unit mm"),
        ({THICKNESS: ["1 mm"]}, {"wish": "bent is small"}, "is no condition"),
        ({THICKNESS: ["1 mm"]}, {"cluster": "nowhere"}, "is no address and no file"),
        ({THICKNESS: ["1 mm"]}, {"cluster": "a:1", "workers": 2}, "give one of the two"),
    ],
)
def test_bad_input_is_refused_in_one_line(tmp_path, computed, designs, options, words):
    assert words in refuse(write(tmp_path, designs), **options)
    assert len(computed) <= 1


@pytest.mark.parametrize(
    ("measure", "words"),
    [
        ("deriv", "did you mean 'derive'?"),
        ("limits --nois 5mN", "did you mean '--noise'?"),
        ("limits --noise", "needs a value"),
        ("regress kernal", "did you mean 'kernel'?"),
        ("limits --prior betwen", "measure: limits --prior: unknown value 'betwen'; did you mean 'between'?"),
        ("limits --noise 5mm", "measure: limits: --noise: 'mm' in '5mm' is not a unit of force"),
        ("press --indenter shpere:radius=5mm --load 1N", "measure: press: --indenter: unknown indenter 'shpere'"),
        ("press --indenter sphere:radius=5mm", "measure: press: --load, --depth"),
    ],
)
def test_measurements_that_no_design_can_have_are_refused(tmp_path, measure, words):
    assert words in refuse(write(tmp_path, {THICKNESS: ["1 mm", "2 mm"]}, measure=["derive", measure]))


def test_a_wish_for_an_unknown_quantity_is_refused_before_anything_is_computed(tmp_path, computed):
    path = write(tmp_path, {THICKNESS: ["1 mm"]}, measure=["derive", "limits --two 5mm", "press --load 1N"])
    path.write_text(path.read_text().replace("press --load", "press --indenter sphere:radius=5mm --load"))
    assert "--wish: unknown quantity 'wafe'; did you mean 'wave'?" in refuse(path, wish="wafe < 3 N")
    assert "did you mean 'separation'?" in refuse(path, wish="seperation < 3 mm")
    assert computed == []


@pytest.mark.slow
@pytest.mark.parametrize(
    "measure",
    ["derive", "limits --noise 5mN --two 6mm --radius 1mm", "press --indenter sphere:radius=5mm --load 1N"],
)
def test_quantities_have_the_names_that_wishes_may_name(measure):
    made = measurements.read_measurement(measure)
    found = made.run(measurements.Subject(sensor=load("wts-0614-34")))
    assert {re.sub(r"_\d+$", "", name) for name in found} <= made.names
    if measure.startswith("limits"):
        assert set(found) == made.names


@pytest.mark.slow
def test_limits_of_a_sweep_take_a_prior(tmp_path):
    values = []
    for prior in ("around", "between"):
        measure = f"limits --noise 5mN --load 0.3N --prior {prior}"
        found = validation.sweep(write(tmp_path, {THICKNESS: ["1 mm"]}, measure=measure))
        values.append(found.quantities["place_x_force_known"][1][0, 0])
    assert values[0] > 2 * values[1]


def test_a_store_that_cannot_be_written_is_refused(tmp_path, computed, store, monkeypatch):
    store.write_text("a file")
    assert "SOFTCOVER_STORE" in refuse(write(tmp_path, {THICKNESS: ["1 mm"]}))
    assert computed == []


def test_a_full_disk_stops_the_sweep_in_one_line(tmp_path, computed, monkeypatch, capsys):
    def fill(*_):
        raise OSError(28, "No space left on device", str(tmp_path / "store"))

    monkeypatch.setattr(result_store, "write", fill)
    with pytest.raises(SystemExit) as ended:
        main(["sweep", str(write(tmp_path, {THICKNESS: ["1 mm"]})), "--out", str(tmp_path / "out")])
    assert ended.value.code == 3
    assert "No space left on device" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_command_prints_designs_and_the_wish(tmp_path, computed, capsys):
    path = write(tmp_path, {THICKNESS: "1 mm : 7 mm : 4"})
    with pytest.raises(SystemExit) as ended:
        main(["sweep", str(path), "--wish", "bent < 3 mm"])
    printed = capsys.readouterr().out
    assert ended.value.code == 0
    assert "1 x: derive: did not converge: no solution at 7 mm." in printed
    assert "Wish, designs: 2 certain, 1 excluded, 1 not computed." in printed
    with pytest.raises(SystemExit):
        main(["sweep", str(path), "--wish", "bent < 3 mm", "--json"])
    found = json.loads(capsys.readouterr().out)
    assert [each["state"] for each in found["wish"]][:2] == ["certain", "certain"]
    assert found["units"] == {"bent": "mm", "wave": "N", "end": "N"}
