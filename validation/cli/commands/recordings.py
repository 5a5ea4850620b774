"""The commands `softcover replay` and `softcover import`, which show and convert recordings of any known format."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from validation.cli import options, output
from validation.cli.live_image import LiveImage
from validation.errors import InputError, refuse_existing

if TYPE_CHECKING:
    from validation.recordings.recording import Recording, SimulatedForces

#: Largest accepted delay between the clocks of force sensor and tactile sensor [s].  One clock may count from 1970 and
#: the other from the first frame.
_MOST_DELAY = 9e9


def replay(
    file: options.RecordingFile,
    *,
    array: options.PressedArrayIndex = None,
    speed: Annotated[float, Parameter(metavar="FACTOR")] = 1.0,
    csv: options.File | None = None,
    topic: options.Topic = None,
    rows: int | None = None,
    columns: int | None = None,
    json: options.Json = False,
) -> None:
    """Show a recording of any known format in the terminal, and print its properties.

    Examples of use:

        softcover replay touch.mcap
        softcover replay A1.dsa --array 1 --csv a1.csv
        softcover replay run.bag --json

    Args:
        speed: Speed of the replay, 1 for real time; 0 shows no frames.
        csv: Also write the frames of the array as CSV.
        rows: Texels along y, if the file does not tell.
        columns: Texels along x, if the file does not tell.
    """
    from validation import api
    from validation.recordings import tables

    options.check_range("--speed", speed)
    from validation.recordings.recording import choose_array

    refuse_existing("--csv", csv)
    recording = api.replay(file, topic=topic, rows=rows, columns=columns)
    shown = choose_array(recording, array)
    if csv is not None:
        csv.parent.mkdir(parents=True, exist_ok=True)
        tables.write(recording, csv, array=shown)
    facts = _list_facts(recording)
    if json:
        output.print_json({**facts, "shown": shown})
        return
    if speed and sys.stderr.isatty():
        _play(recording, shown, speed)
    _say_facts(facts, shown)


def import_recording(
    file: options.RecordingFile,
    *,
    out: options.File | None = None,
    labels: options.Labels = options.UNLABELLED,
    topic: options.Topic = None,
    force: options.File | None = None,
    force_delay: options.Time = 0.0,
    rows: int | None = None,
    columns: int | None = None,
    axis: Annotated[str | None, Parameter(metavar="AXIS")] = None,
    json: options.Json = False,
) -> None:
    """Convert a recording of any known format to an MCAP file, with labels.

    A recording by `softcover record` that was cut off is completed in place if no other file is named.

    Examples of use:

        softcover import A1.dsa --indenter box:size=10.5mmx10.5mmx5mm --load 200g
        softcover import run.bag --topic /tactile/image --out run.mcap
        softcover import table.csv --rows 14 --columns 6

    Args:
        out: New .mcap file; the recording's name with .mcap when not given.
        force: Recording of a force sensor to add, .csv or a bag.
        force_delay: Time by which the force sensor's clock is ahead of the array's, e.g. 20ms.
        rows: Texels along y, if the file does not tell.
        columns: Texels along x, if the file does not tell.
        axis: Axis normal to the array (x, y or z), of a CSV file with three columns per texel.
    """
    from validation.recordings import mcap_reader
    from validation.recordings.importing import add_forces, open_recording, relabel, save
    from validation.recordings.recording import PITCH_ASSUMED, Setup
    from validation.recordings.tables import TIME_UNIT

    setup = Setup.read(**vars(labels))
    if force_delay and force is None:
        raise InputError("--force-delay: is for the force sensor's recording; name that with --force, or leave it out")
    if not abs(force_delay) <= _MOST_DELAY:
        raise InputError(f"--force-delay: accepted: -{_MOST_DELAY:g}..{_MOST_DELAY:g} s, not {force_delay:g}")
    if out is not None and out.suffix.lower() != ".mcap":
        raise InputError(f"--out: {out} does not end in .mcap, so it could not be read again; write {out.stem}.mcap")
    recording = relabel(open_recording(file, topic=topic, rows=rows, columns=columns, axis=axis), setup)
    if force is not None:
        recording = add_forces(recording, force, delay=force_delay)
    if out is None and force is None and not recording.complete:
        mcap_reader.recover(file)
        target = file
    else:
        target = out or Path(f"{file.stem}.mcap")
        refuse_existing("--out", target)
        target.parent.mkdir(parents=True, exist_ok=True)
        save(recording, target)
    if json:
        output.print_json({**_list_facts(recording), "out": str(target)})
    else:
        output.say(f"wrote {target}: {len(recording.times)} frames of {len(recording.arrays)} arrays")
    if unit := recording.setup.other.get(TIME_UNIT):
        output.note(f"{recording.path}: the times are taken as {unit}")
    if pitch := recording.setup.other.get(PITCH_ASSUMED):  # Loads on texels and positions depend on the pitch.
        output.note(
            f"{recording.path} states no pitch; assumed: {pitch}. Commands that know the sensor take its pitch "
            "instead; for others write for example `# pitch = 0.004` [m] before the first line of a CSV file"
        )


def _list_facts(recording: Recording) -> dict[str, Any]:
    """Return the properties of a recording, as `softcover replay --json` prints them."""
    import numpy as np

    delays = recording.arrival_delays
    ranks = {"median_s": 50, "p95_s": 95, "largest_s": 100} if delays.size else {}
    return {
        "path": str(recording.path),
        "sha256": recording.sha256,
        "serial": recording.serial,
        "started": recording.started.isoformat(),
        "frames": len(recording.times),
        "seconds": recording.seconds,
        "rate_hz": recording.frame_rate,
        "complete": recording.complete,
        "gaps": recording.gaps,
        "setup": vars(recording.setup),
        "arrays": [
            {
                "name": array.texels.name,
                "rows": array.texels.rows,
                "columns": array.texels.columns,
                "active": int(array.texels.active.sum()),
                "full_scale": array.full_scale,
                "largest": int(array.counts.max(initial=0)),
                "simulated": None if array.simulated is None else _list_forces(array.simulated),
            }
            for array in recording.arrays
        ],
        "force_readings": len(recording.forces),
        "arrival_delays": {name: float(np.percentile(delays, rank)) for name, rank in ranks.items()} or None,
    }


def _list_forces(forces: SimulatedForces) -> dict[str, Any]:
    """Return the largest forces and pressure of a simulated array as JSON values; None if not recorded."""
    import numpy as np

    largest = {
        "largest_net_force_n": np.linalg.norm(forces.net_force, axis=1),
        "largest_net_torque_nm": np.linalg.norm(forces.net_torque, axis=1),
        "largest_shear_n": np.linalg.norm(forces.net_force[:, :2], axis=1),
        "largest_pressure_pa": forces.pressures,
    }
    known = {name: values[~np.isnan(values)] for name, values in largest.items()}
    listed = {name: float(values.max()) if values.size else None for name, values in known.items()}
    return {**listed, "tangential_source": forces.tangential_source or None}


def _say_facts(facts: dict[str, Any], shown: int) -> None:
    setup, delays = facts["setup"], facts["arrival_delays"]
    arrays = ", ".join(
        "{columns} columns x {rows} rows (largest {largest})".format_map(array) for array in facts["arrays"]
    )
    output.say(f"{facts['path']}: {facts['frames']} frames in {facts['seconds']:.1f} s, arrays {arrays}")
    if len(facts["arrays"]) > 1:
        output.say(f"array {shown} is shown; choose another one with --array")
    load = "" if setup["load"] is None else f", {setup['load']:.4g} N"
    output.say(f"indenter {setup['indenter'] or 'not known'}{load}; {setup['note'] or 'no note'}")
    for number, array in enumerate(facts["arrays"]):
        if array["simulated"] is not None:
            output.say(f"array {number}, simulated: {_describe_forces(array['simulated'])}")
    if setup["other"]:
        output.say("other labels: " + "; ".join(f"{key} = {value}" for key, value in setup["other"].items()))
    if delays is not None:
        late = f"{1e3 * delays['p95_s']:.1f} ms (95 %), {1e3 * delays['largest_s']:.1f} ms (all)"
        output.say(f"times by the device's clock; frames arrived up to {late} later")
    end = "closed properly" if facts["complete"] else "cut off: all but the last half second is there"
    output.say(f"{len(facts['gaps'])} gaps; {end}")


def _describe_forces(forces: dict[str, Any]) -> str:
    """Describe the largest forces and pressure of a simulated array, a result of `_list_forces`, in one line."""
    if forces["largest_net_force_n"] is None:
        return "texel forces only, as in files of earlier versions"
    return (
        f"net force up to {forces['largest_net_force_n']:.3g} N, across the normal up to "
        f"{forces['largest_shear_n']:.3g} N, pressure up to {1e-3 * forces['largest_pressure_pa']:.3g} kPa; tangential "
        f"forces: {forces['tangential_source']}"
    )


def _play(recording: Recording, array: int, speed: float) -> None:
    recorded = recording.arrays[array]
    start = time.monotonic()
    with LiveImage(columns=recorded.texels.columns, full_scale=recorded.full_scale) as live:
        for number, now in enumerate(recording.times):
            time.sleep(max(0.0, now / speed - (time.monotonic() - start)))
            if live.is_due:
                text = f"{now:6.1f} of {recording.seconds:.1f} s"
                if recorded.simulated is not None:
                    text += f", {output.describe_vector(recorded.simulated.net_force[number])}"
                live.show(recorded.counts[number], text)
