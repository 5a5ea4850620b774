"""The `.dsa` reader: what it returns, and that damage is never read as numbers."""

import bz2
import re
import struct
from pathlib import Path

import numpy as np
import pytest

from meshes.catalogue import ARRAYS
from tests.support.recordings import RECORDINGS
from validation.recordings import Recording, RecordingError, dsa

REAL = RECORDINGS or Path("nowhere")
SIZES = [(6, 14), (6, 13)]
TEXELS = 84 + 78


def write_mask(columns, rows, absent=()):
    lines = ["".join("0" if (r, c) in absent else "1" for c in range(columns)) for r in range(rows)]
    return "\n        " + "\n        ".join(lines) + "\n      "


def write_matrix(index, columns, rows):
    absent = {(r, c) for r in range(5) for c in (0, 5)} if rows == 13 else set()
    fields = {
        "cells_x": columns,
        "cells_y": rows,
        "texel_width": 3.4,
        "texel_height": 3.4,
        "matrix_center_x": -50,
        "matrix_center_y": 32,
        "matrix_center_z": 0,
        "theta_x": 0,
        "theta_y": 0,
        "theta_z": 90,
        "output_unit": "mV",
        "hw_revision": 1,
        "one_wire_uid": "none",
        "fullscale": 4095,
        "static_mask": write_mask(columns, rows, absent),
        "dynamic_mask": write_mask(columns, rows),
    }
    body = "".join(f"<{key}>{value}</{key}>" for key, value in fields.items())
    return f'<matrix index="{index}" name="">{body}</matrix>\n'


def encode_tokens(values):
    """Encode one frame: runs of zeros as negative tokens, seven tokens to a line."""
    out, zeros = [], 0
    for value in [*values, None]:
        if value == 0:
            zeros += 1
            continue
        if zeros:
            out.append(-float(zeros))
            zeros = 0
        if value is not None:
            out.append(float(value))
    text = [struct.pack(">f", token).hex().upper() for token in out]
    return "\n".join("".join(text[i : i + 7]) for i in range(0, len(text), 7))


def write_document(frames, stamps=None):
    stamps = stamps or [1410321769772 + 32 * i for i in range(len(frames))]
    frame_xml = "".join(
        f'<frame index="{i}">\n<time_stamp>{stamp}</time_stamp>\n'
        f"<frame_data>\n{encode_tokens(frame)}\n</frame_data></frame>\n"
        for i, (stamp, frame) in enumerate(zip(stamps, frames, strict=True))
    )
    return (
        '<?xml version="1.0" encoding="utf-8"?>\n<root>\n<sensor name=""><generated_by>105</generated_by>'
        "<hw_revision>1</hw_revision><serial_nr>1D9B0057</serial_nr>"
        f"<num_matrices>{len(SIZES)}</num_matrices><converter_resolution>12</converter_resolution>\n"
        + "".join(write_matrix(i, *size) for i, size in enumerate(SIZES))
        + f"</sensor>\n<data><frame_count>{len(frames)}</frame_count>\n{frame_xml}</data>\n"
        "<temperatures><temp_count>2</temp_count>"
        '<temp index="0"><time_stamp>1410321769900</time_stamp><temp_data>27.75, 28.50</temp_data></temp>'
        '<temp index="1"><time_stamp>1410321770900</time_stamp><temp_data>28.00, 28.75</temp_data></temp>'
        "</temperatures><joint_angles><angle_count>0</angle_count></joint_angles>\n</root>\n"
    )


def generate_frames(count=30, seed=3):
    rng = np.random.default_rng(seed)
    frames = np.where(rng.random((count, TEXELS)) < 0.3, rng.integers(1, 4096, (count, TEXELS)), 0)
    frames[:, 84:] *= ARRAYS["sdh2-distal"].active
    frames[0] = 0
    return frames


@pytest.fixture
def write(tmp_path):
    def _write(text, name="case.dsa"):
        path = tmp_path / name
        path.write_bytes(bz2.compress(text.encode()) if isinstance(text, str) else text)
        return path

    return _write


def list_values(recording: Recording):
    return [recording.times, recording.temperatures, *(array.counts for array in recording.arrays)]


def test_frames_arrays_and_temperatures_are_read(write):
    frames = generate_frames()
    recording = dsa.read(write(write_document(frames)))
    first, second = recording.arrays
    assert (first.counts == frames[:, :84]).all()
    assert (second.counts == frames[:, 84:]).all()
    assert second.has_layout_of(ARRAYS["sdh2-distal"])
    assert not first.has_layout_of(ARRAYS["sdh2-distal"])
    assert first.has_layout_of(ARRAYS["wts-0614-34"])
    assert recording.times[:3] == pytest.approx([0, 0.032, 0.064])
    assert recording.frame_rate == pytest.approx(31.25)
    assert recording.temperature_times == pytest.approx([0.128, 1.128])
    assert recording.temperatures.tolist() == [[27.75, 28.5], [28.0, 28.75]]
    assert recording.started.isoformat() == "2014-09-10T04:02:49.772000+00:00"
    assert second.rotation == pytest.approx((0, 0, np.pi / 2))
    assert second.centre == pytest.approx((-0.05, 0.032, 0))
    assert (first.full_scale, first.unit, recording.serial) == (4095, "mV", "1D9B0057")


def replace_once(text, old, new):
    assert re.search(old, text), "the planted defect must hit something"
    return re.sub(old, new, text, count=1)


FRAME_OF_ZEROS = struct.pack(">f", -float(TEXELS)).hex().upper()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (FRAME_OF_ZEROS, "C3220000" + "3F800000", "add up to 163 texels; expected 162"),
        (FRAME_OF_ZEROS, "C3210000", "add up to 161 texels; expected 162"),
        (FRAME_OF_ZEROS, "", "add up to 0 texels"),
        (FRAME_OF_ZEROS, "C322000", "not hexadecimal tokens"),
        (FRAME_OF_ZEROS, "C322000G", "not hexadecimal tokens"),
        (FRAME_OF_ZEROS, "7FC00000", "not a whole number"),
        (FRAME_OF_ZEROS, "FF800000", "not a whole number"),
        (FRAME_OF_ZEROS, "FF7FFFFF", "not a whole number"),
        (FRAME_OF_ZEROS, "3F000000" + "C3210000", "not a whole number"),
        (FRAME_OF_ZEROS, "45800000" + "C3210000", "texel 0 reads 4096; expected at most 4095"),
        (FRAME_OF_ZEROS, "C2A80000" + "3F800000" + "C29A0000", "texel 84 reads 1; expected at most 0"),
        ("<frame_count>30<", "<frame_count>31<", "frame_count is 31, found 30"),
        ("<frame_count>30<", "<frame_count>29<", "frame_count is 29, found 30"),
        ("<frame_count>30<", "<frame_count>3_0<", "expected a whole number"),
        ('<frame index="7">', '<frame index="8">', "index '8'; expected '7'"),
        ("<time_stamp>1410321769804<", "<time_stamp>1310321769804<", "the one before, or later"),
        ("<time_stamp>1410321769804<", "<time_stamp>-5<", "expected a whole number"),
        ("<num_matrices>2<", "<num_matrices>3<", "num_matrices is 3, found 2"),
        ("<temp_count>2<", "<temp_count>1<", "temp_count is 1, found 2"),
        ("28.00, 28.75", "28.00", "1 temperatures; expected 2"),
        ("28.00, 28.75", "28.00, nan", "expected a number"),
        ("<cells_x>6<", "<cells_x>7<", "14 lines of 7 digits"),
        ("<cells_x>6<", "<cells_x>99999999<", "expected 1..64"),
        ("<texel_width>3.4<", "<texel_width>0<", "positive length"),
        ("<fullscale>4095<", "<fullscale>99999<", "expected 1..32767"),
        ("<fullscale>4095</fullscale>", "", "lacks fullscale"),
        ("<cells_y>14</cells_y>", "<cells_y>14</cells_y><cells_y>14</cells_y>", "second time"),
        ("111111\n", "111121\n", "digits 0 or 1"),
        ("<sensor name", "<sensors/><sensor name", "expected sensor, data"),
        ("</data>", "stray</data>", "text between elements"),
        ("</root>", "", "no well-formed XML"),
        (r"\s<data>.*</data>", "", "lacks data"),
        ("<root>", "<!DOCTYPE root [<!ENTITY a 'aa'>]><root>", "declaration"),
        ("<root>", "<?xml-stylesheet href='x'?><root>", "declaration"),
    ],
)
def test_an_inconsistent_file_is_refused_with_name_and_place(write, old, new, message):
    text = write_document(generate_frames())
    flags = re.DOTALL if "*" in old else 0
    damaged = replace_once(text, re.compile(old, flags), new)
    path = write(damaged)
    with pytest.raises(RecordingError) as caught:
        dsa.read(path)
    assert message in str(caught.value)
    assert str(caught.value).startswith(f"{path}: line ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("head", "repeated", "message"),
    [
        ("<root>", " ", "characters accepted"),
        pytest.param("<root", ' a="', "no well-formed|without a tag", marks=pytest.mark.slow),
        ('<root a="', "x", "without a tag"),
        ("<!--", "x", "without a tag"),
        pytest.param("<", "root", "without a tag", marks=pytest.mark.slow),
    ],
)
def test_a_small_file_that_unpacks_to_much_is_refused(write, head, repeated, message):
    path = write(head + repeated * (2**21 // len(repeated)))
    assert path.stat().st_size < 10_000
    with pytest.raises(RecordingError, match=message):
        dsa.read(path)


def test_files_beyond_the_limits_are_refused(write, monkeypatch):
    path = write(write_document(generate_frames()))
    monkeypatch.setattr(dsa, "LIMITS", dsa.Limits(values=10 * TEXELS))
    with pytest.raises(RecordingError, match="more than the 1620 values"):
        dsa.read(path)
    monkeypatch.setattr(dsa, "LIMITS", dsa.Limits(xml_bytes=1000))
    with pytest.raises(RecordingError, match="more than the 1000 bytes"):
        dsa.read(path)


def test_files_of_other_formats_are_refused(write, tmp_path):
    for content in (
        b"",
        b"BZh",
        b"hello",
        b"<?xml version='1.0'?><root/>",
        bz2.compress(b"hello"),
        bz2.compress(b""),
    ):
        with pytest.raises(RecordingError, match=r"case\.dsa: "):
            dsa.read(write(content))
    with pytest.raises(RecordingError, match="no such file"):
        dsa.read(tmp_path / "missing.dsa")
    with pytest.raises(RecordingError, match="no such file"):
        dsa.read(tmp_path)
    whole = bz2.compress(write_document(generate_frames()).encode())
    for tail in (b"x", whole, b"\0" * 2**17):
        with pytest.raises(RecordingError, match="bytes follow the end"):
            dsa.read(write(whole + tail))


def check_variants(path, original, variants):
    """Read every variant of a file: it is refused or gives the same values.  Return how many were refused."""
    expected = list_values(dsa.read(path))
    refused = 0
    for variant in variants(original):
        path.write_bytes(variant)
        try:
            got = list_values(dsa.read(path))
        except RecordingError as error:
            refused += str(error).startswith(f"{path}: ")
            continue
        assert all(np.array_equal(a, b) for a, b in zip(got, expected, strict=True))
    return refused


def flip_bits(count):
    def generate(original):
        rng = np.random.default_rng(5)
        early = np.arange(64)
        anywhere = rng.integers(0, 8 * len(original), count)
        for bit in np.concatenate([early, anywhere]):
            changed = bytearray(original)
            changed[bit // 8] ^= 1 << (bit % 8)
            yield bytes(changed)

    return generate


def cut_ends(count):
    def generate(original):
        for end in np.linspace(0, len(original) - 1, count).astype(int):
            yield original[:end]

    return generate


@pytest.mark.parametrize("count", [60, pytest.param(300, marks=pytest.mark.slow)])
def test_flipped_bits_and_truncation_never_give_other_numbers(write, count):
    path = write(write_document(generate_frames(10)))
    original = path.read_bytes()
    assert check_variants(path, original, flip_bits(count)) > count
    path.write_bytes(original)
    assert check_variants(path, original, cut_ends(count)) == count


@pytest.mark.parametrize("count", [60, pytest.param(200, marks=pytest.mark.slow)])
def test_flipped_bits_in_the_xml_are_refused_or_change_one_value(write, count):
    """Such damage passes the checksum of bzip2; only flips that leave a valid file are read."""
    frames = generate_frames(6)
    text = write_document(frames)
    start, end = text.index("<data>"), text.index("</data>")
    rng = np.random.default_rng(9)
    passed = 0
    for position in rng.integers(start, end, count):
        changed = bytearray(text.encode())
        changed[position] ^= 1 << rng.integers(0, 7)
        path = write(bz2.compress(bytes(changed), 1))
        try:
            recording = dsa.read(path)
        except RecordingError:
            continue
        passed += 1
        got = np.concatenate([array.counts for array in recording.arrays], axis=1)
        assert got.shape == frames.shape
        assert np.count_nonzero(got != frames) <= 1
        assert got.max() <= 4095
    assert passed < count / 2


@pytest.mark.slow
@pytest.mark.skipif(not REAL.is_dir(), reason="the recordings are not here")
def test_flipped_bits_in_real_files_never_give_other_numbers(tmp_path):
    for file in sorted((REAL / "kiechle-sdh2").rglob("*.dsa"))[::6]:
        path, original = tmp_path / file.name, file.read_bytes()
        path.write_bytes(original)
        assert check_variants(path, original, flip_bits(34)) > 34
        path.write_bytes(original)
        assert check_variants(path, original, cut_ends(10)) == 10


@pytest.mark.parametrize("every", [24, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.skipif(not REAL.is_dir(), reason="the recordings are not here")
def test_every_real_file_reads_and_its_hash_is_the_published_one(every):
    root = REAL / "kiechle-sdh2"
    sums = dict(reversed(line.split()) for line in (root / "SHA256SUMS").read_text().splitlines())
    files = sorted(root.rglob("*.dsa"))
    assert len(files) >= 30
    for file in files[::every]:
        recording = dsa.read(file)
        assert recording.sha256 == sums[f"./{file.relative_to(root)}"]
        assert len(recording.arrays) == 6
        assert all(recording.arrays[i].has_layout_of(ARRAYS["sdh2-distal"]) for i in (1, 3, 5))
        assert all(recording.arrays[i].has_layout_of(ARRAYS["wts-0614-34"]) for i in (0, 2, 4))
