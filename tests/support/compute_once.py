"""Results that take long and that all test processes of a run share."""

import os
import pickle
from pathlib import Path

from meshes.atomic_file import hold_lock


def compute_once(name, compute):
    """Compute a result in one test process; the others wait for it and read what it wrote."""
    folder = Path(os.environ["SOFTCOVER_STORE"]).parent
    file = folder / f"{name}.pickle"
    with hold_lock(folder / f"{name}.lock"):
        if file.exists():
            return pickle.loads(file.read_bytes())  # noqa: S301 -- this run wrote it
        found = compute()
        part = folder / f"{name}.{os.getpid()}"
        part.write_bytes(pickle.dumps(found))
        part.replace(file)
        return found
