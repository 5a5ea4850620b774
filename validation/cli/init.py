"""`softcover init`."""

from __future__ import annotations

from pathlib import Path

from validation.cli.output import say
from validation.errors import InputError


def init(path: Path = Path("sensor.toml"), *, force: bool = False) -> None:
    """Write a commented sensor file to start from.

    Args:
        path: The file to write.
        force: Replace a file that is already there.
    """
    from validation.output_folder import write_text
    from validation.sensor_file import read_template

    if path.exists() and not force:
        raise InputError(f"{path}: exists already; name another file, or replace it with --force")
    write_text(path, read_template())
    say(f"wrote {path}; next: softcover derive {path}")
