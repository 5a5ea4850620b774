"""Parameter folders of strangers: limits before memory is claimed, and one line about every fault."""

import hashlib
import io
import os
import re
import zipfile

import numpy as np
import pytest

from fastmodel.errors import ParametersError
from fastmodel.parameters import load
from meshes.bounded_file import pack_npz
from tests.support.bounded import bounded


@pytest.fixture
def given(tmp_path):
    """Save a good folder, put other bytes into its npz file, with the right hash, and change its TOML text."""
    saved = load("wts-0614-34").save(tmp_path / "given").parent

    def change(old="", new="", packed=None):
        toml = saved / "parameters.toml"
        text = re.sub(old, new, toml.read_text(), count=1)
        if packed is not None:
            (saved / "cover.npz").write_bytes(packed)
            text = re.sub(r'sha256 = ".*"', f'sha256 = "{hashlib.sha256(packed).hexdigest()}"', text)
        toml.write_text(text)
        return saved

    return change


def refuse(folder, message):
    with bounded(200, memory=200e6), pytest.raises(ParametersError, match=message) as caught:
        load(folder)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 2000


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("rows = 14", "rows = 100000", "too many; at most 10000 texels"),
        ("rows = 14", "rows = 0x7fffffffffffffff", "too many; at most 10000 texels"),
        ("rows = 14", "rows = 14.0", "rows must be a whole number"),
        ("rows = 14", "rows = true", "rows must be a whole number"),
        ("rows = 14", "rows = 0", "rows must be a whole number from 1 on"),
        ("bits = 12", "bits = 1000000000000", "bits must be a whole number 1..32"),
        ("format = 1", "format = 1\nx = " + "[" * 100_000, "deep"),
        ("format = 1", "x" * 4_000_000, "more than the 3 MiB accepted"),
        ('sha256 = "', 'sha256 = "../../', "64 hexadecimal digits"),
        ('file = "cover.npz"', 'file = "../cover.npz"', "file must be 'cover.npz'"),
        (r"ksize_x = \d+", "ksize_x = 9999999999", "ksize must be at most 10000 texels"),
        (r"(?m)^name = .*", "name = 0", "name must be a text, not int"),
    ],
    ids=lambda text: text[:25],
)  # fmt: skip
def test_hostile_toml_is_refused_at_once(given, old, new, message):
    refuse(given(old, new), message)


def zipped(entries, method=zipfile.ZIP_DEFLATED):
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", method) as archive:
        for name, content in entries:
            archive.writestr(name, content)
    return packed.getvalue()


def array(shape, kind="<f8", content=b""):
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": kind, "fortran_order": False, "shape": shape})
    return head.getvalue() + content


def encrypted():
    content = bytearray(zipped([("operator.npy", array((1,)) + bytes(8))]))
    for mark, place in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        content[content.index(mark) + place] |= 1
    return bytes(content)


HOSTILE = {
    "empty": (b"", "not a readable npz file"),
    "no zip": (b"x" * 1000, "not a readable npz file"),
    "encrypted": (encrypted(), "encrypted"),
    "bzip2": (zipped([("operator.npy", array((1,)) + bytes(8))], zipfile.ZIP_BZIP2), "another method"),
    "lzma": (zipped([("operator.npy", array((1,)) + bytes(8))], zipfile.ZIP_LZMA), "another method"),
    "a bomb": (zipped([("x.npy", array((17_000_000,), "|u1") + bytes(17_000_000))]), "unpacks to more"),
    "a claim": (zipped([("operator.npy", array((2**60,)))]), "unpacks to more"),
    "a claim beyond 64 bits": (zipped([("operator.npy", array((2**60, 2**60)))]), "unpacks to more"),
    "a false shape": (zipped([("operator.npy", array((84, 84)) + bytes(8))]), "not that of its shape"),
    "a negative shape": (zipped([("operator.npy", array((-84, -84)) + bytes(84 * 84 * 8))]), "array of type"),
    "objects": (zipped([("operator.npy", array((1,), "|O") + bytes(8))]), "accepted: numbers and texts"),
    "texts": (pack_npz({"operator": np.array(["x"])}), r"\[cover\]|npz"),
    "a long head": (zipped([("operator.npy", b"\x93NUMPY\x01\x00\xff\xff" + b"(" * 65535)]), "npz file"),
    "code": (zipped([("x.npy", b"\x93NUMPY\x01\x00\x40\x00" + b"__import__('os')".ljust(64))]), "npz file"),
    "an open head": (zipped([("x.npy", b"\x93NUMPY\x01\x00\x40\x00" + b"{'descr': '<f8', (".ljust(64))]), "npz file"),
    "many arrays": (zipped([(f"{k}.npy", array(())) for k in range(1000)]), "at most 64"),
    "another file": (zipped([("../../x", b"x")]), "something else than arrays"),
    "truncated": (pack_npz({"operator": np.zeros((84, 84))})[:-30], "not a readable npz file"),
    "a wrong checksum": (pack_npz({"operator": np.eye(84)}).replace(b"PK\x03\x04", b"PK\x03\x05", 1), "npz file"),
}  # fmt: skip


@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_npz_files_are_refused_at_once(given, case):
    packed, message = HOSTILE[case]
    refuse(given(packed=packed), message)


@pytest.mark.parametrize("name", ["parameters.toml", "cover.npz"])
def test_a_pipe_is_not_waited_for(given, name):
    folder = given()
    (folder / name).unlink()
    os.mkfifo(folder / name)
    refuse(folder, "is no regular file")


def test_a_byte_order_mark_is_accepted(given):
    path = given() / "parameters.toml"
    path.write_text(path.read_text(), encoding="utf-8-sig")
    assert load(path).array.count == 84


@pytest.mark.parametrize("more", [0, 1])
def test_the_text_may_have_3_mib(given, more):
    path = given() / "parameters.toml"
    text = path.read_bytes() + b"# "
    path.write_bytes(text + b"x" * (3 * 2**20 - len(text) + more))
    if more:
        refuse(path, "more than the 3 MiB accepted")
    else:
        assert load(path).array.count == 84


@pytest.mark.parametrize(("more", "message"), [(0, "not that of its shape"), (1, "unpacks to more")])
def test_tables_may_have_128_mib_besides_the_operator(given, more, message):
    """The file only claims this size; numbers have 8 bytes."""
    refuse(given(packed=zipped([("operator.npy", array((2**24 + 84**2 + more,)))])), message)


def test_a_file_without_a_format_or_a_table_that_is_needed_says_what_is_missing(given, tmp_path):
    (tmp_path / "parameters.toml").write_text("x = 1\n")
    refuse(tmp_path, r"parameters.toml: format is missing")
    with np.load(given() / "cover.npz") as stored:
        tables = {name: stored[name] for name in stored if name not in ("cells_compliance", "cells_influence")}
    refuse(given(packed=pack_npz(tables)), r"\[cells\] cover.npz holds no compliance, influence; derive these param")
