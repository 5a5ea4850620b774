import time
from types import SimpleNamespace

import pytest

from validation.cli import output as module
from validation.cli.output import Progress


@pytest.fixture
def clock(monkeypatch):
    """A clock that the test sets [s]."""
    now = [0.0]
    monkeypatch.setattr(module, "time", SimpleNamespace(perf_counter=lambda: now[0]))
    return now


def test_a_line_names_the_stage_and_how_far_it_is(clock, capsys):
    with Progress() as progress:
        clock[0] = 3.0
        progress.step(2, 17, "sphere")
        clock[0] = 7.0
        progress("report")
    assert capsys.readouterr().err == "[  3.0 s] 2/17 (12 %) sphere\n[  7.0 s] report\n"


def test_the_time_left_is_learned_from_finished_items_that_were_not_in_the_store(clock, capsys):
    with Progress() as progress:
        for now, done in [(3.0, 0), (3.1, 3), (10.0, 3), (23.1, 4), (63.1, 6), (663.1, 8), (700.0, 11)]:
            clock[0] = now
            progress.step(done, 11, "case")
    assert capsys.readouterr().err.splitlines() == [
        "[  3.0 s] 0/11 case",
        "[ 10.0 s] 3/11 (27 %) case",
        "[ 23.1 s] 4/11 (36 %, about 2 min left) case",
        "[ 63.1 s] 6/11 (55 %, about 2 min left) case",  # 20 s each
        "[663.1 s] 8/11 (73 %, about 7 min left) case",  # 132 s each
        "[700.0 s] 11/11 case",
    ]


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
    assert all(line.endswith("still busy with: solid") for line in lines)
    time.sleep(0.1)
    assert capsys.readouterr().err == ""
