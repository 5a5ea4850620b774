"""Run designs of a sweep on a cluster of dask.distributed, on this machine or elsewhere."""

from __future__ import annotations

import contextlib
import logging
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import dask
from distributed import Client, KilledWorker, LocalCluster, WorkerPlugin, as_completed

from fem_reference import result_store
from validation.errors import InputError
from validation.sweeps.run import Task, compute, find_key, list_versions

#: Longest wait for the answer of a cluster [s].
_PATIENCE = 10
#: Name of the plugin of the workers.
_NAME = "softcover-sweep"


def check_worker(versions: Mapping[str, str], store: str, token: str) -> str:
    """Return why a worker, in which this runs, cannot compute; empty if it can, and then uses the store of the client.

    Args:
        versions: Versions of the client.
        store: Folder of the client's store.
        token: Key of an entry in it.
    """
    here = list_versions()
    if other := [
        f"{name} {here.get(name)} instead of {one}" for name, one in versions.items() if here.get(name) != one
    ]:
        return f"{', '.join(other)}; start it in the environment of the client"
    os.environ["SOFTCOVER_STORE"] = store
    if result_store.read(token) is None:
        return f"it does not see the store {store}; set SOFTCOVER_STORE to a folder that all machines share"
    return ""


class Guard(WorkerPlugin):
    """Ends workers that join late and cannot compute, with one line in their log.

    Args:
        *client: Arguments of `check_worker`.
    """

    def __init__(self, *client: Any) -> None:  # noqa: ANN401 -- as `check_worker`
        self.client = client

    def setup(self, worker: Any) -> None:  # noqa: ANN401 -- a worker of dask
        """Check the worker."""
        if fault := check_worker(*self.client):
            logging.getLogger("distributed.worker").error("worker %s is refused: %s", worker.address, fault)
            worker.loop.add_callback(worker.close, reason="refused")


@contextlib.contextmanager
def _connect(workers: int | None, address: str | None) -> Iterator[Any]:
    """Connect to a cluster by address or scheduler file, or start one of some workers on this machine."""
    with contextlib.ExitStack() as stack:
        if address is None:
            # A worker holds no design but the one that it computes, so that its end costs no other.
            stack.enter_context(dask.config.set({"distributed.scheduler.worker-saturation": 1.0}))
            options = {"n_workers": workers, "threads_per_worker": 1, "processes": True, "dashboard_address": None}
            where: dict[str, Any] = {"address": stack.enter_context(LocalCluster(**options))}
        else:
            where = {"scheduler_file" if Path(address).is_file() else "address": address}
            if "address" in where and ":" not in address:
                raise InputError(f"--cluster: {address} is no address and no file; write for example tcp://node1:8786")
        try:
            client = stack.enter_context(Client(**where, timeout=_PATIENCE, set_as_default=False))
        except (OSError, ValueError) as error:
            raise InputError(
                f"--cluster: {address} does not answer within {_PATIENCE} s ({type(error).__name__}); name the address "
                "or the file of a running scheduler, as `dask scheduler` prints it"
            ) from None
        yield client


def run_there(
    tasks: Mapping[int, Task], told: Callable[[int], None], *, workers: int | None, address: str | None
) -> dict[int, str]:
    """Compute designs on a cluster.

    Args:
        tasks: Arguments of `compute` by number of the design.
        told: Called with the number of each design that is finished.
        workers: Number of workers to start on this machine; None with an address.
        address: Address or scheduler file of a running cluster.

    Returns:
        Why designs were lost, by their number.

    Raises:
        InputError: If the cluster does not answer, or a worker is refused.
    """
    token = result_store.make_key("sweep token", list_versions())
    about = {"kind": "sweep token", "code": result_store.code_version(), "inputs": {}}
    result_store.write(token, result_store.pack(list_versions()), about)
    lost: dict[int, str] = {}
    with _connect(workers, address) as client, contextlib.ExitStack() as at_end:
        check = list_versions(), str(result_store.folder().absolute()), token
        for worker, fault in client.run(check_worker, *check).items():
            if fault:
                raise InputError(f"--cluster: worker {worker} is refused: {fault}")
        client.register_plugin(Guard(*check), name=_NAME)
        at_end.callback(_forget, client)
        futures = {client.submit(compute, *task, key=find_key(task[0], task[1][0])): row for row, task in tasks.items()}
        for future in as_completed(futures, loop=client.loop):
            number = futures[future]
            if future.status == "finished":
                told(number)
                continue
            error = future.exception() if future.status == "error" else None
            words = "the cluster was lost" if error is None else f"{type(error).__name__}: {error}"
            killed = isinstance(error, KilledWorker)
            lost[number] = "its worker was killed again and again (memory, time)" if killed else words
    return lost


def _forget(client: Any) -> None:  # noqa: ANN401 -- a client of dask
    with contextlib.suppress(Exception):  # The scheduler may be gone.
        client.unregister_worker_plugin(_NAME)
