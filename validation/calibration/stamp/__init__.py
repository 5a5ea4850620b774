"""Stamp recordings against the fast model: a flat square stamp under known weights, fitted and scored.

What is fitted is what the recordings cannot tell beforehand: one load curve for all texels, where the stamp stands, and
what the cover does; then the same with a gain per texel.  The stamp never moves within a series, so gains absorb almost
anything; what tells a model from a table is extrapolation, and that is scored: light weights to heavy ones, room to
operating temperature.  A recording that was fitted is never scored.

What counts are: the firmware has subtracted a threshold of 100, they bend softly into saturation, and they drift under
a constant weight; so every recording is read at the same age.
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
