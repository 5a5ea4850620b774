"""The fast model against recordings of a flat square stamp under known weights.

Fitted is what the recordings alone can determine: one load curve for all texels, the pose of the stamp and the cover;
then the same with a gain per texel.  The stamp does not move within a series, so texel gains can absorb almost any
error of a model.  Extrapolation separates a model from a table, so it is scored: from light weights to heavy ones, and
from room to operating temperature.  A recording that was fitted is never scored.

The recorded counts have three properties.  The firmware has subtracted a threshold of 100, they saturate softly, and
they drift under a constant weight; so every recording is read at the same time after its load was applied.
"""

from validation.calibration.stamp.score import (
    CountScore,
    StampExample,
    StampRow,
    StampScores,
    score_counts,
    score_recordings,
)

__all__ = ["CountScore", "StampExample", "StampRow", "StampScores", "score_counts", "score_recordings"]
