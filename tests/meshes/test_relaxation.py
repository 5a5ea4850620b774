"""Relaxation functions: values and means over intervals, by an independent integration."""

import numpy as np
import pytest
from scipy.integrate import quad

from meshes.relaxation import Relaxation

PRONY = Relaxation(g=(0.35, 0.15), tau=(0.4, 25.0))
POWER = Relaxation(exponent=0.23, tau=(0.03,))
WHOLE = Relaxation(g=(1.0,), tau=(2.0,))


@pytest.mark.parametrize(
    ("relaxation", "time", "share"),
    [
        (PRONY, 0.0, 1.0),
        (PRONY, 0.4, 1 - 0.35 * (1 - np.exp(-1)) - 0.15 * (1 - np.exp(-0.016))),
        (PRONY, 25.0, 0.5 + 0.15 * np.exp(-1) + 0.35 * np.exp(-62.5)),
        (PRONY, 1e6, 0.5),
        (WHOLE, 6.0, np.exp(-3)),
        (POWER, 0.0, 1.0),
        (POWER, 0.03, 2**-0.23),
        (POWER, 29.97, 1000**-0.23),
    ],
)
def test_the_modulus_after_a_step(relaxation, time, share):
    assert relaxation.at(time) == pytest.approx(share, rel=1e-12)


@pytest.mark.parametrize("relaxation", [PRONY, POWER, WHOLE])
@pytest.mark.parametrize(("start", "length"), [(0.0, 1e-3), (0.0, 0.7), (0.2, 3.0), (5.0, 40.0), (40.0, 1e-9)])
def test_the_mean_over_an_interval_is_its_integral(relaxation, start, length):
    wanted = quad(lambda s: relaxation.at(start + s), 0, length, epsabs=0, epsrel=1e-11)[0] / length
    assert float(relaxation.mean(np.array(start), np.array(length))) == pytest.approx(wanted, rel=1e-7)


def test_means_of_many_intervals_have_their_shape():
    found = POWER.mean(np.array([[0.0], [2.0]]), np.array([0.0, 1e-12, 1.0]))
    assert found.shape == (2, 3)
    assert found[:, 0] == pytest.approx(found[:, 1])
    assert found[:, 0] == pytest.approx([1.0, (1 + 2 / 0.03) ** -0.23])


@pytest.mark.parametrize(
    "given",
    [{"exponent": 1e-9, "tau": (1.0,)}, {"exponent": 0.999, "tau": (1e-6,)}, {"g": (0.1,) * 10, "tau": (1.0,) * 10}],
)
def test_extreme_relaxations_are_accepted(given):
    assert 0 <= Relaxation(**given).at(100.0) <= 1


@pytest.mark.parametrize(
    ("given", "fault"),
    [
        ({"exponent": 0.0, "tau": (1.0,)}, "between 0 and 1, not 0.0"),
        ({"exponent": 1.0, "tau": (1.0,)}, "between 0 and 1, not 1.0"),
        ({"exponent": 0.2, "tau": (1.0, 2.0)}, "one positive time for each of 1 terms"),
        ({"g": (0.2,), "tau": (1.0,), "exponent": 0.2}, "either g, the Prony terms, or exponent"),
        ({"g": (0.2, -0.1), "tau": (1.0, 2.0)}, "positive terms, not 0.2, -0.1"),
        ({"g": (0.6, 0.40001), "tau": (1.0, 2.0)}, "at most one, not to 1.00001"),
        ({"g": (0.2,), "tau": (1.0,), "bulk": "soft"}, "bulk is relaxing or constant, not 'soft'"),
    ],
)
def test_faults_name_the_parameter(given, fault):
    with pytest.raises(ValueError, match=fault):
        Relaxation(**given)
