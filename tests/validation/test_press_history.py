"""Histories of a press on a relaxing cover: what is read, refused, printed and written."""

from __future__ import annotations

import contextlib
import json
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

import validation.press_history
from fem_reference.indentation.relaxing import Followed
from meshes import Cover, Pose, TexelArray
from meshes.relaxation import Relaxation
from tests.support.rubber import stack_layers
from validation import press_in_time
from validation.campaign.case import Case
from validation.errors import InputError
from validation.moving.history import History
from validation.press_history import HistoryPress, read_history, read_hold

RUBBER = """
[array]
rows = 6
columns = 14
pitch = "3.4 mm"

[[cover.layer]]
thickness = "2 mm"
material = {{ model = "linear-elastic", youngs_modulus = "1 MPa", poisson_ratio = 0.49{more} }}
"""
RELAXES = ', relaxation = { g = [0.3, 0.2], tau = ["0.1 s", "10 s"] }'


FACE = ("--indenter", "cylinder:radius=5mm")


@pytest.fixture
def press(softcover, tmp_path):
    """Press a face on a cover of rubber: (exit status, standard output, standard error)."""

    def run(*arguments, more=RELAXES):
        (tmp_path / "rubber.toml").write_text(RUBBER.format(more=more))
        return softcover("press", "rubber.toml", *FACE, *arguments)

    return run


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("time_s,load_N\n0,0\n2,1\n1,2\n", "line 4: time 1 s comes before 2 s"),
        ("time_s,load_N\n0,0\n,1\n", "line 3: not a number"),
        ("time_s,load_N\n0,0\nnan,1\n", "line 3: all numbers must be finite"),
        ("time,load\n0,0\n0,1\n1,1\n", r"time\[1\]: 0 s must come at least 0.001 ms after 0 s"),
        ("time_s,load_N\n-1,0\n2,1\n", "begins at -1 s"),
        ("time_s,load_N\n0,1\n2,-1\n", "an indenter cannot pull"),
        ("time_s,load_N\n0,1\n2,1e7\n", r"load\[1\]: 1e\+07; let it be 0..1e\+06 N"),
        ("time_s,load_N\n0,1\n1,0\n2,1\n", "lifts off at 1 s; end it there"),
        ("time_s,load_N\n0,0\n1,0\n", "nothing presses"),
        ("time_s,load_N\n0,1\n", "1 instants; 2..1000"),
        ("time,load,x,y\n0,1,0,0\n1,1,0,0.001\n", "slides are not computed"),
        ("time_s,load_N,x_m\n0,1,0\n", "columns time, load_n, x_m.*expected `time`.* `load`, or `depth`"),
        ("time_s,depth_m\n0,nan\n1,1e-4\n", "line 2: all numbers must be finite"),
        ("", "empty; expected"),
    ],
)
def test_faults_of_histories_are_one_line_each(tmp_path, text, fault):
    path = tmp_path / "history.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=fault) as caught:
        read_history(path)
    assert len(caught.value.faults) == 1
    assert caught.value.faults[0].startswith(f"--history: {path}")


def test_a_history_is_read_and_a_hold_is_a_step(tmp_path):
    path = tmp_path / "history.csv"
    path.write_text("time_ms;depth\n0;0\n500;1e-4\n2000;1e-4\n")
    found = read_history(path)
    assert found == History(control="depth", times=(0.0, 0.5, 2.0), values=(0.0, 1e-4, 1e-4))
    assert found.fastest == pytest.approx(0.35 / 0.5)
    assert read_hold("1 min", "load", 5.0) == History(control="load", times=(0.0, 60.0), values=(5.0, 5.0))
    with pytest.raises(InputError, match=r"--hold: time\[1\]: -3 s must come"):
        read_hold("-3s", "load", 5.0)
    with pytest.raises(InputError, match=r"^--hold: '60' has no unit; write for example '60s'$"):
        read_hold("60", "load", 5.0)


@pytest.mark.parametrize(
    ("more", "arguments", "fault"),
    [
        ("", ("--load", "2N", "--hold", "9s"), "--hold: every layer needs a relaxation"),
        (RELAXES, ("--hold", "9s"), "--load, --depth: give one of them"),
        (RELAXES, ("--load", "2N", "--history", "h.csv"), "leave out --load, --depth and --hold"),
        (RELAXES, ("--history", "missing.csv"), "--history: missing.csv: no such file"),
        (RELAXES, ("--load", "2N", "--hold", "9s", "--friction", "0.4"), "--friction: histories have no friction"),
        (RELAXES, ("--load", "2N", "--hold", "9s", "--accuracy", "1%"), "leave out --accuracy"),
        (RELAXES, ("--load", "2N", "--hold", "9s", "--strain", "finite"), "leave out --strain finite"),
        (RELAXES, ("--load", "2N", "--hold", "9s", "--model", "fast"), "leave out --model fast"),
        (RELAXES, ("--load", "2N", "--hold", "9s", "--method", "boxes"), "leave out --method"),
        (RELAXES, ("--depth", "3mm", "--hold", "9s"), "--hold: at a depth of 3 mm the indenter would pierce the cover"),
        (RELAXES.replace("[0.3, 0.2]", "0").replace('["0.1 s", "10 s"]', '"1 s"'), ("--load", "2N"), "terms, not 0"),
        (RELAXES.replace("0.3", "0.9"), ("--load", "2N"), "sum to at most one, not to 1.1"),
        (RELAXES.replace("0.1 s", "-0.1 s"), ("--load", "2N"), "must be positive"),
        (RELAXES.replace("linear", "x"), ("--history", "missing.csv"), "missing.csv"),
    ],
)
def test_faults_of_a_press_in_time_are_one_line_each(press, more, arguments, fault):
    status, out, err = press(*arguments, more=more)
    assert (status, out) == (2, "")
    assert fault in err
    assert len(err.splitlines()) == 1


@pytest.mark.slow
def test_a_held_face_prints_and_writes_what_its_material_does(press, tmp_path):
    arguments, out = ("--depth", "10um", "--hold", "60s"), tmp_path / "out"
    status, printed, _ = press(*arguments, "--out", "out", "--json")
    found = json.loads(printed)
    assert status == 0
    assert found == json.loads((out / "history.json").read_text())
    rows, forces = found["history"], np.array(found["texel_forces"])
    fall = rows[-1]["load_N"] / rows[0]["load_N"]
    assert fall == pytest.approx(0.5 + 0.2 * np.exp(-6), rel=1e-3)
    assert rows[-1]["elastic_load_ratio"] == pytest.approx(1 / fall)
    assert forces[-1].sum() + rows[-1]["outside_N"] == pytest.approx(rows[-1]["load_N"], rel=1e-3)
    assert found["resonance_Hz"] == pytest.approx(np.sqrt(1e6 / 2.98 / 1100) / 8e-3)
    assert len((out / "texels.csv").read_text().splitlines()) == len(rows) + 1
    assert (out / "history.png").stat().st_size > 10_000
    status, printed, _ = press(*arguments)
    assert status == 0
    assert "First shear resonance 2183 Hz" in printed
    assert "its force is up to 2 times that of this cover" in " ".join(printed.split())


@pytest.mark.slow
def test_depths_beyond_small_strain_are_told_and_piercing_names_the_history(press, tmp_path):
    (tmp_path / "h.csv").write_text("time,load\n0,0\n1,5000\n60,5000\n")
    for place, options in {"--hold": "--load 5kN --hold 60s", "--history: h.csv": "--history h.csv"}.items():
        status, _, err = press(*options.split())
        assert status == 2
        assert f"{place}: 5000 N within 60 s would pierce the cover" in err.splitlines()[-1]
        most = err.split("at most ")[1].split(" N")[0]
    status, printed, err = press("--load", f"{most}N", "--hold", "60s", "--json")
    found = json.loads(printed)
    share = found["history"][-1]["depth_m"] / 2e-3
    assert status == 0
    assert 0.9 < share < 1
    assert found["warnings"] == [f"indented to {share:.0%} of the thickness: more than small strain is meant for"]
    assert f"warning: {found['warnings'][0]}" in err


@pytest.mark.slow
def test_a_cover_of_constant_bulk_modulus_bears_what_its_relaxed_modulus_does(press):
    """Relaxing alone would go through; the volume keeps the face up."""
    status, printed, _ = press("--load", "155N", "--hold", "60s", "--json", more=RELAXES[:-1] + ', bulk = "constant" }')
    rows = json.loads(printed)["history"]
    assert status == 0
    assert rows[0]["depth_m"] < rows[-1]["depth_m"] < 2e-3


def test_the_resonance_is_that_of_the_modulus_at_the_last_change():
    """A tap that ends at 1 s before a hold."""
    assert History(control="load", times=(0.0, 0.5, 1.0, 9.0), values=(0.0, 4.0, 1.0, 1.0)).last_change == 1.0
    assert History(control="load", times=(0.0, 9.0), values=(4.0, 4.0)).last_change == 0.0


@pytest.mark.slow
def test_fast_histories_and_ignored_relaxation_are_told(press, tmp_path):
    (tmp_path / "history.csv").write_text("time_s,load_N\n0,0\n0.001,1\n2,1\n")
    status, _, err = press("--history", "history.csv")
    assert status == 0
    assert "change at up to 350 Hz, above a tenth of the cover's first shear resonance" in err
    assert "results hold just after loading" not in err
    assert "results hold just after loading" in press("--load", "1N", "--model", "fem")[2]


def make_press(history, **relaxation):
    """A made-up press: three instants on one row of two texels, on 3 mm of 0.5 MPa below 1 mm of 2 MPa."""
    relaxes = Relaxation(g=(0.36,), tau=(2.0,), **relaxation)
    layers = stack_layers((3e-3, 0.5e6, 0.0), (1e-3, 2e6, 0.0)).layers
    cover = Cover(layers=tuple(replace(e, material=replace(e.material, relaxation=relaxes)) for e in layers))
    followed = Followed(
        times=np.array([0.0, 1.0, 4.0]), forces=np.array([0.0, 2.0, 1.0]), depths=np.array([0.0, 1e-4, 2e-4]),
        contact_depths=np.array([0.0, 1e-4, 3e-4]), texel_forces=np.array([[0.0, 0.0], [1.2, 0.6], [0.3, 0.2]]),
        outside=np.array([0.0, 0.2, 0.5]), fast=np.array([[0.0, 0.0, 0.0], [1.5, 0.75, 0.25], [1.6, 1.2, 1.2]]),
        error_estimate={"presses": 0.02}, warnings=("too deep",),
    )  # fmt: skip
    case = Case.read("press", "sphere:radius=5mm", "2 N", at="1mm,2mm")
    array = TexelArray.grid(1, 2, 3e-3)
    return HistoryPress(case=case, array=array, cover=cover, relaxation=relaxes, history=history, followed=followed)


RAMP = History(control="depth", times=(0.0, 1.0, 4.0), values=(0.0, 1e-4, 2e-4))


def test_rows_of_a_press_in_time_hold_what_was_followed_and_what_an_elastic_cover_would_do():
    """At 4 s the texels bear 0.3 and 0.2 of a unit and 0.5 lies outside; the elastic cover has 0.4, 0.3 and 0.3."""
    found = make_press(RAMP)
    first, second, last = found.rows()
    assert (first["elastic_load_ratio"], first["elastic_misplaced"]) == (1.0, 0.0)
    assert second == {
        "time_s": 1.0, "load_N": 2.0, "depth_m": 1e-4, "contact_depth_m": 1e-4, "peak_texel_N": 1.2, "outside_N": 0.2,
        "elastic_load_ratio": 1.25, "elastic_misplaced": 0.0,
    }  # fmt: skip
    assert (last["contact_depth_m"], last["elastic_load_ratio"]) == (3e-4, 4.0)
    assert last["elastic_misplaced"] == pytest.approx(0.5 * (0.1 + 0.1 + 0.2))
    assert found.pick_rows() == [first, second, last]


@pytest.mark.parametrize(
    ("control", "bulk", "said"),
    [
        (
            "depth",
            "relaxing",
            ("bulk modulus relaxes with", "up to 20 % of the force", "is up to 4 times that"),
        ),
        ("load", "constant", ("bulk modulus is constant (approximate", "wrong texels")),
    ],
)
def test_notes_state_the_bulk_modulus_and_the_error_of_the_fast_model(control, bulk, said):
    notes = make_press(replace(RAMP, control=control), bulk=bulk).notes
    assert all(any(each in note for note in notes) for each in said)
    assert len(notes) == 3
    assert notes[-1].endswith("wrong texels") is (control == "load")


def test_the_resonance_follows_the_modulus_and_a_step_is_a_rise():
    """4/13 MPa in shear over 4 mm; after the last change at 2 s the modulus is 1 - 0.36 (1 - 1/e)."""
    whole, relaxed = (4e6 / 13 / 1100) ** 0.5 / 16e-3, 1 - 0.36 * (1 - np.exp(-1))
    found = make_press(History(control="load", times=(0.0, 2.0, 4.0), values=(2.0, 1.0, 1.0)))
    assert found.resonance == pytest.approx(whole * relaxed**0.5)
    assert f"first shear resonance {found.resonance:.4g} Hz at the last change" in found.notes[1]
    assert f"a rise that takes {3.5e3 / found.resonance:.2g} ms or more" in found.notes[2]
    assert found.warnings == ("too deep",)
    tap = History(control="load", times=(0.0, 1e-3, 4.0), values=(0.0, 1.0, 1.0))
    assert "at up to 350 Hz" in make_press(tap).warnings[1]


def test_a_history_of_many_instants_is_printed_at_about_ten_and_written_at_all(tmp_path):
    """The given instants where they are few, and ten that are spread over the rows."""
    found, k = make_press(replace(RAMP, times=(0.0, 1.0, 39.0))), np.arange(40.0)
    long = replace(
        found.followed, times=k, forces=k + 1, depths=k, contact_depths=k, outside=k, texel_forces=np.ones((40, 2)),
        fast=np.ones((40, 3)),
    )  # fmt: skip
    found = replace(found, followed=long)
    assert [row["time_s"] for row in found.pick_rows()] == [0, 1, 4, 8, 13, 17, 21, 26, 30, 34, 39]
    files = found.write(tmp_path)
    lines = (tmp_path / "texels.csv").read_text().splitlines()
    assert files[:3] == ("history.json", "history.csv", "texels.csv")
    assert (lines[0], lines[-1]) == ("time_s,texel_0_N,texel_1_N", "39.0,1.0,1.0")
    assert len((tmp_path / "history.csv").read_text().splitlines()) == 41
    written = json.loads((tmp_path / "history.json").read_text())
    assert written["relaxation"] == {"tau": [2.0], "g": [0.36], "exponent": None, "bulk": "relaxing"}
    assert (written["control"], written["indenter"], len(written["history"])) == ("depth", "sphere:radius=5mm", 40)


def test_the_picture_shows_loads_and_depths_and_texels_at_half_and_at_full_load_and_at_the_end(tmp_path, monkeypatch):
    """Load of the cover and of an elastic one, depth in mm; images below them at 1, 2 and 4 s."""
    figure = Figure(layout="constrained")
    monkeypatch.setattr(validation.press_history, "open_figure", lambda *_, **__: contextlib.nullcontext(figure))
    found = make_press(RAMP)
    followed = {
        name: np.insert(getattr(found.followed, name), 1, 0.6 * getattr(found.followed, name)[1], axis=0)
        for name in ("times", "forces", "depths", "contact_depths", "texel_forces", "outside", "fast")
    }
    followed["times"] = np.array([0.0, 1.0, 2.0, 4.0])
    replace(found, followed=replace(found.followed, **followed)).write(tmp_path)
    above, *texels, other = figure.axes[0], *figure.axes[2:], figure.axes[1]
    lines = {line.get_label(): line.get_ydata().tolist() for line in (*above.lines, *other.lines)}
    assert lines["load"] == pytest.approx([0.0, 1.2, 2.0, 1.0])
    assert lines["load, elastic cover"] == pytest.approx([0.0, 1.5, 2.5, 4.0])
    assert lines["depth"] == pytest.approx([0.0, 0.06, 0.1, 0.2])
    assert (above.get_ylim(), other.get_ylim()) == ((0, pytest.approx(4.4)), (0, pytest.approx(0.24)))
    assert [text.get_text() for text in above.get_legend().get_texts()] == list(lines)
    assert [each.get_title() for each in texels] == [f"texels at {t} s" for t in (1, 2, 4)]
    assert [each.images[0].get_array().ravel().tolist() for each in texels[1:]] == [[1200, 600], [300, 200]]
    grids = [each.get_subplotspec().get_gridspec().get_geometry() for each in texels]
    assert grids == [(2, 3)] * 3
    assert [each.get_subplotspec().rowspan.start for each in texels] == [1, 1, 1]


@pytest.mark.parametrize(
    ("history", "fault"),
    [
        (History(times=(0.0, 1.0, 2.0), values=(1.0, 0.0, 1.0)), "--history: lifts off at 1 s; end it there"),
        (History(times=(0.0, 1.0, 2.0), values=(0.0, 1.0, 0.0), repeat=2), "--history: slides and repetitions are not"),
        (History(times=(0.0, 1.0), values=(1.0, 1.0), poses=(Pose(), Pose(point=(1e-3, 0, 0)))), "slides and repet"),
    ],
)
def test_histories_of_more_than_one_touch_are_refused(history, fault):
    with pytest.raises(InputError, match=fault):
        read_history(history)
    assert read_history(RAMP) is RAMP


def test_a_press_in_time_takes_either_a_history_or_a_hold(tmp_path):
    (tmp_path / "rubber.toml").write_text(RUBBER.format(more=RELAXES))
    with pytest.raises(InputError, match="--history, --hold: give one of them"):
        press_in_time(tmp_path / "rubber.toml", "sphere:radius=5mm", load="1 N")
    with pytest.raises(InputError, match="leave out --load, --depth and --hold, which it replaces"):
        press_in_time(tmp_path / "rubber.toml", "sphere:radius=5mm", load="1 N", history=RAMP)
