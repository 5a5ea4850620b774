"""Which loads a cross-validation leaves out, and the exact edges of temperature and load that vary apart."""

import numpy as np
import pytest

from meshes import Box
from validation.calibration.cross_validation import list_folds
from validation.calibration.model import Observations, Placement
from validation.calibration.temperatures import describe_confounding, find_warmth

FACE = Box(size=(0.01, 0.01, 0.01))


def see(loads, warm, places=None):
    m = len(loads)
    return Observations(
        loads=np.array(loads, dtype=float), counts=np.ones((m, 2)), measured=np.ones((m, 2), dtype=bool),
        placements=tuple(Placement(name=name, indenter=FACE, at=(0.0, 0.0), yaw=0.0) for name in places or "a" * m),
        groups=tuple(map(str, range(m))), temperatures=np.array(warm, dtype=float), ages=np.full(m, np.nan),
        thresholds=np.zeros(m), creep=np.full(m, np.nan),
    )  # fmt: skip


def correlate(square):
    """Loads and temperatures with a squared correlation."""
    loads = np.array([1.0, 2.0, 3.0, 2.0, 2.0])
    off = 10 * np.sqrt(1 / square - 1)
    return loads, 30 + 10 * (loads - 2) + off * np.array([0.0, 0.0, 0.0, 1.0, -1.0])


@pytest.mark.parametrize(("square", "together"), [(0.79, False), (0.799, False), (0.801, True), (0.95, True)])
def test_four_fifths_of_the_variance_in_common_is_too_much(square, together):
    loads, warm = correlate(square)
    assert np.corrcoef(loads, warm)[0, 1] ** 2 == pytest.approx(square)
    said = describe_confounding(see(loads, warm))
    assert said == (f"temperature and load rise together (squared correlation {square:.2f})" if together else "")
    assert describe_confounding(see(loads, 60 - warm)) == said
    places = "aaaaabbbbb"
    two = see([*loads, *loads], [*warm, *(warm + 9)], places)
    expected = {"a": warm.mean(), "b": warm.mean() + 9} if together else {}
    assert find_warmth(two) == pytest.approx(expected)


@pytest.mark.parametrize(("span", "said"), [(5.0, False), (4.99, True)])
def test_a_range_of_five_kelvin_is_needed(span, said):
    text = describe_confounding(see([1, 2, 1, 2], [20, 20 + span, 20 + span, 20]))
    assert text == (f"the temperature varies by {span:.1f} K only; 5 K are needed" if said else "")


@pytest.mark.parametrize(
    ("loads", "scored", "left_out"),
    [
        ((1, 2, 3, 4, 5, 6, 7, 8), (4.5,), [[2], [4], [7]]),  # of six inner loads the 1st, 3rd and 6th
        ((1, 2, 3), (1.0,), []),
        ((1, 2, 3), (3.0,), []),
        ((1, 2, 3), (1.001,), [[2]]),
        ((1, 2, 3), (0.999,), [[1]]),
        ((1, 2, 3), (3.001, 2.0), [[2], [3]]),
        ((1, 2), (1.5,), []),
    ],
)
def test_loads_are_left_out_between_above_and_below_as_the_scored_ones(loads, scored, left_out):
    seen = see(loads, [20.0] * len(loads))
    folds = list_folds(seen, np.array(scored), seen.distinct_placements)
    assert [seen.loads[out].tolist() for out in folds] == left_out
