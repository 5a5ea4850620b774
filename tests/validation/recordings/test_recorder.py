"""A recorder with a sensor that answers at once: what is asked, counted, kept and said, without a port."""

import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from validation.recordings import capture, mcap_reader
from validation.recordings.mcap_writer import StorageError
from validation.recordings.recording import Setup
from validation.weiss.protocol import MatrixInfo, Reading
from validation.weiss.sensor import Chunk, LinkLostError, NoAnswerError
from validation.weiss.stream import Gap


class FakeSensor:
    """A sensor that answers at once and sends events with times of its own."""

    port, tap = "/dev/fake", None

    def __init__(self, events, error=None):
        self.events, self.error, self.asked, self.closed = events, error, {}, False

    def read_info(self):
        return SimpleNamespace(serial_number=77, firmware="1.2")

    def read_matrix(self):
        return MatrixInfo(columns=3, rows=2, cell_width=4e-3, cell_height=3e-3, full_scale=1000)

    def read_mask(self):
        return np.array([True] * 5 + [False])

    def read_type(self):
        return "pad"

    def read_tag(self):
        raise NoAnswerError("no tag")

    def read_threshold(self):
        return 9

    def read_gain(self):
        return 0.5

    def read_temperature(self):
        return 31.5

    def take_last_gaps(self):
        return [Gap(kind="silence", host_time=self.events[-1].host_time, after=5)] if self.events else []

    def stream(self, **options):
        self.asked = options
        try:
            for event in self.events:
                self.tap(Chunk(event.host_time, b"ab", None))
                yield event
            if self.error:
                raise self.error
        finally:
            self.closed = True


def make_events(*seconds, start=10**12):
    counts = np.arange(6, dtype=np.uint16)
    return [
        Reading(counts=counts + number, ticks=round(1000 * each), host_time=start + round(each * 1e9))
        for number, each in enumerate(seconds)
    ]


def test_a_recorder_counts_frames_gaps_and_the_time_between_them(tmp_path):
    seen = []
    events = make_events(0.0, 0.25, 1.0)
    sensor = FakeSensor([*events[:2], Gap(kind="silence", host_time=events[1].host_time + 1, after=1), events[2]])
    setup = Setup(load=2.0, device={"gain": 0.75})
    done = capture.record(sensor, tmp_path / "a.mcap", setup=setup, run_length=True, interval_ms=4, reconnect=3.0,
                          on_event=seen.append)  # fmt: skip
    assert sensor.asked == {"run_length": True, "interval_ms": 4, "reconnect": 3.0}
    assert (done.frames, done.gaps, done.seconds, done.ended) == (3, 2, 1.0, "done")
    assert (done.rate, done.unknown) == (2.0, ("tag",))
    assert (len(seen), sensor.tap, sensor.closed) == (5, None, True)
    assert np.isnan(replace(done, frames=1).rate)
    assert np.isnan(replace(done, seconds=0.0).rate)
    back = mcap_reader.read(tmp_path / "a.mcap")
    assert back.setup.device == {"serial": 77, "firmware": "1.2", "type": "pad", "threshold": 9, "gain": 0.75,
                                 "temperature": 31.5}  # fmt: skip
    assert (back.setup.source, back.setup.load, back.serial) == ("/dev/fake", 2.0, "77")
    texels = back.arrays[0].texels
    assert (texels.rows, texels.columns, texels.pitch, texels.name) == (2, 3, (4e-3, 3e-3), "pad")
    assert texels.active.tolist() == [True] * 5 + [False]
    assert (back.arrays[0].full_scale, back.host_monotonic.tolist()) == (1000, [each.host_time for each in events])
    assert back.temperatures.tolist() == [[31.5], [31.5]]
    assert len(back.gaps) == 2


@pytest.mark.parametrize(("seconds", "frames"), [(0.0, 1), (1e3, 3)])
def test_a_recorder_stops_with_the_first_frame_after_its_time(tmp_path, seconds, frames):
    sensor = FakeSensor(make_events(0.0, 1.0, 2.0, start=time.monotonic_ns() + 10**9))
    done = capture.record(sensor, tmp_path / "a.mcap", seconds=seconds)
    assert (done.frames, done.ended) == (frames, "done")


@pytest.mark.parametrize(
    ("events", "error", "kind", "message"),
    [
        (2, LinkLostError("unplugged"), capture.RecordingStoppedError, "unplugged; 2 frames are kept in"),
        (2, StorageError("disk full"), StorageError, "disk full; 2 frames had come"),
        (0, StorageError("disk full"), StorageError, "disk full"),
        (2, KeyboardInterrupt(), None, ""),
    ],
)
def test_a_recorder_that_is_stopped_says_what_it_kept(tmp_path, events, error, kind, message):
    sensor = FakeSensor(make_events(0.0, 1.0)[:events], error)
    if kind is None:
        assert capture.record(sensor, tmp_path / "a.mcap").ended == "interrupted"
        return
    with pytest.raises(kind) as caught:
        capture.record(sensor, tmp_path / "a.mcap")
    assert str(caught.value).startswith(message)
    assert ("had come" in str(caught.value)) == ("had come" in message)
