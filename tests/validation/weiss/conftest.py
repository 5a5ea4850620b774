"""A virtual sensor on a real pseudo-terminal."""

import threading
from contextlib import contextmanager

import pytest

pytest.importorskip("pty", reason="pseudo-terminals need Linux or macOS")

from validation.weiss.serve import PseudoTerminal, serve
from validation.weiss.virtual import VirtualSensor, pattern

#: A device leaves out frames that nobody reads for 0.2 s; on a busy machine tests would lose some by chance.
_BACKLOG = 2**20


class Bench:
    """A running virtual sensor."""

    def __init__(self, sensor, link=None, backlog=_BACKLOG):
        self.sensor = sensor
        self.end = PseudoTerminal(link)
        self.port = self.end.name
        self._stop = threading.Event()
        self._backlog = backlog
        self.left_out = None
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self):
        self.left_out = serve(self.sensor, self.end, stop=self._stop, backlog_bytes=self._backlog)

    def unplug(self):
        self._stop.set()
        self._thread.join()
        self.end.close()


@pytest.fixture
def plug_in(monkeypatch):
    """Put virtual sensors on ports; they are unplugged at the end of the test."""
    # so that closing a port takes a moment only
    monkeypatch.setattr("validation.weiss.link._PATIENCE", 0.01)
    benches = []

    def start(source=None, *, link=None, backlog=_BACKLOG, **options):
        benches.append(Bench(VirtualSensor(source or pattern("ramp"), **options), link, backlog))
        return benches[-1]

    yield start
    for bench in benches:
        bench.unplug()


@pytest.fixture
def answering():
    """A pseudo-terminal on which something else than a sensor answers."""

    @contextmanager
    def start(says):
        end, stop = PseudoTerminal(), threading.Event()

        def run():
            while not stop.is_set():
                end.receive(0.01)
                end.send(says)

        thread = threading.Thread(target=run)
        thread.start()
        try:
            yield end.name
        finally:
            stop.set()
            thread.join()
            end.close()

    return start
