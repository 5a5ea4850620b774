"""Store finite-element results on disk, each under a key: a hash of the whole input and of the code that computes it.

A stored result is called an entry and is one file, `KEY.entry`.  The file consists of a header line with the sha256 and
the length of all that follows, a line of JSON (the manifest) with kind, inputs and origin of the result, and the arrays
as npz.  An entry is written under a temporary name and renamed when the file is complete.  Every entry is checked
against its sha256 when it is read, and computed again if the check fails.  If two processes compute the same result,
both write the entry and the second file replaces the first.  If the folder cannot be written, results are computed each
time and a warning is logged.

A result is any tree of dataclasses of this project, mappings, lists, arrays and plain values.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import platform
import re
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from importlib import import_module, metadata
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from meshes.atomic_file import replace, sweep, temporary_files
from meshes.bounded_file import FileLimitError, open_regular, pack_npz, parse_json, read_bytes, unpack_npz


@dataclass(frozen=True, kw_only=True)
class StoreSettings:
    """Limits on the files of the store, against damaged and foreign files."""

    #: Largest accepted size of an entry [bytes].
    most_bytes: int = 2**32
    #: Largest accepted size of a manifest [bytes].
    most_manifest_bytes: int = 2**24
    #: Largest accepted number of arrays of an entry; a path in three dimensions has about 36 for each load or depth
    #: [-].
    most_arrays: int = 2**14
    #: Time of writing, in the year 2242, from which on a time in a manifest is not believed [s since 1970].
    latest: float = 2.0**33


_SETTINGS = StoreSettings()


_LOG = logging.getLogger(__name__)

#: Pattern of the header, which is the first line of an entry's file.
_HEADER = re.compile(rb"softcover-entry 1 sha256=([0-9a-f]{64}) bytes=(\d{16})\n")
#: Length of the header [bytes].
_HEADER_LENGTH = len(f"softcover-entry 1 sha256={'0' * 64} bytes={0:016d}\n")
#: Ending of the file name of an entry.
_SUFFIX = ".entry"
#: Libraries whose versions are part of every key, because the results depend on the versions.
_LIBRARIES = ("numpy", "scipy", "scikit-fem")

#: Arrays of a stored result, by name.
Arrays = dict[str, npt.NDArray[Any]]
#: Type of a stored result.
Stored = TypeVar("Stored")


#: Whether `fetch` raises an error instead of computing a result, set by `stored_only`.
_STORED_ONLY: ContextVar[bool] = ContextVar("stored_only", default=False)


class NotStoredError(LookupError):
    """A result is not in the result store, and `stored_only` forbids to compute it."""


class DamagedEntryError(ValueError):
    """The content of a stored file differs from the content that was written."""


@dataclass(frozen=True, kw_only=True)
class Entry:
    """Description of a stored result, read without its arrays.

    Attributes:
        key: Hash of the input and of the code; also the file name without its ending.
        path: File of the entry.
        kind: Kind of the result, a name that the computing function gives, such as "contact".
        code: Hash of the sources that computed the result (`code_version`).
        created: Time at which the entry was written, in seconds since 1970 [s].
        size: Size of the file [bytes].
        inputs: Inputs of the computation, as `describe` writes them.
        problem: Reason why the entry cannot be used; empty if no fault is known.
    """

    key: str
    path: Path
    kind: str
    code: str
    created: float
    size: int
    inputs: Mapping[str, Any]
    problem: str = ""


def folder() -> Path:
    """Return the folder of the result store: `SOFTCOVER_STORE`, or `softcover` in the user's cache folder."""
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


def fetch(kind: str, inputs: Mapping[str, Any], compute: Callable[[], Stored]) -> Stored:
    """Return a result from the store; if it is not stored, compute and store it.

    Args:
        kind: Kind of the result, a name that is part of the key.
        inputs: Everything that the result depends on besides the code: dataclasses, arrays, numbers, strings.
        compute: Function that computes the result, a tree that `pack` accepts.

    Raises:
        TypeError: If an input cannot be part of a key, or the result cannot be stored.
        NotStoredError: If the result is not stored, within `stored_only`.
    """
    _sweep_at_start(folder())
    described = describe(dict(inputs))
    key = make_key(kind, described)
    found = read(key)
    if found is not None:
        try:
            return unpack(found)  # type: ignore[no-any-return]
        except (LookupError, TypeError, ValueError, AttributeError, ImportError) as error:
            _LOG.warning("store entry %s has bad content (%r); it is computed again", _path(key), error)
    if _STORED_ONLY.get():
        raise NotStoredError(kind)
    arrays = pack(compute())
    try:
        if hash_sources() == code_version():
            write(key, arrays, {"kind": kind, "code": code_version(), "inputs": described})
        else:
            _warn_once(folder(), "the sources changed after this process loaded them")
    except OSError as error:
        _warn_once(folder(), error.strerror or str(error))
    return unpack(arrays)  # type: ignore[no-any-return]


@contextmanager
def stored_only() -> Iterator[None]:
    """Let `fetch` raise NotStoredError instead of computing a result, in the `with` block.

    To find out what a computation would cost, run it in this block.
    """
    token = _STORED_ONLY.set(True)
    try:
        yield
    finally:
        _STORED_ONLY.reset(token)


def make_key(kind: str, described: Any) -> str:  # noqa: ANN401 -- JSON
    """Compute the key of a stored result: sha256 of its kind, of the code version and of the inputs from `describe`."""
    text = json.dumps([kind, code_version(), described], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def read(key: str) -> Arrays | None:
    """Read the arrays of the entry with this key; return None if the entry is absent, unreadable or damaged."""
    path = _path(key)
    try:
        return _read_checked(path)[1]
    except (FileNotFoundError, NotADirectoryError):
        return None
    except DamagedEntryError as error:
        _LOG.warning("store entry %s %s; it is computed again", path, error)
    except OSError as error:
        _LOG.warning("store entry %s cannot be read (%s); it is computed again", path, error.strerror)
    return None


def write(key: str, arrays: Mapping[str, Any], about: Mapping[str, Any]) -> None:
    """Write a result to the store; if the process is killed, the file is either complete or absent.

    Args:
        key: Key of the result, from `make_key`.
        arrays: Arrays and numbers of the result by name.
        about: Contents of the manifest besides key, time, Python version and machine.

    Raises:
        OSError: If the folder of the store cannot be written.
        ValueError: If an array holds Python objects.
    """
    blob = pack_npz(arrays)
    surroundings = {"created": time.time(), "python": platform.python_version(), "machine": platform.machine()}
    manifest = json.dumps({"key": key, **about, **surroundings, "arrays": sorted(arrays)}).encode() + b"\n"
    digest = hashlib.sha256(manifest)
    digest.update(blob)
    header = f"softcover-entry 1 sha256={digest.hexdigest()} bytes={len(manifest) + len(blob):016d}\n"
    folder().mkdir(parents=True, exist_ok=True)
    replace(_path(key), (header.encode(), manifest, blob))


def entries(*, checked: bool = False) -> list[Entry]:
    """List all entries of the result store, newest first.

    Args:
        checked: Whether to read each whole entry and check it; `Entry.problem` then describes any fault.  Otherwise
            only manifests are read.

    Raises:
        OSError: If the folder cannot be read, or is no folder.
    """
    place = folder()
    paths = place.iterdir() if place.exists() else ()  # `glob` would show a folder that cannot be read as empty.
    found = (_describe_entry(path, checked=checked) for path in paths if path.suffix == _SUFFIX)
    return sorted((entry for entry in found if entry is not None), key=lambda entry: (-entry.created, entry.key))


def verify() -> list[Entry]:
    """Read and check all entries of the result store and list them, newest first; `problem` describes a fault."""
    return entries(checked=True)


def remove(entry: Entry) -> None:
    """Remove one entry from the result store.

    Raises:
        OSError: If the file cannot be removed.
    """
    entry.path.unlink(missing_ok=True)


def count_partial_files() -> int:
    """Count the temporary files in the result store, left by killed processes or being written at the moment."""
    return len(temporary_files(folder()))


def sweep_leftovers() -> int:
    """Remove the temporary files that killed processes left in the result store, and return their number."""
    return sweep(folder())


@cache
def code_version() -> str:
    """Return the hash of the sources (`hash_sources`) at the first call of this function in the process."""
    return hash_sources()


def hash_sources() -> str:
    """Hash the sources of `meshes` and `fem_reference` and the versions of numpy, scipy and scikit-fem."""
    here = Path(__file__).parent
    digest = hashlib.sha256()
    for source in sorted([*here.rglob("*.py"), *(here.parent / "meshes").rglob("*.py")]):
        digest.update(source.relative_to(here.parent).as_posix().encode())
        digest.update(source.read_bytes())
    for library in _LIBRARIES:
        digest.update(_version(library).encode())
    return digest.hexdigest()[:16]


def hash_file(path: str) -> str:
    """Hash the source file of a function that computes a result outside `fem_reference`, as an input for `fetch`."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()[:16]


def describe(value: Any) -> Any:  # noqa: ANN401 -- any input
    """Convert the inputs of a computation to JSON; equal inputs give equal JSON, different inputs different JSON.

    Raises:
        TypeError: If the type of a value is not a dataclass, array, mapping, sequence, number, string or None.
    """
    if is_dataclass(value) and not isinstance(value, type):
        kind = type(value)
        body = {field.name: describe(getattr(value, field.name)) for field in fields(value)}
        return {"@type": f"{kind.__module__}.{kind.__qualname__}", **body}
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        return {"@array": [str(value.dtype), list(value.shape), hashlib.sha256(value.tobytes()).hexdigest()]}
    if isinstance(value, Mapping) and all(isinstance(name, str) and name[:1] != "@" for name in value):
        return {name: describe(item) for name, item in sorted(value.items())}
    if isinstance(value, list | tuple):
        return [describe(item) for item in value]
    if isinstance(value, np.generic):
        return describe(value.item())
    if value is None or isinstance(value, str | int | float | bool):
        return value
    raise TypeError(f"cannot make a store key from {type(value).__name__}")


def pack(value: Any) -> Arrays:  # noqa: ANN401 -- any tree
    """Convert a result, a tree of dataclasses, mappings, lists, arrays and plain values, to numbered arrays and JSON.

    Raises:
        TypeError: If a part of the tree is of another type.
    """
    arrays: Arrays = {}

    def flatten(item: Any) -> Any:  # noqa: ANN401
        if isinstance(item, np.ndarray):
            name = f"array_{len(arrays)}"
            arrays[name] = item
            return {"array": name}
        if is_dataclass(item) and not isinstance(item, type):
            kind = type(item)
            body = {field.name: flatten(getattr(item, field.name)) for field in fields(item)}
            return {"type": f"{kind.__module__}:{kind.__qualname__}", "fields": body}
        if isinstance(item, Mapping):
            return {"mapping": {name: flatten(each) for name, each in item.items()}}
        if isinstance(item, list | tuple):
            return {type(item).__name__: [flatten(each) for each in item]}
        return item.item() if isinstance(item, np.generic) else item

    tree = json.dumps(flatten(value))
    return {"tree": np.array(tree), **arrays}


def unpack(arrays: Mapping[str, Any]) -> Any:  # noqa: ANN401 -- any tree
    """Rebuild a result, a tree of dataclasses, mappings, lists and arrays, from the arrays into which it was packed."""

    def restore(item: Any) -> Any:  # noqa: ANN401
        if not isinstance(item, dict):
            return item
        (kind, body), *more = item.items()
        if kind == "array":
            return arrays[body]
        if kind == "type":
            module, _, name = body.partition(":")
            if module.partition(".")[0] not in {"fem_reference", "meshes"}:
                raise DamagedEntryError(f"names the foreign type {body}")
            values = {field: restore(each) for field, each in more[0][1].items()}
            return getattr(import_module(module), name)(**values)
        if kind == "mapping":
            return {name: restore(each) for name, each in body.items()}
        return (tuple if kind == "tuple" else list)(restore(each) for each in body)

    return restore(json.loads(str(arrays["tree"])))


def _path(key: str) -> Path:
    """Return the path of the file that holds the stored result with this key."""
    return folder() / f"{key}{_SUFFIX}"


@cache
def _sweep_at_start(place: Path) -> None:
    """Remove the temporary files that killed processes left in a folder, once per process and folder."""
    removed = sweep(place)
    if removed:
        _LOG.info("removed %d unfinished files from %s", removed, place)


@cache
def _warn_once(place: Path, reason: str) -> None:
    """Log that results are not stored, once per process, folder and reason."""
    _LOG.warning("the result store %s is not written (%s): results are not kept", place, reason)


@cache
def _version(library: str) -> str:
    """Return the version of an installed library, or "absent"."""
    try:
        return metadata.version(library)
    except metadata.PackageNotFoundError:
        return "absent"


def _read_checked(path: Path) -> tuple[dict[str, Any], Arrays]:
    """Read the file of an entry, compare it with its header, and return its manifest and arrays.

    Raises:
        DamagedEntryError: If the content differs from the content that was written.
        OSError: If the file cannot be read.
    """
    try:
        content = read_bytes(path, most=_SETTINGS.most_bytes)
    except FileLimitError as error:
        raise DamagedEntryError(str(error)) from None
    header, body = _HEADER.match(content), content[_HEADER_LENGTH:]
    if header is None:
        raise DamagedEntryError("does not begin like an entry of this version")
    if len(body) != int(header[2]):
        raise DamagedEntryError(f"has {len(body)} of {int(header[2])} bytes")
    if hashlib.sha256(body).hexdigest() != header[1].decode():
        raise DamagedEntryError("fails its sha256")
    text, _, blob = body.partition(b"\n")
    try:
        manifest, arrays = (
            parse_json(text),
            unpack_npz(blob, most=_SETTINGS.most_bytes, most_arrays=_SETTINGS.most_arrays),
        )
    except FileLimitError as error:
        raise DamagedEntryError(f"has bad content: {error}") from None
    if not isinstance(manifest, dict) or manifest.get("arrays") != sorted(arrays):
        raise DamagedEntryError("has bad content: its manifest does not list its arrays")
    if manifest.get("key") != path.stem:
        raise DamagedEntryError(f"is a copy of the entry {str(manifest.get('key'))[:64]}")
    return manifest, arrays


def _describe_entry(path: Path, *, checked: bool) -> Entry | None:
    """Describe an entry from its header and manifest; return None if another process has removed the file."""
    manifest: Any = {}
    problem = ""
    try:
        with open_regular(path) as file:
            if _HEADER.fullmatch(file.readline(_HEADER_LENGTH)):
                manifest = parse_json(file.readline(_SETTINGS.most_manifest_bytes))
            else:
                problem = "does not begin like an entry of this version"
    except OSError as error:
        problem = f"cannot be read: {error.strerror}"
    except FileLimitError:
        problem = "has an unreadable manifest"
    try:
        if checked and not problem:
            _read_checked(path)
    except (DamagedEntryError, OSError) as error:
        problem = str(error)
    try:
        status = path.stat()
    except OSError:
        return None
    manifest = manifest if isinstance(manifest, dict) else {}
    created, inputs = manifest.get("created"), manifest.get("inputs")
    return Entry(
        key=path.stem,
        path=path,
        kind=str(manifest.get("kind", "unknown")),
        code=str(manifest.get("code", "unknown")),
        created=created if isinstance(created, float) and 0 <= created < _SETTINGS.latest else status.st_mtime,
        size=status.st_size,
        inputs=inputs if isinstance(inputs, dict) else {},
        problem=problem,
    )
