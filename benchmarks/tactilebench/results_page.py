"""Write docs/tactilebench-results.md from the files of scores: `python benchmarks/tactilebench/results_page.py`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
PAGE = HERE.parents[1] / "docs" / "tactilebench-results.md"
START = """# Scores of simulators

What other simulators, and softcover's own fast model, score on [tactilebench](tactilebench.md): tier `linear`, one
body at rest on one wide elastic layer, all shapes, tilted ones too. The table is written from
`benchmarks/tactilebench/results/*.json` by `python benchmarks/tactilebench/results_page.py`.

| simulator | version | cases | misplaced [%] | in common [%] | total force [%] | centre [mm] | floor [%] | fresh [%] |
|---|---|---|---|---|---|---|---|---|
"""
MIDDLE = """
- **Misplaced** is the share of the load on a wrong texel, mean over cases with its 95 % interval. The **floor** is
  what perfect forces may score, because the truth has an error of its own. Other scores are means too.
- **In common** are the cases that all rows have, {common} of them: compare rows with fewer cases there. Their mean
  misplaced share stands in that column.
- **Fresh cases** have another seed, so that nobody can score by the shipped truth. Their interval is wider because
  they are fewer.
- The scenes are the plainest ones of each program: default contacts in MuJoCo, which know nothing of the cover;
  Drake with the modulus that is stated. No value was fitted to the scored cases. The array is part of a wide pad in
  each.
- The sensor `tactile` reads depths at the centres of texels alone: nothing where no centre lies under the body, as
  between four texels below a ball.
- A touch sensor feels the top of the pad. Texels lie below it, and the cover spreads the force between: this is
  most of what the rows without spread misplace.
- The truth and the fast model come from one project, but share no solver. The parameters of the fast model come
  from finite elements of each cover, ten seconds a case, and from its store later, as in the times below.
- Genesis feels the depths of points in its rigid shapes, which sink until the points bear the load. The law of the
  fitted row is what `softcover export wts-0614-34 --format genesis` fits, in units of E and h: to no scored case.
  A case whose points never bear its load scores without force, such as a bar between the points.
- Newton 1.8.0 does not run on a CPU: `ModelBuilder.finalize` (`_src/sim/builder.py`, line 15481) refuses
  hydroelastic shapes without CUDA. With this check removed, textures build, but the kernel
  `count_iso_voxel_children` (`_src/geometry/sdf_hydroelastic.py`, line 1621) never ends: its stride is a block of
  threads over 8, and a block has one thread on a CPU. Its importer reads the exported file as meant.
- Isaac Lab 2.3.2 needs Isaac Sim; FlexiTac does not run here either. `adapters/convert.py` reads contacts or taxel
  forces of all four, in the form that its first lines state.

## Commands

In a clone, with `PYTHONPATH=.:benchmarks/tactilebench`. Each writes the forces, `results/NAME-shipped.csv`, and the
scores, `results/NAME.json`, whose parts `scores` fit the `score.schema.json` of the package. The hash is that of
the file of forces; it is the same only with the same versions and processor.

| command | processor time [s] | SHA-256 of the forces |
|---|---|---|
"""
END = """
Fresh cases: `python benchmarks/tactilebench/truth.py --seed 7 --tier linear --cases 22 --out truth-7.npz` computes
their truth (a minute), and `--truth truth-7.npz` behind a command adds their scores.
"""


def make_page(folder: Path) -> str:
    """Return the page for the files of scores in a folder, the best one first."""
    files = [json.loads(path.read_text()) for path in sorted(folder.glob("*.json"))]
    files.sort(key=lambda each: each["shipped"]["scores"]["overall"]["misplaced_force"]["value"])
    common = set.intersection(*(set(list_misplaced(each)) for each in files))
    rows = [f"| {' | '.join(describe(each, common))} |" for each in files]
    runs = [each[kind] for each in files for kind in ("shipped", "fresh") if kind in each]
    commands = [f"| `{run['command']}` | {run['seconds']:.0f} | `{run['forces_sha256'][:16]}` |" for run in runs]
    return (
        START + "\n".join(rows) + "\n" + MIDDLE.replace("{common}", str(len(common))) + "\n".join(commands) + "\n" + END
    )


def list_misplaced(found: dict[str, Any]) -> dict[str, float]:
    """Return the misplaced share of each shipped case of a simulator by its name [-]."""
    return {row["name"]: row["scores"]["misplaced_force"]["value"] for row in found["shipped"]["scores"]["cases"]}


def describe(found: dict[str, Any], common: set[str]) -> list[str]:
    """Return the cells of a simulator; `common` are the names of the cases that all simulators have."""
    same = [value for name, value in list_misplaced(found).items() if name in common]
    means, fresh = found["shipped"]["scores"]["overall"], found.get("fresh")
    again = f"{show(fresh['scores']['overall'])}, {fresh['scores']['overall']['cases']} cases" if fresh else ""
    return [
        found["simulator"], f"{found['package']} {found['version']}", str(means["cases"]), show(means),
        f"{100 * sum(same) / len(same):.1f}",
        f"{100 * means['total_force_error']['value']:.1f}", f"{1e3 * means['centre_of_pressure_m']['value']:.2f}",
        f"{100 * means['misplaced_force']['floor']:.2f}", again,
    ]  # fmt: skip


def show(means: dict[str, Any]) -> str:
    """Return the misplaced share with its interval [%]."""
    value, low, high = (100 * means["misplaced_force"][key] for key in ("value", "low", "high"))
    return f"{value:.1f} ({low:.1f}..{high:.1f})"


def main() -> None:
    """Write the page."""
    PAGE.write_text(make_page(HERE / "results"))
    print(PAGE)


if __name__ == "__main__":
    main()
