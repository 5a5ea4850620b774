import re
import time
from types import SimpleNamespace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from validation.cli import output as module
from validation.cli.output import LINE_INTERVAL, Progress


@pytest.fixture
def clock(monkeypatch):
    """A clock that the test sets [s]."""
    now = [0.0]
    monkeypatch.setattr(module, "time", SimpleNamespace(perf_counter=lambda: now[0]))
    return now


@given(waits=st.lists(st.floats(0, 5), max_size=20))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_lines_elsewhere_than_on_a_terminal_keep_their_distance(clock, capsys, waits):
    clock[0] = 0.0
    with Progress() as progress:
        for index, wait in enumerate(waits):
            clock[0] += wait
            progress.step(index, len(waits), f"case {index}")
    times = [float(time) for time in re.findall(r"^\[ *([\d.]+) s\]", capsys.readouterr().err, flags=re.MULTILINE)]
    gaps = [after - before for before, after in zip([0.0, *times], times, strict=False)]
    # The printed times are rounded to tenths of a second.
    assert all(gap > LINE_INTERVAL - 0.1001 for gap in gaps)
    assert bool(times) == (clock[0] > 0 and any(sum(waits[: n + 1]) > LINE_INTERVAL for n in range(len(waits))))


def test_a_line_names_the_stage_and_how_far_it_is(clock, capsys):
    with Progress() as progress:
        clock[0] = 3.0
        progress.step(2, 17, "sphere")
        clock[0] = 7.0
        progress("report")
    assert capsys.readouterr().err == "[  3.0 s] 2/17 sphere\n[  7.0 s] report\n"


def test_a_stage_that_says_nothing_is_said_to_take_long(capsys, monkeypatch):
    monkeypatch.setattr(module, "LONG", 0.05)
    with Progress() as progress:
        progress("solid")
        lines, given_up = [], time.monotonic() + 60
        while len(lines) < 2 and time.monotonic() < given_up:
            time.sleep(0.05)
            lines += capsys.readouterr().err.splitlines()
    assert len(lines) >= 2
    capsys.readouterr()
    assert all(line.endswith("this takes long; still busy with: solid") for line in lines)
    time.sleep(0.1)
    assert capsys.readouterr().err == ""
