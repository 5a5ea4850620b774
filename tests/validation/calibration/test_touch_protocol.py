"""The protocol, table, path and picture of planned touches, and what reaches the plan, on a made-up plan."""

import csv
import dataclasses
import re
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from meshes import TexelArray
from validation.calibration import touch_protocol
from validation.calibration.next_touches import Expected, NextTouches, Touch
from validation.calibration.touch_protocol import next_touches
from validation.errors import InputError
from validation.sensor_file import load

ARRAY = TexelArray.grid(2, 3, (4e-3, 5e-3), texel_size=(3e-3, 4.5e-3), active=np.array([1, 1, 1, 1, 1, 0], dtype=bool))
WTS = load("wts-0614-34")
PLACES = ((1.234e-3, -0.5e-3, 2e-3), (-4e-3, 2.5e-3, 2e-3), (1.234e-3, -0.5e-3, 2e-3))


@pytest.fixture
def plan(monkeypatch):
    """Replaces the choice of touches by a made-up one, and keeps what it is given."""
    given = SimpleNamespace(calls=[])
    touches = tuple(
        Touch(texel=texel, at=at, load=force)
        for texel, at, force in zip((1, 3, 1), PLACES, (1.5, 4.5, 2.5), strict=True)
    )
    expected = (
        Expected(name="gains", before=0.2, after=0.0123, unit="-", known=False, identified=True),
        Expected(name="thickness", before=0.5, after=0.4, unit="-", known=False, identified=False),
        Expected(name="poisson", before=0.05, after=0.01, unit="-", known=True, identified=True),
        Expected(name="shift", before=3e-4, after=1.2345e-5, unit="m", known=True, identified=True),
    )

    def choose(*arguments, **options):
        given.calls.append((arguments, options))
        return NextTouches(sensor="my pad", radius=1.25e-3, noise=4e-3, noise_assumed=False, earlier=2, touches=touches,
                           expected=expected)  # fmt: skip

    monkeypatch.setattr(touch_protocol, "plan_touches", choose)
    given.sensor = dataclasses.replace(WTS, array=ARRAY)
    return given


def test_the_plan_gets_what_was_asked_for_in_si_units(plan):
    next_touches(plan.sensor, 3)
    ((sensor, count), options), *_ = plan.calls
    assert (sensor, count) == (plan.sensor, 3)
    errors = options.pop("errors")
    assert (errors.place, errors.shift, errors.force) == pytest.approx((0.1e-3, 0.3e-3, 0.01))
    assert options == {"load": pytest.approx(1.0), "radius": pytest.approx(1e-3), "noise": None,
                       "wanted": ("gains", "thickness"), "earlier": None, "progress": None}  # fmt: skip
    touches, told = np.array([[0, 0, 2.0, np.nan], [1e-3, 0, 1.0, 0.5e-3]]), []
    next_touches(
        plan.sensor, 2, load="200 g", radius="0 mm", noise="3 mN", place_error="20 um", shift_error="0 mm",
        force_error=0.05, want=("poisson",), after=SimpleNamespace(touches=touches), progress=told.append,
    )  # fmt: skip
    options = plan.calls[1][1]
    errors = options.pop("errors")
    assert (errors.place, errors.shift, errors.force) == pytest.approx((20e-6, 0.0, 0.05))
    earlier = options.pop("earlier")
    np.testing.assert_allclose(earlier, [[0, 0, 2, 0], [1e-3, 0, 1, 0.5e-3]])  # an unknown radius is that of the tool
    assert options == {"load": pytest.approx(1.96133), "radius": 0.0, "noise": pytest.approx(3e-3),
                       "wanted": ("poisson",), "progress": told.append}  # fmt: skip


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"count": 0}, "--next: must lie in 1..500 for 6 texels, not 0"), ({"count": 501}, "not 501"),
        ({"force_error": 1.0}, "--force-error: must lie in 0..1"), ({"force_error": -0.01}, "--force-error"),
        ({"load": "10.1 kN"}, "--load: must be at most 10000 N"), ({"load": "0 N"}, "--load: must be positive"),
        ({"radius": "81 mm"}, "--radius: must be at most 0.08 m"),
        ({"radius": "-1 mm"}, "--radius: must not be negative"),
        ({"noise": "0 N"}, "--noise: must be positive"),
        ({"place_error": "81 mm"}, "--place-error: must be at most 0.08 m"),
        ({"shift_error": "-1 mm"}, "--shift-error: must not be negative"), ({"want": ()}, "--want: name gains"),
    ],
)  # fmt: skip
def test_what_lies_outside_its_range_is_refused_by_its_option(plan, options, said):
    with pytest.raises(InputError) as caught:
        next_touches(plan.sensor, **{"count": 3} | options)
    assert said in str(caught.value)
    assert not plan.calls


@pytest.mark.parametrize(
    "options", [{"count": 1}, {"count": 500}, {"force_error": 0.0}, {"load": "10 kN"}, {"radius": "80 mm"}]
)
def test_the_ends_of_the_ranges_are_accepted(plan, options):
    next_touches(plan.sensor, **{"count": 3} | options)
    assert len(plan.calls) == 1


def test_a_large_array_has_fewer_planned_touches(plan):
    with pytest.raises(InputError, match=r"1\.\.476 for 84 texels"):
        next_touches(WTS, 477)
    next_touches(WTS, 476)


@pytest.fixture
def folder(plan, tmp_path, monkeypatch):
    drawn = []

    def save(figure, target, **_options):
        drawn.append(figure)
        target.write(b"picture")

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", save)
    next_touches(plan.sensor, 3, out=tmp_path / "plan")
    return tmp_path / "plan", drawn


def test_the_table_and_the_protocol_list_each_touch_in_its_order(folder):
    where, _ = folder
    rows = list(csv.reader((where / "touches.csv").open()))
    assert rows == [
        ["touch", "texel", "x [mm]", "y [mm]", "z [mm]", "load [N]"], ["1", "1", "1.234", "-0.500", "2.000", "1.5"],
        ["2", "3", "-4.000", "2.500", "2.000", "4.5"], ["3", "1", "1.234", "-0.500", "2.000", "2.5"],
    ]  # fmt: skip
    text = (where / "protocol.md").read_text()
    assert text.startswith("# Touches of my pad\n")
    assert "a circle of 1.25 mm radius" in text
    lines = re.findall(r"^\| \[ \].*$", text, re.MULTILINE)
    listed = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    assert [row[1:] for row in listed] == rows[1:]
    assert {row[0] for row in listed} == {"[ ]"}
    assert re.findall(r"^- (.*)$", text, re.MULTILINE) == [
        "gains: +-20.0 %, then +-1.23 %", "thickness: +-50.0 %, then +-40.0 %", "poisson: +-0.0500, then +-0.0100",
        "shift: +-300 um, then +-12.3 um",
    ]  # fmt: skip
    for words in ("3 touches with a loaded circle of 1.25 mm radius, after 2 earlier ones", "noise of 4 mN",
                  "bounded by the prior alone: thickness.", "from the earlier touches: gains.",
                  "the first is at 1.23, -0.5 mm"):  # fmt: skip
        assert words in text, words


def test_the_path_goes_over_each_place_from_one_side_and_waits_there(folder):
    """A machine that follows the path in absolute millimetres."""
    where, _ = folder
    place, waits, codes = {"X": 0.0, "Y": 0.0, "Z": 0.0}, [], []
    steps = []
    for line in (where / "touches.gcode").read_text().splitlines():
        words, _, note = line.partition(";")
        code, *moves = words.split() or [""]
        codes.append(code)
        before = dict(place)
        place |= {each[0]: float(each[1:]) for each in moves if each[0] in place}
        if code == "G1":
            steps.append([place[axis] - before[axis] for axis in "XYZ"])
        if code == "M0":
            waits.append((place["X"], place["Y"], place["Z"], note.strip()))
    expected = [(1e3 * x, 1e3 * y, 5.0) for x, y, _ in PLACES]
    np.testing.assert_allclose([each[:3] for each in waits], expected, atol=6e-4)
    assert [each[3] for each in waits] == ["touch 1: 1.5 N", "touch 2: 4.5 N", "touch 3: 2.5 N"]
    np.testing.assert_allclose(steps, [[1, 1, 0]] * 3, atol=2e-3)
    assert [code for code in codes if code][:3] == ["G21", "G90", "G0"]  # millimetres, absolute, up
    assert codes[-1] == "M2"


def test_the_picture_has_the_texels_and_the_numbers_of_the_touches_at_their_places(folder):
    _, (figure,) = folder
    (axes,) = figure.axes
    squares = [patch.get_xy() for patch in axes.patches]
    assert len(squares) == 5
    for corners, centre in zip(squares, ARRAY.centres[ARRAY.active], strict=True):
        np.testing.assert_allclose(corners[:4].mean(axis=0), 1e3 * centre[:2], atol=1e-9)
        np.testing.assert_allclose(np.ptp(corners, axis=0), (3.0, 4.5), atol=1e-9)
    (marks,) = axes.lines
    np.testing.assert_allclose(marks.get_xydata(), 1e3 * np.array(PLACES)[:, :2])
    assert (marks.get_marker(), marks.get_linestyle()) == ("o", "None")
    labels = {text.get_text(): text.xy for text in axes.texts}
    assert labels.keys() == {"1,3", "2"}
    assert labels["1,3"] == pytest.approx((1.234, -0.5))
    assert labels["2"] == pytest.approx((-4.0, 2.5))
    assert all(max(map(abs, text.xyann)) < 5 and text.anncoords == "offset points" for text in axes.texts)
    assert (axes.get_aspect(), axes.get_xlabel(), axes.get_ylabel()) == (1.0, "x [mm]", "y [mm]")
    assert axes.get_title() == "my pad: touches in their order"
    assert figure.get_size_inches().tolist() == [3.5, 3.5]
