"""First shear resonance of covers, and the highest frequencies of histories."""

import pytest

from meshes import Pose
from tests.support.histories import make_case
from tests.support.rubber import stack_layers
from validation.errors import InputError
from validation.moving.history import History
from validation.moving.inertia import find_resonance, warn_of_inertia


@pytest.mark.parametrize(
    ("layers", "hertz"),
    [
        (((2e-3, 2.98e6, 0.49),), (1e6 / 1100) ** 0.5 / 8e-3),
        (((6e-3, 3e5, 0.25),), (1.2e5 / 1100) ** 0.5 / 24e-3),
        # 1 mm of 1 MPa on 3 mm of 0.25 MPa: the shear compliance is 13 mm/MPa over 4 mm
        (((3e-3, 0.5e6, 0.0), (1e-3, 2e6, 0.0)), (4e6 / 13 / 1100) ** 0.5 / 16e-3),
    ],
)
def test_the_resonance_is_that_of_a_quarter_wave(layers, hertz):
    assert find_resonance(stack_layers(*layers)) == pytest.approx(hertz, rel=1e-9)


def test_changes_above_a_tenth_of_the_resonance_are_told():
    assert warn_of_inertia(30.0, 300.0) == ()
    (told,) = warn_of_inertia(30.1, 300.0)
    assert "at up to 30.1 Hz" in told
    assert "resonance of 300 Hz" in told


@pytest.mark.parametrize(
    ("times", "values", "fastest", "last"),
    [
        ((0.0, 0.2, 5.0), (3.0, 3.0, 3.0), 0.0, 0.0),
        ((0.0, 0.2, 5.0), (0.0, 4.0, 4.0), 0.35 / 0.2, 0.2),
        ((0.0, 0.2, 0.7, 5.0), (1.0, 4.0, 3.0, 3.0), 0.35 * 0.75 / 0.2, 0.7),
        ((0.0, 2.0, 2.1, 5.0), (0.0, 4.0, 2.0, 1.0), 0.35 * 0.5 / 0.1, 5.0),
    ],
)
def test_the_fastest_change_of_a_history_counts_by_its_size(times, values, fastest, last):
    found = History(times=times, values=values, control="depth")
    assert found.fastest == pytest.approx(fastest)
    assert found.last_change == last
    assert found.duration == times[-1]


def test_motions_count_by_millimetres():
    slide = make_case((0.0, 0.5, 0.6), (2.0, 2.0, 1.0), [(0.0, 0.0), (3e-3, 4e-3), (3e-3, 4e-3)])
    assert slide.fastest == pytest.approx(0.35 * 5 / 0.5)
    assert History(times=(0.0, 1.0), values=(1.0, 1.0), poses=(Pose(), Pose())).fastest == 0.0


@pytest.mark.parametrize(
    ("times", "values", "fault"),
    [
        ((0.0,), (1.0,), "time: 1 instants; 2..1000 are accepted"),
        (tuple(map(float, range(1001))), (1.0,) * 1001, "time: 1001 instants; 2..1000"),
        ((0.5, 1.0), (1.0, 1.0), r"time\[0\]: the history must begin at 0 s, not 0.5 s"),
        ((0.0, 1.0, 1.0), (1.0, 1.0, 1.0), r"time\[2\]: 1 s must come at least 0.001 ms after 1 s"),
        ((0.0, 2e9), (1.0, 1.0), r"time: 2e\+09 s, with repetitions; at most 1e\+09 s"),
        ((0.0, 1.0), (1.0, -0.5), r"load\[1\]: -0.5; an indenter cannot pull; let it be 0..1e\+06 N or m"),
        ((0.0, 1.0), (float("nan"), 1.0), r"load\[0\]: nan; let it be"),
        ((0.0, 1.0), (0.0, 0.0), "load: zero at all instants, so that nothing presses"),
    ],
)
def test_faults_of_a_history_name_the_instant(times, values, fault):
    with pytest.raises(InputError, match=f"^{fault}"):
        History(times=times, values=values)


def test_limits_are_accepted_themselves():
    assert History(times=(0.0, 1e-6, 1e9), values=(0.0, 1e6, 0.0)).duration == 1e9
    assert len(History(times=tuple(map(float, range(1000))), values=(1.0,) * 1000).times) == 1000
