"""`softcover import`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from validation.cli.options import Json
from validation.cli.output import print_json, say
from validation.errors import InputError
from validation.text.indenter import read_indenter, read_load

_File = Annotated[Path, Parameter(help="A recording: .dsa, .csv, .bag, .mcap, or a folder of ROS 2.")]
_Out = Annotated[Path | None, Parameter(help="New .mcap file; the recording's name with .mcap when not given.")]
_Indenter = Annotated[str, Parameter(help="What pressed, e.g. box:size=10.5mmx10.5mmx5mm.")]
_Load = Annotated[str | None, Parameter(help="Its force or weight, e.g. 4.9N or 500g.", allow_leading_hyphen=True)]
_Note = Annotated[str, Parameter(help="Anything else to keep in the file.")]
_Topic = Annotated[str | None, Parameter(help="Topic with the frames, in bags of other programs.")]
_Force = Annotated[Path | None, Parameter(help="A force sensor's own recording, .csv or a bag, to put beside.")]
_Delay = Annotated[float, Parameter(help="How much later the force sensor's clock shows the same instant [s].")]
_Rows = Annotated[int | None, Parameter(help="Texels along y, where the file does not say so.")]
_Columns = Annotated[int | None, Parameter(help="Texels along x, where the file does not say so.")]


def import_file(
    file: _File,
    *,
    out: _Out = None,
    indenter: _Indenter = "",
    load: _Load = None,
    note: _Note = "",
    topic: _Topic = None,
    force: _Force = None,
    force_delay: _Delay = 0.0,
    rows: _Rows = None,
    columns: _Columns = None,
    json: Json = False,
) -> None:
    """Bring a recording of any known format into the labelled form, as MCAP.

    A recording of ours that was cut off is completed in place when no other file is named.
    """
    from validation.cli.replay import describe
    from validation.recordings import mcap_reader
    from validation.recordings.importing import add_forces, open_recording, relabel, save
    from validation.recordings.recording import Setup

    if indenter:
        read_indenter(indenter)
    setup = Setup(indenter=indenter, load=None if load is None else read_load(load), note=note)
    recording = relabel(open_recording(file, topic=topic, rows=rows, columns=columns), setup)
    if force is not None:
        recording = add_forces(recording, force, delay=force_delay)
    if out is None and force is None and not recording.complete:
        mcap_reader.recover(file)
        target = file
    else:
        target = out or Path(f"{file.stem}.mcap")
        if target.exists():
            raise InputError(f"--out: {target} exists; name a new file")
        save(recording, target)
    if json:
        print_json({**describe(recording), "out": str(target)})
    else:
        say(f"wrote {target}: {len(recording.times)} frames of {len(recording.arrays)} arrays")
