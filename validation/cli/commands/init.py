"""The command `softcover init`, which writes a template of a sensor file."""

from __future__ import annotations

from pathlib import Path

from validation.cli import output
from validation.errors import InputError


def init(path: Path = Path("sensor.toml"), *, force: bool = False) -> None:
    """Write a sensor file of a home-made sensor with all keys explained, to change for a sensor of your own.

    Examples of use:

        softcover init
        softcover init my-sensor.toml

    Args:
        path: The file to write.
        force: Replace a file that is already there.
    """
    from validation.output_folder import write_text
    from validation.sensor_file import read_template

    if path.is_dir():
        raise InputError(f"{path}: is a folder; name a file, for example {path / 'sensor.toml'}")
    if path.exists() and not force:
        raise InputError(f"{path}: exists already; name another file, or replace it with --force")
    write_text(path, read_template())
    output.say(
        f"wrote {path}: a home-made sensor of 6 x 4 texels under 2 mm of silicone, complete as it is; change rows, "
        "columns, pitch, thickness and material to yours, the comments say how"
    )
