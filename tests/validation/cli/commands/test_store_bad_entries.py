"""Entries of the result store with a valid hash and bad content: computed again, told in a line, removed by `prune`."""

import hashlib
import io
import json
import os
import zipfile

import numpy as np
import pytest

from fem_reference import result_store
from meshes.bounded_file import pack_npz

NAMES = {"a": np.arange(3.0)}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path / "store"))
    return tmp_path / "store"


def zipped(content, method=zipfile.ZIP_DEFLATED, name="a.npy"):
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", method) as archive:
        archive.writestr(name, content)
    return packed.getvalue()


def pickled():
    content = io.BytesIO()
    np.save(content, np.array([{}], dtype=object), allow_pickle=True)
    return content.getvalue()


def head(shape):
    content = io.BytesIO()
    np.lib.format.write_array_header_1_0(content, {"descr": "<f8", "fortran_order": False, "shape": shape})
    return content.getvalue()


GOOD = pack_npz(NAMES)
MANIFEST = {"kind": "test", "code": "x", "arrays": ["a"]}
BAD_BLOBS = {
    "nothing": b"",
    "no arrays": pack_npz({}),
    "another array": pack_npz({"b": 1.0}),
    "python objects": zipped(pickled()),
    "lzma": zipped(head((1,)) + bytes(8), zipfile.ZIP_LZMA),
    "huge": zipped(head((10**12,))),
    "negative": zipped(head((-1,))),
    "short": zipped(head((3,)) + bytes(8)),
    "long": zipped(head((3,)) + bytes(80)),
}
BAD_MANIFESTS = {
    "nothing": b"",
    "deep": b"[" * 100_000,
    "a list": b"[1]",
    "no key": json.dumps({**MANIFEST, "key": None}).encode(),
    "no arrays": json.dumps({"kind": "test"}).encode(),
    "no text": b"\xff\xfe",
    "a long number": b'{"key": ' + b"9" * 5000 + b"}",
}


def forge(folder, manifest, blob):
    """Write an entry with a valid hash under the key of the kind "test" without inputs."""
    key = result_store.make_key("test", {})
    manifest = json.dumps({"key": key, **manifest}).encode() if isinstance(manifest, dict) else manifest
    body = manifest + b"\n" + blob
    folder.mkdir(exist_ok=True)
    header = f"softcover-entry 1 sha256={hashlib.sha256(body).hexdigest()} bytes={len(body):016d}\n"
    (folder / f"{key}.entry").write_bytes(header.encode() + body)


CASES = [(MANIFEST, blob) for blob in BAD_BLOBS.values()] + [(manifest, GOOD) for manifest in BAD_MANIFESTS.values()]


@pytest.mark.parametrize(("manifest", "blob"), CASES, ids=[*BAD_BLOBS, *(f"manifest {name}" for name in BAD_MANIFESTS)])
def test_bad_content_with_a_valid_hash_is_computed_again(folder, softcover, caplog, manifest, blob):
    forge(folder, manifest, blob)
    status, out, _ = softcover("store", "verify")
    assert status == 1
    assert len(out.splitlines()) == 2
    assert softcover("store", "list")[0] == 0
    np.testing.assert_array_equal(result_store.fetch("test", {}, lambda: NAMES)["a"], NAMES["a"])
    assert len(caplog.records) == 1
    np.testing.assert_array_equal(result_store.fetch("test", {}, dict)["a"], NAMES["a"])
    assert softcover("store", "verify")[0] == 0


@pytest.mark.parametrize(
    "about",
    [
        {"inputs": {"cover": {"layers": 5, "base": 1}}},
        {"inputs": {"cover": {"layers": [{"thickness": "x"}], "base": []}}},
        {"inputs": 5, "kind": [], "code": {}},
        {"created": 1e300},
        {"created": float("nan")},
    ],
)
def test_strange_manifests_are_listed(folder, softcover, about):
    forge(folder, {**MANIFEST, **about}, GOOD)
    for words in (["list"], ["list", "--json"], ["verify"], ["prune", "--dry-run"]):
        assert softcover("store", *words)[0] == 0


def test_a_pipe_in_the_store_is_not_waited_for(folder, softcover):
    folder.mkdir()
    key = result_store.make_key("test", {})
    os.mkfifo(folder / f"{key}.entry")
    assert softcover("store", "list")[0] == 0
    assert softcover("store", "verify")[0] == 1
    np.testing.assert_array_equal(result_store.fetch("test", {}, lambda: NAMES)["a"], NAMES["a"])
