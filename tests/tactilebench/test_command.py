"""The command of tactilebench: what it prints about cases and scores, its options, its files, and its exit status."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import tactilebench
from tactilebench import files
from tactilebench.__main__ import main, show
from tactilebench.draw import draw
from tactilebench.scoring import SCORES
from tests.tactilebench.test_case import make_case, slide


def test_every_case_is_listed_with_what_presses_on_what(capsys):
    assert main(["cases", "--seed", "5"]) == 0
    rows = capsys.readouterr().out.splitlines()
    known = draw("2026.1", 5)
    for case, row in zip(known, rows, strict=True):
        found = re.fullmatch(r"(\S+)  (.+), (\S+) N(?:, (\d+) instants)?; (.+); (\d+) texels", row)
        assert found[1] == case.name
        assert found[2].split(" and ") == [body.shape["shape"] for body in case.bodies]
        assert float(found[3]) == pytest.approx(case.load, rel=1e-3)
        assert found[4] == (str(len(case.loads)) if case.motion else None)
        assert int(found[6]) == len(case.centres)
        if case.cover.geometry:
            assert found[5] == case.cover.geometry
        else:
            layers, height = re.fullmatch(r"(\d) x flat, (\S+) mm", found[5]).groups()
            assert int(layers) == len(case.cover.layers)
            assert float(height) == pytest.approx(1e3 * sum(each.thickness for each in case.cover.layers), rel=5e-3)


def test_tiers_are_chosen_one_by_one(capsys):
    for words in (["cases"], ["template"]):
        assert main([*words, "--seed", "5", "--tier", "foil", "--tier", "moving"]) == 0
        found = capsys.readouterr().out
        assert set(re.findall(r"^[a-z_]+(?=-\d)", found, re.MULTILINE)) == {"foil", "moving"}
    known = [case for case in draw("2026.1", 5) if case.tier in {"foil", "moving"}]
    assert found.splitlines()[:2] == ["# tactilebench 2026.1", "case,instant,texel,force_n"]
    assert len(found.splitlines()) == 2 + sum(int(np.prod(case.shape)) for case in known)


@pytest.fixture
def few(tmp_path):
    """Two cases of two tiers, whose truth is in `truth.npz`."""
    small = {case.tier: case for case in tactilebench.cases() if len(case.centres) == 25}
    known = [small["foil"], small["layered"]]
    tactilebench.save_truth(tmp_path / "truth.npz", known, seed=None, made_by="nobody 1.0")
    return known


def test_a_table_states_the_means_of_each_tier_and_the_interval_and_floor_of_all(tmp_path, capsys, few):
    np.savez(tmp_path / "mine.npz", **{case.name: np.roll(case.truth.forces, 1) for case in few})
    words = ["score", str(tmp_path / "mine.npz"), "--truth", str(tmp_path / "truth.npz"), "--json"]
    assert main([*words, str(tmp_path / "scores.json")]) == 0
    rows = capsys.readouterr().out.splitlines()
    result = json.loads((tmp_path / "scores.json").read_text())
    assert rows[-1] == f"wrote {tmp_path / 'scores.json'}"
    assert re.split(r"  +", rows[0].strip()) == ["cases", *(heading for heading, _, _ in SCORES.values())]
    assert rows[1].split() == [unit for _, unit, _ in SCORES.values()]
    means = {**result["tiers"], "all": result["overall"]}
    expected = [[name, each["cases"], *(each[key]["value"] for key in SCORES)] for name, each in means.items()]
    expected += [[key, *(result["overall"][name][key] for name in SCORES)] for key in ("low", "high", "floor")]
    factors = {"%": 100, "mm": 1e3}
    assert all(factor == factors[unit] for _, unit, factor in SCORES.values())
    for row, (title, *numbers) in zip(rows[2:], expected, strict=False):
        first, *given = row.split()
        assert first == title
        count = [numbers.pop(0)] if len(numbers) > len(SCORES) else []
        scaled = [each * factors[unit] for each, (_, unit, _) in zip(numbers, SCORES.values(), strict=True)]
        assert list(map(float, given)) == pytest.approx(count + scaled, rel=6e-3)
    assert len({len(row) for row in rows[:7]}) == 1  # columns stand below one another


def test_what_is_not_defined_is_a_hyphen_in_the_table(tmp_path, capsys, few):
    np.savez(tmp_path / "mine.npz", **{case.name: np.zeros(case.shape) for case in few})
    assert main(["score", str(tmp_path / "mine.npz"), "--truth", str(tmp_path / "truth.npz")]) == 0
    assert capsys.readouterr().out.splitlines()[2].split()[5:8] == ["-", "-", "-"]


#: Words that the help of each command holds beside its options.
HELP = {
    (): ["against a truth", "list the cases", "only the forces are missing", "score a CSV or npz",
         "examples:\n  python", "Exit status: 0, or 2", "cases | template | score"],
    ("cases",): ["list the cases: name", "release of the cases", "only this tier", "fresh cases of this seed"],
    ("template",): ["print a CSV file", "release of the cases", "only this tier", "fresh cases of this seed"],
    ("score",): ["score a CSV or npz", "forces: CSV with case", "only this tier", "truth that softcover computed",
                 "write all scores"],
}  # fmt: skip


@pytest.mark.parametrize("words", HELP, ids=lambda words: " ".join(words) or "none")
def test_the_help_of_a_command_explains_it_and_each_of_its_options(capsys, words):
    with pytest.raises(SystemExit) as ended:
        main([*words, "--help"])
    found = capsys.readouterr().out
    assert ended.value.code == 0
    assert found.startswith(f"usage: python -m tactilebench {' '.join(words)}".strip())
    told = found if not words else " ".join(found.split())
    for each in HELP[words]:
        assert each in told
        assert told.index(each) > told.index("python -m tactilebench")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "cases | template | score"), (["show"], "invalid choice: 'show'"), (["score"], "file"),
        (["cases", "--tier", "hard"], "invalid choice: 'hard'"), (["cases", "--version", "2031.1"], "invalid choice"),
        (["cases", "--seed", "many"], "invalid int value"), (["cases", "--truth", "x"], "unrecognized arguments"),
        (["score", "x.csv", "--seed", "1"], "unrecognized arguments"),
    ],
)  # fmt: skip
def test_a_wrong_word_ends_with_status_two_and_one_line(capsys, words, said):
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line
    assert line.startswith("tactilebench: ")
    assert re.search(r"; see python -m tactilebench (\w+ )?--help$", line)


@pytest.mark.usefixtures("few")
def test_a_seed_of_no_sense_and_a_tier_without_truth_are_refused_in_one_line(tmp_path, capsys):
    (tmp_path / "mine.csv").write_text("case,texel,force_n\n")
    scored = ["score", str(tmp_path / "mine.csv"), "--truth", str(tmp_path / "truth.npz"), "--tier", "curved"]
    for words, said in ((["cases", "--seed", "-4"], "seed -4: "), (scored, "--tier: no case of curved is known here")):
        assert main(words) == 2
        found = capsys.readouterr()
        assert found.err.startswith(f"tactilebench: {said}")
        assert (found.err.count("\n"), found.out) == (1, "")


def test_a_reader_that_ends_early_is_no_fault():
    words = [sys.executable, "-m", "tactilebench", "cases", "--seed", "1"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as found:  # noqa: S603 -- ours
        found.stdout.close()
        assert found.stderr.read() == b""
    assert found.returncode == 0


def test_nothing_is_printed_to_an_output_that_is_closed(tmp_path):
    command = f"{sys.executable} -m tactilebench cases --seed 1 >&-"
    found = subprocess.run(["sh", "-c", command], stderr=subprocess.PIPE, text=True, check=False)  # noqa: S603, S607
    assert found.returncode == 2
    assert found.stderr == "tactilebench: standard output is closed, and nothing was printed; open it\n"


@pytest.mark.parametrize("place", ["file", "truth"])
def test_a_file_that_is_read_is_not_replaced_by_its_scores(tmp_path, capsys, monkeypatch, place):
    monkeypatch.chdir(tmp_path)
    for name in ("file", "truth"):
        Path(name).write_text(name)
    assert main(["score", "file", "--truth", "truth", "--json", str(tmp_path / place)]) == 2
    said = capsys.readouterr()
    assert said.err == f"tactilebench: --json: {tmp_path / place} is also read; name another file for the scores\n"
    assert Path(place).read_text() == place


def test_a_text_ends_with_one_line_break(capsys):
    assert show("one\ntwo") == 0
    assert capsys.readouterr().out == "one\ntwo\n"


@pytest.fixture
def perfect(tmp_path, few):
    """The words that score a file with the true forces into another file."""
    np.savez(tmp_path / "mine.npz", **{case.name: case.truth.forces for case in few})
    return ["score", str(tmp_path / "mine.npz"), "--truth", str(tmp_path / "truth.npz"), "--json"]


def test_scores_replace_what_was_there_and_others_may_read_them(tmp_path, perfect):
    (tmp_path / "out").mkdir()
    out = tmp_path / "out" / "scores.json"
    out.write_text("before")
    before = os.umask(0o027)
    try:
        assert main([*perfect, str(out)]) == 0
    finally:
        os.umask(before)
    assert out.stat().st_mode & 0o777 == 0o640
    assert json.loads(out.read_text())["overall"]["misplaced_force"]["value"] == 0
    assert list(out.parent.iterdir()) == [out]


def test_scores_that_cannot_be_put_in_their_place_leave_nothing_behind(tmp_path, perfect, monkeypatch, capsys):
    (tmp_path / "out").mkdir()
    out = tmp_path / "out" / "scores.json"
    out.write_text("before")

    def refuse(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", refuse)
    assert main([*perfect, str(out)]) == 2
    said = capsys.readouterr()
    assert (said.err, said.out) == (f"tactilebench: --json: {out} cannot be written: No space left on device\n", "")
    assert [(each, each.read_text()) for each in out.parent.iterdir()] == [(out, "before")]


#: A case of one instant, and one of three.
REST, SLIDE = make_case(), make_case(name="moving-000", tier="moving", motion=slide(1.0, 2.0, 3.0))
ROWS = [
    *(f"linear-000,0,{texel},{texel / 10}" for texel in range(6)), "linear-000,0,outside,0.7",
    *(f"moving-000,{k},{texel},{k + texel / 10}" for k in range(3) for texel in range(6)),
    *(f"moving-000,{k},outside,{k + 0.7}" for k in range(3)),
]  # fmt: skip
HEAD = "case,instant,texel,force_n"


def read(tmp_path, lines):
    path = tmp_path / "mine.csv"
    path.write_text("\n".join(lines))
    return files.read_forces(path, [REST, SLIDE])


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ([HEAD, *ROWS, "moving-000,3,0,1"], "texels 0..5 and instants 0..2; count from 0"),
        ([HEAD, *ROWS, "moving-000,2,6,1"], "texels 0..5 and instants 0..2; count from 0"),
        ([HEAD, *ROWS, "moving-000,-1,0,1"], "texels count from 0"),
        ([HEAD, *ROWS, "moving-000,0,-1,1"], "texels count from 0"),
        ([HEAD, *ROWS, "moving-000,-1,outside,1"], "texels count from 0"),
        ([HEAD, *ROWS, "moving-000,3,outside,1"], "instants 0..2; count from 0"),
        ([HEAD, *ROWS, "linear-000,0.5,0,1"], "texel and instant must be whole numbers"),
        ([HEAD, *ROWS, "linear-000,0,1.5,1"], "texel and instant must be whole numbers"),
        ([HEAD, *ROWS, "linear-000,0,,1"], "texel and instant must be whole numbers"),
        ([HEAD, *ROWS, ROWS[6]], "mine.csv:30: linear-000 lists texel outside twice"),
        ([HEAD, *ROWS, ROWS[3]], "mine.csv:30: linear-000 lists texel 3 twice"),
        (["# a", "# b", HEAD, *ROWS[:3], ROWS[2]], "mine.csv:7: linear-000 lists texel 2 twice"),
        ([HEAD, *ROWS[:-1]], "moving-000 lacks 1 of 3 values, the first at instant 2 outside; add them"),
        ([HEAD, *ROWS[:-4], *ROWS[-3:]], "moving-000 lacks 1 of 18 values, the first at instant 2, texel 5; add them"),
        (["# tactilebench 2026.1", "# by tactilebench 2025.1", HEAD, *ROWS], "version 2025.1, not 2026.1"),
        (["# tactilebench v2025.12.1", HEAD, *ROWS], "version 2025.12.1, not 2026.1"),
        ([HEAD, *ROWS[1:], "linear-000,0,0,1_0"], "texel '0', force_n '1_0'; texel and instant must be whole numbers"),
        ([HEAD, *ROWS[1:], "linear-000,0,\u0660,1"], "instant '0', texel '\u0660', force_n '1'; texel and"),
        ([HEAD, *ROWS[1:], 'linear-000,0,0,"0,5"'], "force_n '0,5'; texel and instant must be whole numbers"),
        ([HEAD, *ROWS[1:], "linear-000,0,0"], "force_n None; texel and instant must be whole numbers"),
        ([HEAD, *ROWS, ",,,"], "case '' is unknown here"),
        ([HEAD, *ROWS, "moving-1.5,0,0,1"], "'moving-1.5' is unknown"),
        ([HEAD, *ROWS, "nothing-000,0,0,1"], "'nothing-000' is unknown"),
        ([HEAD, *ROWS, "foils,0,0,1"], "unknown here"),
        ([f"{HEAD},case", *ROWS], "column 'case' is listed twice"), (["case,texel", *ROWS], "no column 'force_n'"),
        (["case,force_n", *ROWS], "no column 'texel'"), ([HEAD, *ROWS, "linear-000,0,0,1,5"], "more entries"),
    ],
)  # fmt: skip
def test_a_row_at_fault_is_named_with_its_line(tmp_path, lines, words):
    with pytest.raises(tactilebench.BenchError) as caught:
        read(tmp_path, lines)
    assert words in str(caught.value)


def test_every_number_comes_to_its_texel_and_instant(tmp_path):
    expected = np.arange(3)[:, None] + np.arange(6) / 10
    for lines in (
        [HEAD, *ROWS],
        ["# by engine 2024.3 on 2025.11", "# tactilebench v2026.1", " case , instant, texel ,force_n", *ROWS[::-1]],
        [HEAD, *(row.replace(",", " , ") for row in ROWS), "foil-000,0,0,1", "two_bodies-000,0,0,much"],
    ):  # fmt: skip
        forces, outside = read(tmp_path, lines)
        assert forces["linear-000"] == pytest.approx(expected[0])
        assert forces["moving-000"] == pytest.approx(expected)
        assert outside["linear-000"] == pytest.approx(0.7)
        assert outside["moving-000"] == pytest.approx([0.7, 1.7, 2.7])
        assert forces.keys() == outside.keys() == {"linear-000", "moving-000"}
    forces, outside = read(tmp_path, ["case,texel,force_n", *(row.replace(",0,", ",", 1) for row in ROWS[:6])])
    assert forces["linear-000"] == pytest.approx(expected[0])
    assert (set(forces), outside) == ({"linear-000"}, {})


@pytest.mark.parametrize("kind", ["csv", "npz"])
def test_a_file_beyond_the_largest_size_is_refused_and_one_of_it_is_read(tmp_path, monkeypatch, kind):
    path = tmp_path / "mine"
    if kind == "csv":
        path.write_text("\n".join([HEAD, *ROWS]))
        size = path.stat().st_size
    else:
        with path.open("wb") as file:
            np.savez_compressed(file, **{"linear-000": np.zeros(6000)})  # much smaller than its array
        size = 6000 * 8 + 128
    monkeypatch.setattr(files, "LARGEST", size)
    assert set(files.read_forces(path, [REST, SLIDE])[0]) >= {"linear-000"}
    monkeypatch.setattr(files, "LARGEST", size - 1)
    with pytest.raises(tactilebench.BenchError, match=rf"has {size} bytes" if kind == "csv" else "hold more than"):
        files.read_forces(path, [REST, SLIDE])


@pytest.mark.parametrize(("text", "fits"), [("2026.1", True), ("v2026.1", True), (2026.1, True), (["2026.1"], True),
                                            ("2025.1", False), (2026, False), ("the last one", False)])  # fmt: skip
def test_an_archive_names_the_version_as_text_or_number(tmp_path, text, fits):
    np.savez(tmp_path / "mine.npz", version=text, **{"linear-000": np.ones(6)})
    if fits:
        assert set(files.read_forces(tmp_path / "mine.npz", [REST])[0]) == {"linear-000"}
        return
    with pytest.raises(tactilebench.BenchError, match=f"was written for version {text}, not 2026.1"):
        files.read_forces(tmp_path / "mine.npz", [REST])


def test_a_long_name_is_told_by_its_ends(tmp_path):
    for row in (f"{'a' * 9000}b,0,0,1", f"linear-000,0,0,{'9' * 9000}x"):
        with pytest.raises(tactilebench.BenchError) as caught:
            read(tmp_path, [HEAD, row])
        assert len(str(caught.value)) < 400 + len(str(tmp_path))


def test_an_archive_holds_forces_on_texels_and_beyond_them(tmp_path):
    arrays = {"linear-000": np.arange(6), "moving-000": np.ones((3, 6)), "moving-000/outside": np.arange(3.0)}
    np.savez(tmp_path / "mine.npz", **arrays, **{"foil-003": np.ones(2)}, version="2026.1")
    forces, outside = files.read_forces(tmp_path / "mine.npz", [REST, SLIDE])
    assert (set(forces), set(outside)) == ({"linear-000", "moving-000"}, {"moving-000"})
    assert forces["linear-000"].tolist() == [0, 1, 2, 3, 4, 5]
    assert outside["moving-000"].tolist() == [0, 1, 2]
    (tmp_path / "empty").write_bytes(b"")
    with pytest.raises(tactilebench.BenchError, match="has 0 bytes"):
        files.read_forces(tmp_path / "empty", [REST])
