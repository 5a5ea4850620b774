"""Finds weight series: recordings of a square stamp under known weights, where the name of each file gives the weight.

A weight series has the folders `room` and `operating`, named after the temperature of the sensor, with the files
`A1.dsa` .. `H2.dsa`.  The letters A..H stand for masses of 200..900 g in steps of 100 g; the digit counts the repeats.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

from meshes.constants import STANDARD_GRAVITY
from validation.recordings.recording import RecordingError

#: Repository, commit and author of the published weight series, which is not part of this distribution.
SOURCE = (
    "github.com/peter-kiechle/tactile-sensors @7bbb341b2db445653477b82b908e2ef0175cf926 "
    "(P. Kiechle, University of Innsbruck, 2015)"
)
#: Edge length of the flat square stamp that carried known weights in the weight series [m].
STAMP_EDGE = 10.5e-3
#: Threshold that the firmware subtracted from the counts in the weight series, from the notes of its author [counts].
THRESHOLD = 100
#: Folders of a weight series, named after the temperature of the sensor.
_CONDITIONS = ("room", "operating")
#: Letters for the masses on the stamp: A stands for 200 g, and each following letter for 100 g more.
_LETTERS = "ABCDEFGH"
#: Pattern of the file names of a weight series: letter of the mass and number of the repeat.
_FILE_NAME = re.compile(r"([A-H])([1-9])\.dsa")
#: Environment variable that names the folder of recordings, and the folder that is used if the variable is not set.
_ENVIRONMENT_VARIABLE, _DEFAULT_FOLDER = "SOFTCOVER_RECORDINGS", Path("../shared/recordings")


@dataclass(frozen=True, kw_only=True)
class StampFile:
    """One file of a weight series: a recording of the stamp under one weight.

    Attributes:
        path: The file.
        condition: Temperature of the sensor, `room` or `operating`.
        letter: Letter of the mass on the stamp, A..H.
        repeat: Number of the recording among the repeats with this mass, from 1.
    """

    path: Path
    condition: str
    letter: str
    repeat: int

    @property
    def mass(self) -> float:
        """Mass on the stamp [kg]."""
        return (200 + 100 * _LETTERS.index(self.letter)) * 1e-3

    @property
    def load(self) -> float:
        """Weight on the stamp [N]."""
        return self.mass * STANDARD_GRAVITY

    @property
    def weight(self) -> str:
        """Name of the condition and the letter of the mass, the same for all repeats."""
        return f"{self.condition} {self.letter}"

    @property
    def name(self) -> str:
        """Name of the recording: condition, letter of the mass and number of the repeat."""
        return f"{self.weight}{self.repeat}"


def find_recordings_folder(given: str | Path | None = None) -> Path | None:
    """Find the folder with recordings.

    The folder is the argument `given`, or else the value of the environment variable `SOFTCOVER_RECORDINGS`, or else
    `../shared/recordings` relative to the current folder.

    Returns:
        The folder; None if neither argument nor variable is set and the default folder does not exist.

    Raises:
        RecordingError: If the folder named by the argument or by the variable does not exist.
    """
    named = given if given is not None else os.environ.get(_ENVIRONMENT_VARIABLE)
    if named is None:
        return _DEFAULT_FOLDER if _DEFAULT_FOLDER.is_dir() else None
    folder = Path(named)
    if not folder.is_dir():
        raise RecordingError(f"{folder}: no such folder; expected a folder with recordings ({SOURCE})")
    return folder


def find_stamp_files(folder: str | Path) -> tuple[StampFile, ...]:
    """Find the files of a weight series in a folder or up to three levels below it.

    Returns:
        The files in the order of condition, letter and repeat.

    Raises:
        RecordingError: If there is no weight series, or if one of its files has another name than A1.dsa .. H9.dsa.
    """
    root = Path(folder)
    for pattern in ("room", "*/room", "*/*/room", "*/*/*/room"):
        for room in sorted(root.glob(pattern)):
            if any(_FILE_NAME.fullmatch(file.name) for file in room.glob("*.dsa")):
                return _list_files(room.parent)
    raise RecordingError(
        f"{root}: no weight series; expected room/A1.dsa .. room/H2.dsa (and operating/) in it or below: {SOURCE}"
    )


def _list_files(folder: Path) -> tuple[StampFile, ...]:
    """List the files of the weight series in a folder, in the order of condition, letter and repeat."""
    files = []
    for condition in _CONDITIONS:
        for path in sorted((folder / condition).glob("*.dsa")):
            match = _FILE_NAME.fullmatch(path.name)
            if match is None:
                raise RecordingError(f"{path}: not a name of the series; expected A1.dsa .. H9.dsa")
            files.append(StampFile(path=path, condition=condition, letter=match[1], repeat=int(match[2])))
    return tuple(files)
