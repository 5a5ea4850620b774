"""Answers about the assumptions that no source confirms."""

import numpy as np
import pytest

from validation.weiss import inquiry
from validation.weiss.inquiry import inquire
from validation.weiss.protocol import Command, Reading, Status
from validation.weiss.sensor import Sensor
from validation.weiss.virtual import Misbehaviour, show_pattern


def test_open_questions_are_answered(plug_in, monkeypatch):
    monkeypatch.setattr("validation.weiss.inquiry._CLOCK_FRAMES", 60)
    with Sensor(plug_in(show_pattern("corner")).name) as sensor:
        answers = inquire(sensor)
    assert answers["loop (0x06)"] == "answers with the bytes it was sent"
    assert "(assumed 1 ms)" in answers["clock"]
    assert "at most 0 counts" in answers["run length"]
    assert "texel 0, read as row 0, column 0" in answers["texel order"]


def test_a_question_that_is_refused_does_not_end_the_others(plug_in, monkeypatch):
    monkeypatch.setattr("validation.weiss.inquiry._CLOCK_FRAMES", 5)
    wrong = Misbehaviour(refused={Command.GET_GAIN: Status.COMMAND_UNKNOWN})
    with Sensor(plug_in(misbehaviour=wrong).name) as sensor:
        answers = inquire(sensor)
    assert "not as assumed" in answers["gain (0x37)"]
    assert "bytes it was sent" in answers["loop (0x06)"]


@pytest.mark.parametrize("tick", [1e-3, 0.5e-3])
def test_the_tick_of_the_clock_is_measured(tick):
    """A stream with exact times of arrival, which no real port has."""

    class ExactStream:
        def stream(self):
            for number in range(1000):
                seconds = number / 250
                counts = np.zeros(84, dtype=np.uint16)
                ticks, host_time = round(seconds / tick), round(seconds * 1e9)
                yield Reading(counts=counts, ticks=ticks, host_time=host_time, run_length=False)

    answer = inquiry._measure_clock(ExactStream())
    assert answer == f"{tick * 1e3:.4f} ms per tick (assumed 1 ms), 250.0 frames/s free-running"
