"""Run designs of a sweep on a cluster of dask.distributed, on this machine or elsewhere."""

from __future__ import annotations

import contextlib
import logging
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from distributed import Client, KilledWorker, LocalCluster, WorkerPlugin, as_completed

from fem_reference import result_store
from validation.errors import InputError
from validation.sweep.run import Task, compute, find_key, list_versions

#: Longest wait for the answer of a cluster [s].
_PATIENCE = 10


class Guard(WorkerPlugin):
    """Lets a worker compute only if its versions are those of the client and it sees the client's store.

    Args:
        versions: Versions of the client.
        store: Folder of the client's store.
        token: Key of an entry in it.
        resource: Name of the resource that the worker then has, and that every design needs.
    """

    def __init__(self, versions: Mapping[str, str], store: str, token: str, resource: str) -> None:
        self.versions, self.store, self.token, self.resource = versions, store, token, resource

    async def setup(self, worker: Any) -> None:  # noqa: ANN401 -- a worker of dask
        """Check the worker.

        Raises:
            InputError: If it is refused.
        """
        here = list_versions()
        other = [
            f"{name} {here.get(name)} instead of {each}"
            for name, each in self.versions.items()
            if here.get(name) != each
        ]
        if other:
            raise InputError(
                f"worker {worker.address} is refused: {', '.join(other)}; start it in the environment of the client"
            )
        os.environ["SOFTCOVER_STORE"] = self.store
        if result_store.read(self.token) is None:
            raise InputError(
                f"worker {worker.address} is refused: it does not see the store {self.store}; set SOFTCOVER_STORE to a "
                "folder that all machines share"
            )
        await worker.set_resources(**{self.resource: 1})


@contextlib.contextmanager
def _connect(workers: int | None, address: str | None) -> Iterator[Any]:
    """Connect to a cluster by address or scheduler file, or start one of some workers on this machine."""
    with contextlib.ExitStack() as stack:
        if address is None:
            options = {"n_workers": workers, "threads_per_worker": 1, "processes": True, "dashboard_address": None}
            where: dict[str, Any] = {
                "address": stack.enter_context(LocalCluster(**options, silence_logs=logging.CRITICAL))
            }
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
    resource = f"softcover-{token[:12]}"
    lost: dict[int, str] = {}
    with _connect(workers, address) as client:
        store = str(result_store.folder().absolute())
        client.register_plugin(Guard(list_versions(), store, token, resource), name=resource)
        futures = {
            client.submit(compute, *task, key=find_key(task[0], task[1][0]), resources={resource: 1}): number
            for number, task in tasks.items()
        }
        for future in as_completed(futures):
            number = futures[future]
            if future.status == "finished":
                told(number)
                continue
            error = future.exception() if future.status == "error" else None
            words = "the cluster was lost" if error is None else f"{type(error).__name__}: {error}"
            lost[number] = (
                "its worker was killed again and again (memory, time)" if isinstance(error, KilledWorker) else words
            )
    return lost
