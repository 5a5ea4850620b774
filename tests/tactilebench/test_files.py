"""Files of forces: what is whole is scored, and everything else is named in one line."""

import io
import json
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

import tactilebench
from tactilebench.__main__ import main
from tactilebench.case import DATA


@pytest.fixture(scope="module")
def foils():
    return [case for case in tactilebench.cases() if case.tier == "foil"]


@pytest.fixture(scope="module")
def lines(foils):
    """Lines of a CSV file with 0.9 times the true forces of a tier."""
    rows = [f"{case.name},{k},{0.9 * force!r}" for case in foils for k, force in enumerate(case.truth.forces.tolist())]
    return ["case,texel,force_n", *rows]


def run(tmp_path, capsys, text, *more):
    path = tmp_path / "mine.csv"
    path.write_bytes(text if isinstance(text, bytes) else "\n".join(text).encode())
    status = main(["score", str(path), "--tier", "foil", *more])
    return status, capsys.readouterr()


def test_a_whole_file_is_scored_in_any_order(tmp_path, capsys, foils, lines):
    out = tmp_path / "scores.json"
    status, said = run(tmp_path, capsys, lines, "--json", str(out))
    assert status == 0
    result = json.loads(out.read_text())
    shares = [case.truth.forces.sum() / case.load for case in foils]
    assert result["overall"]["total_force_error"]["value"] == pytest.approx(0.1 * np.mean(shares))
    assert result["truth"] == {case.name: case.truth.digest for case in foils}
    assert run(tmp_path, capsys, [*lines[:1], *lines[:0:-1]])[1].out.splitlines() == said.out.splitlines()[:-1]


def change(lines, number, pattern, text):
    return [*lines[:number], re.sub(pattern, text, lines[number], count=1), *lines[number + 1 :]]


FAULTS = {
    "a texel is missing": (lambda x: x[:5] + x[6:], "lacks 1 of 25 values, the first at instant 0, texel 4"),
    "a texel twice": (lambda x: [*x, x[3]], "lists texel 2 twice"),
    "a case is missing": (lambda x: [each for each in x if "foil-003" not in each], "1 of 32 cases are missing"),
    "an unknown case": (lambda x: [*x, "foil-999,0,1.0"], "case 'foil-999' is unknown"),
    "an unknown tier": (lambda x: [*x, "foils-000,0,1.0"], "case 'foils-000' is unknown"),
    "a texel beyond": (lambda x: [*x, "foil-000,25,1.0"], "texels 0..24"),
    "a texel below": (lambda x: [*x, "foil-000,-1,1.0"], "count from 0"),
    "not a number": (lambda x: change(x, 4, r"[^,]*$", "nan"), "mine.csv:5: foil-000: texel 3 has force_n nan"),
    "infinite": (lambda x: change(x, 4, r"[^,]*$", "inf"), "must be finite"),
    "a word": (lambda x: change(x, 4, r"[^,]*$", "much"), "force_n a number"),
    "a gap": (lambda x: change(x, 4, r"[^,]*$", ""), "force_n a number"),
    "a row too short": (lambda x: change(x, 4, r",[^,]*$", ""), "force_n a number"),
    "no header": (lambda x: x[1:], "no column 'case'"),
    "another version": (lambda x: ["# tactilebench 2027.1", *x], "version 2027.1, not 2026.1"),
    "millinewtons": (lambda x: scale(x, 1e3), "900 times the true ones, as if in mN"),
    "kilonewtons": (lambda x: scale(x, 1e-3), "as if in kN"),
    "grams": (lambda x: scale(x, 1e3 / 9.80665), "as if in gf"),
    "kilograms": (lambda x: scale(x, 1 / 0.9 / 9.80665), "as if in kgf"),
    "micronewtons": (lambda x: scale(x, 1e6), "as if in uN"),
    "pull instead of pressure": (lambda x: scale(x, -1.0), "as if negative under pressure"),
    "no unit of force": (lambda x: scale(x, 1e5), "9e+04 times the true ones; give newtons"),
    "beyond all numbers": (lambda x: change(x, 4, r"[^,]*$", "1e308"), "foil-000: texel 3 has 1e+308 N"),
    "decimal commas": (lambda x: [x[0], *(each.replace(".", ",") for each in x[1:])], "mine.csv:2 has more entries"),
    "semicolons": (lambda x: [each.replace(",", ";") for each in x], "with commas between"),
    "a column twice": (lambda x: [f"{each},force_n" if k == 0 else f"{each},0" for k, each in enumerate(x)], "twice"),
    "empty": (lambda x: b"", "has 0 bytes"),
    "not text": (lambda x: b"\xff\xfe\x00case", "UTF-8"),
    "binary": (lambda x: b"case,texel,force_n\n\0", "is binary"),
    "a damaged archive": (lambda x: b"PK\x05\x06" + bytes(18), "cases are missing"),
}  # fmt: skip


def scale(lines, factor):
    rows = (each.rpartition(",") for each in lines[1:])
    return [lines[0], *(f"{place},{factor * float(force)!r}" for place, _, force in rows)]


@pytest.mark.parametrize("fault", FAULTS)
def test_what_is_not_whole_is_named_in_one_line_and_not_scored(tmp_path, capsys, lines, fault):
    damage, words = FAULTS[fault]
    out = tmp_path / "scores.json"
    status, said = run(tmp_path, capsys, damage(lines), "--json", str(out))
    assert status == 2
    assert words in said.err
    assert said.err.count("\n") == 1
    assert not said.out
    assert not out.exists()


def test_places_that_cannot_be_written_or_read_are_named(tmp_path, capsys, lines):
    assert main(["score", str(tmp_path / "nothing.csv")]) == 2
    assert "nothing.csv: cannot be read: No such file" in capsys.readouterr().err
    assert run(tmp_path, capsys, lines, "--json", str(tmp_path / "no" / "x.json"))[1].err.startswith(
        "tactilebench: --json: "
    )
    assert main(["score", "x.csv", "--truth", str(tmp_path / "no.npz")]) == 2
    assert "no.npz" in capsys.readouterr().err


def damage_bytes(content):
    """Overwrite bytes in the middle of the first compressed array."""
    return content[:200] + b"x" * 60 + content[260:]


def pack(**arrays):
    held = io.BytesIO()
    np.savez_compressed(held, **arrays)
    return held.getvalue()


def encrypt(content):
    """Set the flag of encryption in the first entry of an archive."""
    raw, entry = bytearray(content), content.find(b"PK\x01\x02")
    raw[6] |= 1
    raw[entry + 8] |= 1
    return bytes(raw)


def declare(shape):
    """An archive whose only array has a shape in its header and no numbers."""
    held, header = io.BytesIO(), io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": shape})
    with zipfile.ZipFile(held, "w") as archive:
        archive.writestr("foil-000.npy", header.getvalue())
    return held.getvalue()


ARCHIVES = {
    "damaged": lambda x: damage_bytes(pack(**x)),
    "cut off": lambda x: pack(**x)[:-40],
    "encrypted": lambda x: encrypt(pack(**x)),
    "pickled": lambda x: pack(**x | {"foil-000": x["foil-000"].astype(object)}),
    "larger than memory": lambda _: declare((10**13,)),
    "larger than numbers": lambda _: declare((10**25,)),
    "complex": lambda x: pack(**x | {"foil-000": x["foil-000"] * (1 + 1j)}),
    "dates": lambda x: pack(**x | {"foil-000": x["foil-000"].astype("M8[s]")}),
    "unknown case": lambda x: pack(**x, foo=np.ones(3)),
    "force beyond the texels of an unknown case": lambda x: pack(**x, **{"foil-999/outside": np.ones(())}),
    "force beyond the texels is infinite": lambda x: pack(**x, **{"foil-000/outside": np.array(np.inf)}),
}


@pytest.mark.parametrize("fault", ARCHIVES)
def test_an_archive_that_is_not_whole_is_named_in_one_line(tmp_path, capsys, foils, lines, fault):
    content = ARCHIVES[fault]({case.name: case.truth.forces for case in foils})
    (tmp_path / "truth.npz").write_bytes(content)
    for text, words in ((content, ()), (lines, ("--truth", str(tmp_path / "truth.npz")))):
        status, said = run(tmp_path, capsys, text, *words)
        assert status == 2
        assert said.err.count("\n") == 1
        assert said.err.startswith("tactilebench: ")
        assert not said.out


@pytest.mark.parametrize("fault", ["damaged", "no number", "no case", "another seed"])
def test_a_truth_that_is_not_whole_is_named_in_one_line(tmp_path, capsys, lines, fault):
    path = DATA / "2026.1.npz"
    with np.load(path) as file:
        arrays = {name: file[name] for name in file}
    about, path = json.loads(str(arrays["about"])), tmp_path / "truth.npz"
    if fault == "no number":
        arrays["values"] = arrays["half_widths"] = np.array(1.0)
    elif fault != "damaged":
        about |= {"cases": []} if fault == "no case" else {"seed": 3}
        arrays["about"] = np.array(json.dumps(about))
    path.write_bytes(damage_bytes(pack(**arrays)) if fault == "damaged" else pack(**arrays))
    status, said = run(tmp_path, capsys, lines, "--truth", str(path))
    assert status == 2
    assert said.err.startswith(f"tactilebench: {path}: ")
    assert said.err.count("\n") == 1


def test_what_is_no_file_is_not_replaced_by_scores(tmp_path, capsys, lines):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for place in (tmp_path, pipe):
        status, said = run(tmp_path, capsys, lines, "--json", str(place))
        assert status == 2
        assert f"--json: {place} is a folder, a device or a pipe" in said.err
    assert pipe.is_fifo()


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").is_char_device(), reason="no full device")
def test_a_full_disk_and_an_ascii_terminal_leave_no_traceback(tmp_path, lines):
    path, out = tmp_path / "mine.csv", tmp_path / "\u00fc.json"
    path.write_text("\n".join(lines))
    words = [sys.executable, "-m", "tactilebench", "score", str(path), "--tier", "foil", "--json", str(out)]
    with Path("/dev/full").open("w") as full:
        found = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, text=True, check=False)  # noqa: S603
    assert found.returncode == 2
    assert found.stderr == "tactilebench: standard output cannot be written: No space left on device\n"
    ascii_alone = os.environ | {"PYTHONIOENCODING": "ascii"}
    found = subprocess.run(words, env=ascii_alone, capture_output=True, check=False)  # noqa: S603
    assert (found.returncode, found.stderr) == (0, b"")


def test_the_template_lacks_the_forces_alone_and_an_archive_is_read(tmp_path, capsys):
    assert main(["template", "--tier", "moving"]) == 0
    rows = capsys.readouterr().out.splitlines()
    known = [case for case in tactilebench.cases() if case.tier == "moving"]
    assert len(rows) == 2 + sum(case.truth.forces.size for case in known)
    values = iter(np.concatenate([case.truth.forces.ravel() for case in known]).tolist())
    path, archive = tmp_path / "mine.csv", tmp_path / "mine.npz"
    path.write_text("\n".join([*rows[:2], *(f"{row}{next(values)!r}" for row in rows[2:])]))
    np.savez(archive, version="2026.1", **{case.name: case.truth.forces for case in known})
    for file in (path, archive):
        forces, outside = tactilebench.read_forces(file, known)
        assert tactilebench.score(forces, known, outside=outside)["overall"]["misplaced_force"]["value"] == 0
    np.savez(archive, version="2025.1", **{case.name: case.truth.forces for case in known})
    assert main(["score", str(archive)]) == 2
    assert "2025.1" in capsys.readouterr().err


def test_a_force_beyond_the_texels_counts_where_it_is_stated(tmp_path, foils, lines):
    path = tmp_path / "mine.csv"
    rows = [f"{case.name},outside,{float(case.truth.outside) + 0.02 * case.load!r}" for case in foils]
    path.write_text("\n".join([*scale(lines, 1 / 0.9), *rows]))
    forces, outside = tactilebench.read_forces(path, foils)
    found = tactilebench.score(forces, foils, outside=outside)["overall"]["misplaced_force"]["value"]
    assert found == pytest.approx(0.01, rel=1e-6)
