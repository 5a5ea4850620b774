"""Run a sweep: compute what the result store lacks, in this process or on a cluster of dask.distributed.

The store is the only state.  Workers write to it, and futures carry keys only, so that a sweep goes on after any kill.
A refusal and a missing convergence are results and are stored with their words; a killed worker, lost memory and a full
disk are none, and the next run tries again.
"""

from __future__ import annotations

import hashlib
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from fem_reference import result_store
from fem_reference.errors import ConvergenceError
from validation.errors import InputError
from validation.regression.baseline import PACKAGES
from validation.sensor_file import SensorDescription
from validation.sweeps.measurements import Measurement, Quantity, Subject

#: Results of the measurements of one design by their number; one without words did not fail.
Found = dict[str, Any]
#: A design and what to measure of it.
Task = tuple[SensorDescription, Sequence[Measurement]]


@cache
def list_versions() -> dict[str, str]:
    """Return what results depend on besides their inputs: versions of packages, and hashes of the sources."""
    root, digest = Path(__file__).parents[2], hashlib.sha256()
    for path in sorted([*root.glob("fastmodel/**/*.py"), *root.glob("validation/**/*.py")]):
        digest.update(path.read_bytes())
    sources = {"solver": result_store.code_version(), "sources": digest.hexdigest()[:16]}
    return {"python": platform.python_version(), **{name: version(name) for name in PACKAGES}, **sources}


def find_key(sensor: SensorDescription, measurement: Measurement) -> str:
    """Return the key of the result of a measurement in the store."""
    same = replace(sensor, source="", sources={})  # Where the sensor is described does not matter.
    inputs = {"sensor": same, "command": measurement.command, "options": measurement.options}
    return result_store.make_key("sweep", result_store.describe({**inputs, "versions": list_versions()}))


def read_result(key: str) -> Found | None:
    """Read a result from the store; None if it is not there."""
    arrays = result_store.read(key)
    if arrays is None:
        return None
    found: Found = result_store.unpack(arrays)
    return found | {"quantities": {name: Quantity(*each) for name, each in found["quantities"].items()}}


def compute(sensor: SensorDescription, measurements: Sequence[Measurement]) -> None:
    """Compute measurements of a design and write them to the store, unless they are there.

    Raises:
        OSError: If the store cannot be written.
    """
    subject = Subject(sensor=sensor)
    for measurement in measurements:
        key = find_key(sensor, measurement)
        if result_store.read(key) is not None:
            continue
        started = time.process_time()
        quantities, words = {}, ""
        try:
            quantities = measurement.run(subject)
        except (ValueError, ConvergenceError) as error:
            kind = "did not converge: " * isinstance(error, ConvergenceError)
            words = f"{measurement.command}: {kind}{' '.join(str(error).split())}"
        seconds = time.process_time() - started
        result = {"words": words, "seconds": seconds, "quantities": {name: list(q) for name, q in quantities.items()}}
        about = {"kind": "sweep", "code": result_store.code_version(), "inputs": {"sensor": sensor.name}}
        result_store.write(key, result_store.pack(result), about)


def run_here(tasks: Mapping[int, Task], told: Callable[[int], None]) -> None:
    """Compute designs in this process; `told` is called with the number of each that is finished."""
    for number, task in tasks.items():
        compute(*task)
        told(number)


def check_store() -> None:
    """Check that the store can be written, before a long computation.

    Raises:
        InputError: If it cannot.
    """
    from validation.output_folder import check_writable

    try:
        check_writable(result_store.folder() / "entry")
    except OSError as error:
        raise InputError(
            f"SOFTCOVER_STORE: {result_store.folder()} {error.strerror}; it keeps the results; name a folder "
            "that can be written"
        ) from None
