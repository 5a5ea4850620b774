"""Compares the fast model with recordings of a flat square stamp under known weights.

The unknown quantities are fitted to a part of the recordings: one curve from texel force to counts (load curve) for all
texels, the pose of the stamp, and the spread of force by the cover.  A second fit adds a gain per texel.  The stamp
does not move within a series, so texel gains can compensate almost any error of a model.  A table of counts per texel
would then score well too.  Therefore the scores measure extrapolation: from light to heavy weights, and from room to
operating temperature.  A recording that was fitted is never scored.

The firmware has subtracted a threshold of 100 from the recorded counts.  The counts saturate softly, and they drift
under a constant weight, so every recording is evaluated at the same time after its load was applied.
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
