"""Adapters of tactilebench: bodies and integrals by independent values, reports of other engines, files of scores."""

import json
import subprocess
import sys
from pathlib import Path

import bodies
import convert
import mujoco
import mujoco_press
import numpy as np
import pytest

import results_page
import tactilebench
from benchmarks.tactilebench import cases_as_softcover, truth
from meshes.tilt import tilt_indenter
from tactilebench.__main__ import main
from tests.support.score_schema import check_scores

ADAPTERS = Path(bodies.__file__).parent
KNOWN = {case.name: case for case in tactilebench.cases()}
LINEAR = [case for case in KNOWN.values() if case.tier == "linear"]
#: One case of each shape, upright and tilted.
SHAPES = {(case.bodies[0].shape["shape"], any(case.bodies[0].tilt)): case for case in LINEAR}
RESULTS = sorted(bodies.RESULTS.glob("*.json"))


@pytest.mark.parametrize("case", SHAPES.values(), ids=[f"{shape}, tilted {tilted}" for shape, tilted in SHAPES])
def test_the_lower_side_of_a_body_is_that_of_softcover(case):
    """Rays from below hit the parts in MuJoCo at the gap that softcover computes."""
    (body,) = case.bodies
    spec = mujoco.MjSpec()
    mujoco_press.add_body(spec, case, fields=False)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    x, y = np.array(body.at[:2])[:, None] + np.random.default_rng(1).uniform(-6e-3, 6e-3, (2, 200))
    indenter, pose = cases_as_softcover.make_indenter(body), cases_as_softcover.make_pose(body)
    indenter = tilt_indenter(indenter, body.tilt) if any(body.tilt) else indenter
    gaps = indenter.gap(*pose.to_indenter(x, y))
    hit = np.zeros(1, dtype=np.int32)
    up, below = np.array([0.0, 0.0, 1.0]), 0.1
    found = np.array([
        mujoco.mj_ray(model, data, np.array([*at, -below]), up, None, 1, -1, hit) for at in zip(x, y, strict=True)
    ]) - below  # fmt: skip
    under = np.isfinite(gaps)
    assert under.sum() > 20
    assert (found[~under] < 0).mean() > 0.9  # rays beside a tilted body may hit its sides
    assert np.quantile(np.abs(found - gaps)[under], 0.97) < 2e-7
    assert (
        bodies.find_reach(bodies.make_parts(body))
        >= np.hypot(*(np.array([x, y]) - np.array(body.at[:2])[:, None]))[under].max()
    )


def test_the_integral_of_a_linear_pressure_is_exact():
    corners = np.array([[[0, 0, 0], [6e-3, 0, 1e-3], [0, 3e-3, -1e-3]], [[0, 0, 0], [0, 3e-3, 0], [0, 0, 5e-3]]])
    pressure = np.array([[3e3, 6e3, 0], [1e3, 1e3, 1e3]])
    points, forces = bodies.integrate(corners, pressure, 2e-4)
    assert forces.sum() == pytest.approx(3e3 * 9e-6)  # mean pressure times the area from above; the wall has none
    # First moment of p = 3000 + 3000 u - 3000 v over the triangle of area A: A / 12 (2 px + others) along each edge.
    assert forces @ points[:, 0] == pytest.approx(9e-6 * 6e-3 * (3e3 + 2 * 6e3 + 0) / 12, rel=1e-3)
    assert bodies.integrate(corners[:0], pressure[:0], 2e-4)[1].sum() == 0


def run_converter(monkeypatch, capsys, path, form):
    monkeypatch.setattr(sys, "argv", ["convert.py", form, str(path)])
    status = convert.main()
    return status, capsys.readouterr()


def test_contacts_go_to_the_texels_below_them(tmp_path, monkeypatch, capsys):
    """Points on a centre, on a border, on a gap and beyond the array; a pull is negative."""
    full = next(case for case in LINEAR if case.texel_size[0] == pytest.approx(case.pitch[0]))
    gappy = next(case for case in LINEAR if case.texel_size[0] < case.pitch[0])
    first, (x, y, _) = gappy.centres[0], full.centres[8]
    rows = [
        f"{full.name},{x},{y},0.002,0.3,0.1,-1.5", f"{full.name},{x + full.pitch[0] / 2},{y},0.002,0,0,-0.8",
        f"{full.name},{x},{y + full.pitch[1]},0.002,0,0,0.25", f"{full.name},1,0,0,0,0,-9",
        f"{gappy.name},{first[0] + gappy.pitch[0] / 2},{first[1]},0,0,0,-2",
    ]  # fmt: skip
    path = tmp_path / "contacts.csv"
    path.write_text("\n".join([",".join(convert.COLUMNS), *rows]))
    status, said = run_converter(monkeypatch, capsys, path, "contacts")
    assert status == 0
    (tmp_path / "mine.csv").write_text(said.out)
    forces, _ = tactilebench.read_forces(tmp_path / "mine.csv", [full, gappy])
    expected = np.zeros(full.shape)
    expected[[8, 9, 8 + full.columns]] = 1.9, 0.4, -0.25
    assert forces[full.name] == pytest.approx(expected)
    assert not forces[gappy.name].any()


def test_forces_by_row_and_column_score_as_the_truth_they_hold(tmp_path, monkeypatch, capsys):
    """Normal forces on a flat array with a motion, and vectors on the normals of a curved one."""
    moving = next(case for case in KNOWN.values() if case.tier == "moving")
    curved = next(case for case in KNOWN.values() if case.cover.geometry == "phalanx")
    vectors = -curved.truth.forces[:, None] * curved.normals
    given = {
        moving.name: moving.truth.forces.reshape(-1, moving.rows, moving.columns).tolist(),
        curved.name: vectors.reshape(curved.rows, -1, 3).tolist(),
    }
    path = tmp_path / "taxels.json"
    path.write_text(json.dumps(given))
    status, said = run_converter(monkeypatch, capsys, path, "taxels")
    assert status == 0
    (tmp_path / "mine.csv").write_text(said.out)
    forces, _ = tactilebench.read_forces(tmp_path / "mine.csv", [moving, curved])
    for case in (moving, curved):
        assert forces[case.name] == pytest.approx(case.truth.forces, rel=1e-5, abs=1e-9)  # six digits


HEADER, CASE = ",".join(convert.COLUMNS), LINEAR[0].name
FAULTS = {
    "no column": ("contacts", "case,x,y,z,fx,fy\n", "no column 'fz'"),
    "an unknown case": ("contacts", f"{HEADER}\nlinear-999,0,0,0,0,0,1", ":2: case 'linear-999' is unknown"),
    "a word": ("contacts", f"{HEADER}\n{CASE},0,0,0,0,0,much", ":2: x, y, z, fx, fy, fz must be numbers"),
    "a short row": ("contacts", f"{HEADER}\n{CASE},0,0,0", ":2: x, y, z, fx, fy, fz must be numbers"),
    "not finite": ("contacts", f"{HEADER}\n{CASE},0,0,0,0,0,nan", "must be finite"),
    "an instant": ("contacts", f"{HEADER},instant\n{CASE},0,0,0,0,0,1,3", "instant from 0 to 0"),
    "a curved cover": ("contacts", f"{HEADER}\ncurved-000,0,0,0,0,0,1", "give its forces by texel"),
    "no JSON": ("taxels", "[1, ", "is no JSON"),
    "decimal commas": ("contacts", f"{HEADER}\n{CASE},0,5,0,0,0,0,1", ":2 has more entries than the header"),
    "a case twice": ("taxels", f'{{"{CASE}": [[1.0]], "{CASE}": [[2.0]]}}', "a case is listed twice"),
    "no end of brackets": ("taxels", "[" * 100_000, "is no JSON"),
    "no object": ("taxels", "[1]", "must be an object"),
    "another shape": ("taxels", json.dumps({CASE: [[1.0]]}), "forces must be finite numbers of shape"),
    "ragged": ("taxels", json.dumps({CASE: [[1.0], [1.0, 2.0]]}), "forces must be finite numbers of shape"),
    "an unknown name": ("taxels", json.dumps({"foil-999": []}), "case 'foil-999' is unknown"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_a_report_is_named_with_its_place(tmp_path, fault):
    form, text, words = FAULTS[fault]
    path = tmp_path / "report"
    path.write_text(text)
    with pytest.raises(tactilebench.BenchError) as caught:
        convert.READERS[form](path, KNOWN)
    assert words in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_bad_input_is_one_line_and_the_exit_status_two(tmp_path, monkeypatch, capsys):
    (tmp_path / "header").write_text(HEADER)
    (tmp_path / "bytes").write_bytes(b"\xff\xfe")
    (tmp_path / "quote").write_text(f'{HEADER}\n"{"a" * 200_000}')
    for name in ("header", "bytes", "quote", "missing"):
        status, said = run_converter(monkeypatch, capsys, tmp_path / name, "contacts")
        assert (status, said.err.count("\n"), said.out) == (2, 1, ""), name
        assert name in said.err


@pytest.mark.parametrize("path", RESULTS, ids=lambda path: path.stem)
def test_a_file_of_scores_fits_the_schema_and_the_shipped_truth(path):
    found = json.loads(path.read_text())
    for kind in found.keys() & {"shipped", "fresh"}:
        check_scores(found[kind]["scores"])
        assert len(found[kind]["forces_sha256"]) == 64
        assert found[kind]["command"].startswith("python benchmarks/tactilebench/adapters/")
    digests = found["shipped"]["scores"]["truth"]
    assert digests == {name: KNOWN[name].truth.digest for name in digests}
    assert "fresh" not in found or not set(digests) & set(found["fresh"]["scores"]["truth"])


def test_the_page_holds_what_the_files_say():
    assert len(RESULTS) >= 6
    assert results_page.PAGE.read_text() == results_page.make_page(bodies.RESULTS)


def run_adapter(folder, script, *options):
    command = [sys.executable, str(ADAPTERS / script), *options, "--out", str(folder)]
    return subprocess.run(command, check=False, capture_output=True, text=True)  # noqa: S603 -- ours


def compare_with_shipped(folder, name, *, rel):
    """Assert that forces bear the load and score as the shipped file of scores says; forces have six digits."""
    again = json.loads((folder / f"{name}.json").read_text())["shipped"]["scores"]
    shipped = json.loads((bodies.RESULTS / f"{name}.json").read_text())["shipped"]["scores"]
    known = [KNOWN[row["name"]] for row in again["cases"]]
    forces, _ = tactilebench.read_forces(folder / f"{name}-shipped.csv", known)
    before = {row["name"]: row["scores"]["misplaced_force"]["value"] for row in shipped["cases"]}
    for case, row in zip(known, again["cases"], strict=True):
        assert row["scores"]["misplaced_force"]["value"] == pytest.approx(before[case.name], rel=rel, abs=2e-3)
        assert forces[case.name].sum() <= 1.02 * case.load
    # The sensor tactile reads nothing if no centre of a texel is under the body.
    inside = [case for case in known if case.truth.forces.sum() > 0.99 * case.load and forces[case.name].any()]
    assert inside
    assert all(forces[case.name].sum() == pytest.approx(case.load, rel=0.05) for case in inside)


@pytest.mark.slow
@pytest.mark.parametrize(("engine", "count"), [("touch-grid", "4"), ("tactile", "8")])
def test_sensors_of_mujoco_bear_the_load_and_score_as_shipped(tmp_path, engine, count):
    found = run_adapter(tmp_path, "mujoco_press.py", "--engine", engine, "--cases", count)
    assert found.returncode == 0, found.stderr
    compare_with_shipped(tmp_path, f"mujoco-{engine}", rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("tier", ["friction", "curved", "moving"])
def test_what_an_adapter_does_not_press_is_refused_in_one_line(tmp_path, tier):
    found = run_adapter(tmp_path, "mujoco_press.py", "--tier", tier)
    assert found.returncode == 2
    assert f"--tier {tier}: no case of one body at rest" in found.stderr
    assert found.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("variant", ["youngs", "fitted"])
def test_drake_bears_the_load_and_scores_as_shipped(tmp_path, variant):
    pytest.importorskip("pydrake")
    found = run_adapter(tmp_path, "drake_press.py", "--variant", variant, "--cases", "4")
    assert found.returncode == 0, found.stderr
    compare_with_shipped(tmp_path, f"drake-{variant}", rel=0.02)


@pytest.mark.slow
def test_whoever_returns_the_shipped_forces_by_their_place_fails_on_fresh_cases(tmp_path, monkeypatch, capsys):
    out = tmp_path / "truth.npz"
    monkeypatch.setattr(sys, "argv", f"truth.py --seed 11 --tier linear --cases 4 --out {out}".split())
    assert truth.main() == 0
    fresh = tactilebench.load_truth(out)
    assert len(fresh) >= 3
    forces = {
        case.name: np.resize(shipped.truth.forces * case.load / shipped.load, case.shape)
        for case, shipped in zip(fresh, LINEAR, strict=False)
    }
    path = tmp_path / "cheat.csv"
    bodies.write_forces(path, forces)
    assert main(["score", str(path), "--truth", str(out), "--json", str(tmp_path / "cheat.json")]) == 0
    misplaced = json.loads((tmp_path / "cheat.json").read_text())["overall"]["misplaced_force"]
    assert misplaced["low"] > 0.3
    same = LINEAR[: len(fresh)]
    bodies.write_forces(path, {case.name: case.truth.forces for case in same})
    assert (
        tactilebench.score(tactilebench.read_forces(path, same)[0], same)["overall"]["misplaced_force"]["value"] < 1e-5
    )
