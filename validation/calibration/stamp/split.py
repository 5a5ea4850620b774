"""Splits of the stamp recordings into recordings that models are fitted to and recordings that are scored."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from validation.calibration.stamp.case import StampCase
from validation.recordings import RecordingError


@dataclass(frozen=True, kw_only=True)
class Split:
    """One way to divide recordings of the stamp under several weights into fitted and scored ones.

    A recording is identified by its condition (`room` or `operating` temperature) and the letter of its weight (A..H).

    Attributes:
        name: Short name of the split.
        about: The interpolation or extrapolation that the split tests.
        fitted: Condition and letters of the recordings that are fitted.
        scored: Condition and letters of the recordings that are scored.
    """

    name: str
    about: str
    fitted: tuple[str, str]
    scored: tuple[str, str]

    def __post_init__(self) -> None:
        """Check that no weight is both fitted and scored.

        Raises:
            ValueError: If a weight of one condition is both fitted and scored.
        """
        both = set(self.fitted[1]) & set(self.scored[1]) if self.fitted[0] == self.scored[0] else set()
        if both:
            raise ValueError(f"split {self.name!r} scores fitted weights: {self.fitted[0]} {sorted(both)}")

    def divide(self, cases: Sequence[StampCase]) -> tuple[list[StampCase], list[StampCase]]:
        """Divide cases into those to fit and those to score; both lists are empty if a condition was not recorded.

        Raises:
            RecordingError: If a condition was recorded but some of its weights are missing.
        """
        sides = [
            [case for case in cases if case.file.condition == condition and case.file.letter in letters]
            for condition, letters in (self.fitted, self.scored)
        ]
        if not all(sides):
            return [], []
        for side, found in zip((self.fitted, self.scored), sides, strict=True):
            missing = set(side[1]) - {case.file.letter for case in found}
            if missing:
                names = ", ".join(f"{letter}1.dsa" for letter in sorted(missing))
                raise RecordingError(f"{found[0].file.path.parent}: {names} missing; the series needs all weights")
        return sides[0], sides[1]


#: The splits that are scored.  `between` tests interpolation between weights, where tables of counts do well; `heavier`
#: and `warmer` test extrapolation.
SPLITS = (
    Split(name="between", about="every other weight", fitted=("room", "ACEG"), scored=("room", "BDFH")),
    Split(name="heavier", about="light weights to heavy ones", fitted=("room", "ABCD"), scored=("room", "EFGH")),
    Split(
        name="warmer",
        about="room to operating temperature",
        fitted=("room", "ABCDEFGH"),
        scored=("operating", "ABCDEFGH"),
    ),
)
