"""Bounds on what refusing a hostile input may cost, whatever the machine and its load."""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def bounded(work: int, memory: float | None = None) -> Iterator[None]:
    """Fail if a block costs more than `work` units of processor time, or more than `memory` [B] if that is given.

    A unit is 20 ms, or the time of a fixed loop after the block if that is longer, as it is on a busy machine.
    """
    if memory is not None:
        tracemalloc.start()  # it slows the block down several times
    before = time.process_time()
    try:
        yield
        spent, peak = time.process_time() - before, tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert spent < work * 20e-3 or spent < work * _measure_unit()
    assert memory is None or peak < memory


def _measure_unit() -> float:
    before = time.process_time()
    sum(len(str(step)) for step in range(150_000))
    return time.process_time() - before
