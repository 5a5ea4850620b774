"""Writes the scored values of a sensor for a simulator into a folder."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from pathlib import Path

from validation.extras import require
from validation.json_values import json_text
from validation.output_folder import make_file_name, new_folder, write_text
from validation.parameters import find_parameters
from validation.sensor_file import SensorDescription
from validation.simulator_models import Exported
from validation.simulator_values.targets import TARGETS, score_target

#: Keys of a row of `scored.json` that `Exported.scores` keeps.
_KEPT = ("name", "parameters", "units", "fitted", "mean", "worst", "unseen")


def export_values(
    sensor: SensorDescription,
    out: Path,
    *,
    form: str,
    loads: tuple[float, float] | None,
    changes: Sequence[str],
    progress: Callable[[str], None] | None,
) -> Exported:
    """Write the file of a simulator, `scored.json` with all scores, and the parameters of the fast model.

    Args:
        sensor: The sensor, with its cover.
        out: Folder for the files; an earlier result is replaced.
        form: Format, a key of `TARGETS`.
        loads: Smallest and largest load [N]; None for those that follow from the electronics.
        changes: Words of the command line by which the cover was changed, for the command in the files.
        progress: Called with the name of each stage.

    Raises:
        InputError: If nothing can be scored on the array or cover, or under the loads.
        ConvergenceError: If the finite elements do not converge.
        MissingExtraError: If finite elements are not installed.
    """
    require("skfem")
    _ = sensor.layered_cover  # refuses a curved cover
    tell = progress or (lambda _: None)
    name = make_file_name(sensor.array.name, suffix=TARGETS[form].suffix)
    words = [shlex.quote(sensor.source.removeprefix("built-in ")), f"--format {form}", *changes]
    with new_folder(out) as folder:
        parameters = find_parameters(sensor, tell)
        scores = score_target(
            form, sensor, parameters, loads=loads, command=" ".join(["softcover export", *words]), progress=tell
        )
        parameters.save(folder)
        written = scores.as_json()
        write_text(folder / name, TARGETS[form].write(scores, sensor, parameters))
        write_text(folder / "scored.json", json_text(written))
    rows = [{key: row[key] for key in _KEPT} for row in written["rows"]]
    return Exported(
        sensor=sensor.array.name, format=form, method=None, out=str(out),
        files=(name, "scored.json", "parameters.toml", "cover.npz"), scores={"loads": written["loads"], "rows": rows},
    )  # fmt: skip
