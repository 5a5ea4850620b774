"""The command `softcover init`, which writes a template of a sensor file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from validation.cli import output
from validation.errors import InputError


def init(
    out: Annotated[Path, Parameter(name=("--out", "--path"), metavar="FILE")] = Path("sensor.toml"),
    *,
    force: bool = False,
) -> None:
    """Write a sensor file of a home-made sensor with all keys explained, to change for a sensor of your own.

    Examples of use:

        softcover init
        softcover init --out my-sensor.toml

    Args:
        out: The file to write.
        force: Replace a file that is already there.
    """
    from validation.output_folder import write_text
    from validation.sensor_file import read_template

    if out.is_dir():
        raise InputError(f"{out}: is a folder; name a file, for example {out / 'sensor.toml'}")
    if out.exists() and not force:
        raise InputError(f"{out}: exists already; name another file, or replace it with --force")
    write_text(out, read_template())
    output.say(
        f"wrote {out}: a home-made sensor of 4 columns x 6 rows under 2 mm of silicone, complete as it is; change "
        "rows, columns, pitch, thickness and material to yours, the comments say how"
    )
