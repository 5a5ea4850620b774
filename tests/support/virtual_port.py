"""A virtual sensor on a pseudo-terminal, for tests of the driver, the recorder and the commands."""

import threading
import time
from contextlib import contextmanager

import numpy as np

from validation.weiss.stream import Gap
from validation.weiss.virtual import FAULTS, PseudoTerminal, VirtualSensor, serve, show_pattern

#: A device leaves out frames that wait for 0.2 s.  On a busy machine tests would lose some by chance: let 1 MiB wait.
_BACKLOG_BYTES = 2**20


class VirtualPort:
    """A virtual sensor that runs on a pseudo-terminal from its creation until it is unplugged."""

    def __init__(self, source=None, *, link=None, backlog_bytes=_BACKLOG_BYTES, **options):
        self.sensor = VirtualSensor(source or show_pattern("ramp"), **options)
        self.left_out = None
        self._end = PseudoTerminal(link)
        self.name = self._end.name
        self._stop = threading.Event()
        self._backlog_bytes = backlog_bytes
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self):
        self.left_out = serve(self.sensor, self._end, stop=self._stop, backlog_bytes=self._backlog_bytes)

    def unplug(self):
        self._stop.set()
        self._thread.join()
        self._end.close()


@contextmanager
def answer_always(data):
    """Name of a pseudo-terminal on which another device than a sensor sends the same bytes again and again."""
    end, stop = PseudoTerminal(), threading.Event()

    def run():
        while not stop.is_set():
            end.receive(0.01)
            end.send(data)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield end.name
    finally:
        stop.set()
        thread.join()
        end.close()


def wait_until(condition, seconds=60.0):
    """Wait for an event of another thread; a test that waits in vain fails."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "the awaited event did not happen"
        time.sleep(0.002)


def take(sensor, frames, **options):
    """That many readings of a stream, and the gaps among them."""
    readings, gaps = [], []
    stream = sensor.stream(**options)
    for event in stream:
        (gaps if isinstance(event, Gap) else readings).append(event)
        if len(readings) == frames:
            break
    stream.close()
    return readings, gaps


def is_ramp(counts):
    """Whether texels differ by 40 counts from one to the next, modulo 4096, as in the pattern `ramp`."""
    return bool((np.diff(np.asarray(counts).astype(int)) % 4096 == 40).all())


def hit(fault, message, random):
    """A message as it arrives after a fault of the line."""
    return FAULTS[fault](message, random.randrange(len(message)), random) if message else message
