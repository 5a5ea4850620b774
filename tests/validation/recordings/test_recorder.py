"""A recorder with a sensor that answers at once: what is asked, counted, kept and said, without a port."""

import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.support.mcap_bytes import encode_cdr, encode_header, take_apart
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


def test_a_file_holds_when_each_frame_was_taken_and_came(tmp_path):
    """The clock of the host runs on from the time at which the recorder begins; the ticks of the device are 1 ms."""
    events = make_events(0.0, 0.25, 1.0)
    events.insert(2, Gap(kind="silence", host_time=events[1].host_time + 3, after=1, frames=2))
    sensor = FakeSensor(events)
    before = time.time_ns() - time.monotonic_ns()
    done = capture.record(sensor, str(tmp_path / "a.mcap"), setup=Setup(source="mine"))
    after = time.time_ns() - time.monotonic_ns()
    messages = take_apart((tmp_path / "a.mcap").read_bytes()).messages
    frames = [each for each in messages if each[0] == "/tactile/frame"]
    (shift,) = {each[2] - event.host_time for each, event in zip(frames, [*events[:2], events[3]], strict=True)}
    assert min(before, after) - 5 * 10**7 <= shift <= max(before, after) + 5 * 10**7  # two clocks, read one by one
    assert [each[1] for each in frames] == [0, 1, 2]
    assert [each[3] for each in frames] == [event.host_time + shift for event in (*events[:2], events[3])]
    assert [each[2:] for each in messages if each[0] == "/raw"] == [
        (event.host_time + shift,) * 2 + (encode_cdr(("I", 0), ("I", 0), ("B*", b"ab")),) for event in events
    ]
    gaps = [each for each in messages if each[0] == "/diagnostics"]
    texts = ["silence, after tick 1, 2 frames", "silence, after tick 5"]
    times = [events[2].host_time + shift, events[3].host_time + shift]
    assert [each[2:] for each in gaps] == [
        (at, at, encode_cdr(*encode_header(*divmod(at, 10**9), "gap"), ("I", 1), ("B", 1), ("s", "gap"), ("s", text),
                            ("s", ""), ("I", 0)))
        for at, text in zip(times, texts, strict=True)
    ]  # fmt: skip
    warm = [each[2] for each in messages if each[0] == "/temperatures"]
    assert len(warm) == 2
    assert abs(warm[1] - time.time_ns()) < 60 * 10**9
    assert (done.path, done.gaps, done.frames) == (tmp_path / "a.mcap", 2, 3)
    assert (done.residual.median, done.residual.unfitted) == (0.0, 0)
    back = mcap_reader.read(tmp_path / "a.mcap")
    assert (back.setup.source, back.ticks.tolist()) == ("mine", [0, 250, 1000])
    assert [each.tolist() for each in back.arrays[0].counts] == [[0, 1, 2, 3, 4, 5], [1, 2, 3, 4, 5, 6],
                                                                 [2, 3, 4, 5, 6, 7]]  # fmt: skip


def test_what_a_sensor_does_not_answer_is_told_and_left_out(tmp_path):
    class Silent(FakeSensor):
        def read_mask(self):
            raise NoAnswerError("no mask")

        read_type = read_temperature = read_gain = read_tag = read_mask

    done = capture.record(Silent(make_events(0.0)), tmp_path / "a.mcap")
    assert done.unknown == ("type", "tag", "gain", "temperature", "mask", "temperature before the frames",
                            "temperature after the frames")  # fmt: skip
    assert (done.frames, done.seconds) == (1, 0.0)
    back = mcap_reader.read(tmp_path / "a.mcap")
    assert back.setup.device == {"serial": 77, "firmware": "1.2", "threshold": 9}
    assert (back.arrays[0].texels.name, back.arrays[0].texels.active.all()) == ("tactile", True)
    assert (back.temperatures.shape, back.setup.load, back.setup.note) == ((0, 0), None, "")


def test_options_that_are_not_given_ask_for_plain_frames_at_the_highest_rate(tmp_path):
    sensor = FakeSensor(make_events(0.0))
    capture.record(sensor, tmp_path / "a.mcap")
    assert sensor.asked == {"run_length": False, "interval_ms": 0, "reconnect": 0.0}
    made = capture.make_device_array(sensor.read_matrix())
    assert (made.texels.name, made.texels.active.all(), made.full_scale) == ("tactile", True, 1000)


@pytest.mark.parametrize(
    ("frames", "seconds", "rate"), [(2, 0.5, 2.0), (1, 0.5, np.nan), (2, 0.0, np.nan), (0, 1.0, np.nan), (9, 2.0, 4.0)]
)
def test_the_rate_is_that_of_the_steps(tmp_path, frames, seconds, rate):
    done = replace(capture.record(FakeSensor(make_events(0.0)), tmp_path / "a.mcap"), frames=frames, seconds=seconds)
    assert done.rate == pytest.approx(rate, nan_ok=True)
