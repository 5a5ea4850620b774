"""Results kept by content: the key is a hash of the whole input and of the code that computes.

An entry is two files, `KEY.npz` with the arrays and `KEY.json` with what they are and the sha256 of the first.  Both
are written under a temporary name, flushed to the disk and renamed, the arrays first, so that an entry whose JSON
exists is whole.  An entry that fails its hash when read is computed again.  The store is a convenience: where it cannot
be written, results are computed and a warning is logged.
"""

from __future__ import annotations

import hashlib
import io
import json
import logging
import os
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

_LOG = logging.getLogger(__name__)


def folder() -> Path:
    """Where entries lie: `SOFTCOVER_STORE`, or `softcover` in the user's cache folder."""
    named = os.environ.get("SOFTCOVER_STORE")
    if named:
        return Path(named)
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    return base / "softcover"


def fetch(kind: str, inputs: Mapping[str, Any], compute: Callable[[], Mapping[str, Any]]) -> dict[str, Any]:
    """Return the stored result of `compute`, or compute and store it.

    Args:
        kind: What is computed; part of the key.
        inputs: Everything the result depends on besides the code: dataclasses, arrays, numbers, strings.
        compute: Makes the result: arrays and numbers by name.
    """
    described = describe(dict(inputs))
    text = json.dumps([kind, code_version(), described], sort_keys=True)
    key = hashlib.sha256(text.encode()).hexdigest()
    found = read(key)
    if found is not None:
        return found
    result = {name: np.asarray(value) for name, value in compute().items()}
    try:
        write(key, result, {"kind": kind, "code": code_version(), "inputs": described})
    except OSError as error:
        _LOG.warning("the result store %s cannot be written (%s); results are not kept", folder(), error.strerror)
    return result


def read(key: str) -> dict[str, Any] | None:
    """The arrays of an entry; None where there is none or it fails its hash."""
    try:
        manifest = json.loads((folder() / f"{key}.json").read_text())
        blob = (folder() / f"{key}.npz").read_bytes()
    except (OSError, ValueError):
        return None
    if hashlib.sha256(blob).hexdigest() != manifest.get("sha256"):
        _LOG.warning("store entry %s is damaged and is computed again", key[:12])
        return None
    with np.load(io.BytesIO(blob), allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}


def write(key: str, arrays: Mapping[str, Any], about: Mapping[str, Any]) -> None:
    """Write an entry so that it is either whole or absent.

    Raises:
        OSError: If the folder cannot be written.
    """
    folder().mkdir(parents=True, exist_ok=True)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    blob = buffer.getvalue()
    manifest = {**about, "sha256": hashlib.sha256(blob).hexdigest(), "bytes": len(blob)}
    replace(folder() / f"{key}.npz", blob)
    replace(folder() / f"{key}.json", json.dumps(manifest, indent=1).encode())


def replace(path: Path, content: bytes) -> None:
    """Write a file under a temporary name, flush it and rename it into place."""
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=".partial-")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


@cache
def code_version() -> str:
    """Hash of the sources of `meshes` and `fem_reference`: a changed line makes new keys."""
    here = Path(__file__).parent
    digest = hashlib.sha256()
    for source in sorted([*here.rglob("*.py"), *(here.parent / "meshes").rglob("*.py")]):
        digest.update(source.name.encode())
        digest.update(source.read_bytes())
    digest.update(np.__version__.encode())
    return digest.hexdigest()[:16]


def describe(value: Any) -> Any:  # noqa: ANN401 -- any input
    """Turn inputs into JSON in which equal inputs are equal and different ones differ."""
    if is_dataclass(value) and not isinstance(value, type):
        body = {field.name: describe(getattr(value, field.name)) for field in fields(value)}
        return {"type": type(value).__name__, **body}
    if isinstance(value, np.ndarray):
        blob = np.ascontiguousarray(value)
        return [str(blob.dtype), list(blob.shape), hashlib.sha256(blob.tobytes()).hexdigest()]
    if isinstance(value, Mapping):
        return {str(name): describe(item) for name, item in sorted(value.items())}
    if isinstance(value, list | tuple):
        return [describe(item) for item in value]
    if isinstance(value, np.generic):
        return value.item()
    if value is None or isinstance(value, str | int | float | bool):
        return value
    raise TypeError(f"cannot make a store key from {type(value).__name__}")
