"""Labelled series of recordings: which file was made under which load, told by its name.

Weight series (a square stamp under a dead weight): folders `room` and `operating`, files `A1.dsa` .. `H2.dsa`, where
A..H are 200..900 g in steps of 100 g and the digit is the repeat.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

from meshes.constants import STANDARD_GRAVITY
from validation.recordings.recording import RecordingError

#: Where the recordings come from; they are not part of this distribution.
SOURCE = (
    "github.com/peter-kiechle/tactile-sensors @7bbb341b2db445653477b82b908e2ef0175cf926 "
    "(P. Kiechle, University of Innsbruck, 2015)"
)
#: Edge of the square stamp of the weight series [m].
STAMP_EDGE = 10.5e-3
#: Counts that the firmware subtracted in the weight series, from the author's notes [-].
THRESHOLD = 100
CONDITIONS = ("room", "operating")
LETTERS = "ABCDEFGH"
_NAME = re.compile(r"([A-H])([1-9])\.dsa")
_ENVIRONMENT = "SOFTCOVER_RECORDINGS"
_BESIDE = Path("../shared/recordings")


@dataclass(frozen=True, kw_only=True)
class StampFile:
    """One file of a weight series.

    Attributes:
        path: The file.
        condition: `room` or `operating` temperature.
        letter: A..H.
        repeat: 1, 2, ...
    """

    path: Path
    condition: str
    letter: str
    repeat: int

    @property
    def mass(self) -> float:
        """Mass on the stamp [kg]."""
        return (200 + 100 * LETTERS.index(self.letter)) * 1e-3

    @property
    def load(self) -> float:
        """Weight on the stamp [N]."""
        return self.mass * STANDARD_GRAVITY

    @property
    def weight(self) -> str:
        """Condition and letter, the same for repeats."""
        return f"{self.condition} {self.letter}"

    @property
    def name(self) -> str:
        """Condition, letter and repeat."""
        return f"{self.weight}{self.repeat}"


@dataclass(frozen=True, kw_only=True)
class StampSeries:
    """The files of a weight series, by condition, letter and repeat."""

    folder: Path
    files: tuple[StampFile, ...]


def recordings_folder(given: str | Path | None = None) -> Path | None:
    """The folder that holds recordings: the one given, else `SOFTCOVER_RECORDINGS`, else `../shared/recordings`.

    Raises:
        RecordingError: If a folder was named and is none.
    """
    named = given if given is not None else os.environ.get(_ENVIRONMENT)
    if named is None:
        return _BESIDE if _BESIDE.is_dir() else None
    folder = Path(named)
    if not folder.is_dir():
        raise RecordingError(f"{folder}: no such folder; expected a folder with recordings ({SOURCE})")
    return folder


def stamp_series(folder: str | Path) -> StampSeries:
    """Find the weight series in a folder or up to three levels below it.

    Raises:
        RecordingError: If there is none, or a name in it does not follow the series.
    """
    root = Path(folder)
    for pattern in ("room", "*/room", "*/*/room", "*/*/*/room"):
        for room in sorted(root.glob(pattern)):
            if any(_NAME.fullmatch(file.name) for file in room.glob("*.dsa")):
                return StampSeries(folder=room.parent, files=_files(room.parent))
    raise RecordingError(
        f"{root}: no weight series; expected room/A1.dsa .. room/H2.dsa (and operating/) in it or below: {SOURCE}"
    )


def _files(folder: Path) -> tuple[StampFile, ...]:
    found = []
    for condition in CONDITIONS:
        for path in sorted((folder / condition).glob("*.dsa")):
            match = _NAME.fullmatch(path.name)
            if match is None:
                raise RecordingError(f"{path}: not a name of the series; expected A1.dsa .. H9.dsa")
            found.append(StampFile(path=path, condition=condition, letter=match[1], repeat=int(match[2])))
    return tuple(found)
