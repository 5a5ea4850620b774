"""Files that are whole at every moment, and npz bytes that depend on nothing but their content."""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import tempfile
import time
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

#: Age at which a temporary file is litter [s].
_STALE = 60.0


def pack(tables: Mapping[str, npt.NDArray[Any]]) -> bytes:
    """The tables as npz whose bytes depend on nothing but the tables."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, table in sorted(tables.items()):
            entry = io.BytesIO()
            np.lib.format.write_array(entry, np.ascontiguousarray(table), allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), entry.getvalue(), compress_type=zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def replace_pair(tables: Path, packed: bytes, document: Path, text: bytes) -> None:
    """Replace tables and the document that names their hash so that a reader finds a pair at every moment.

    Between the two renames the old document stands beside the new tables; a copy of the old tables at `kept_path`
    serves readers meanwhile.

    Args:
        tables: Where the tables go.
        packed: Their bytes.
        document: Where the document goes, in the same folder.
        text: Its bytes.

    Raises:
        OSError: If the folder cannot be written; the old pair is still there then.
    """
    staged: list[Path] = []
    try:
        staged.extend(_stage(path, content) for path, content in ((tables, packed), (document, text)))
        if tables.exists() and (old := tables.read_bytes()) != packed:
            kept = kept_path(tables, hashlib.sha256(old).hexdigest())
            staged.append(_stage(kept, old))
            staged[2].replace(kept)
        staged[0].replace(tables)
        staged[1].replace(document)
    finally:
        for path in staged:
            path.unlink(missing_ok=True)
    _sweep(tables)


def kept_path(tables: Path, sha256: str) -> Path:
    """Where tables that are being replaced stay until their document is replaced too."""
    return tables.with_name(f"{tables.stem}.{sha256[:16]}{tables.suffix}")


def _stage(path: Path, content: bytes) -> Path:
    """The content in a temporary file beside its place, on the disk."""
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        Path(temporary).chmod(0o644)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    return Path(temporary)


def _sweep(tables: Path) -> None:
    """Remove what a killed save left: kept tables at once, temporary files when nobody can be writing them."""
    for kept in tables.parent.glob(f"{tables.stem}.????????????????{tables.suffix}"):
        kept.unlink(missing_ok=True)
    for temporary in tables.parent.glob(".*.part"):
        with contextlib.suppress(FileNotFoundError):
            if time.time() - temporary.stat().st_mtime > _STALE:
                temporary.unlink()
