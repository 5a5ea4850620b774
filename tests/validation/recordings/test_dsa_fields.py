"""Every field of a `.dsa` file, with values of its own, and each limit at and beyond it."""

import bz2
import hashlib
import math
import struct

import numpy as np
import pytest

from validation.recordings import RecordingError, dsa

#: Two arrays: 3 columns x 2 rows and 2 columns x 1 row, of which three texels are masked.
MATRICES = [
    {"cells_x": 3, "cells_y": 2, "texel_width": 3.5, "texel_height": "2.5e0", "static_mask": "111 101",
     "dynamic_mask": "110\n 111", "matrix_center_x": -50.5, "matrix_center_y": "+32", "matrix_center_z": 7.25,
     "theta_x": 30, "theta_y": -45, "theta_z": 90, "output_unit": " mV ", "fullscale": 900, "hw_revision": 1,
     "one_wire_uid": "x"},
    {"cells_x": 2, "cells_y": 1, "texel_width": 1.5, "texel_height": 4.5, "static_mask": "11", "dynamic_mask": "01",
     "matrix_center_x": 1, "matrix_center_y": 2, "matrix_center_z": 3, "theta_x": 10, "theta_y": 20, "theta_z": -60,
     "output_unit": "counts", "fullscale": 32767, "hw_revision": 2, "one_wire_uid": "y"},
]  # fmt: skip
#: Tokens of two frames, and the counts that they stand for.
TOKENS = [[1, 900, -3, 5, 0, 32767], [-1, 8, -2, 0, 6, -1, 9]]
COUNTS = [[1, 900, 0, 0, 0, 5, 0, 32767], [0, 8, 0, 0, 0, 6, 0, 9]]
STAMPS = [1_400_000_000_250, 1_400_000_000_290]
READINGS = [(1_400_000_000_240, " 20.5,-30.25 "), (1_400_000_001_250, "21e0, 31.5")]


def element(name, content, **attributes):
    stated = "".join(f" {key}='{value}'" for key, value in attributes.items())
    return f"<{name}{stated}>{content}</{name}>"


def write_tokens(tokens):
    text = [struct.pack(">f", token).hex() for token in tokens]
    return f"\n{''.join(text[:3])}\n {' '.join(text[3:])} "


def write(matrices=MATRICES, tokens=TOKENS, stamps=STAMPS, readings=READINGS, *, tail=""):
    parts = [
        element("matrix", "".join(element(key, value) for key, value in each.items()), index=number)
        for number, each in enumerate(matrices)
    ]
    frames = [
        element("frame", element("time_stamp", stamp) + element("frame_data", write_tokens(each)), index=number)
        for number, (stamp, each) in enumerate(zip(stamps, tokens, strict=True))
    ]
    warm = [
        element("temp", element("time_stamp", stamp) + element("temp_data", text), index=number)
        for number, (stamp, text) in enumerate(readings)
    ]
    angle = element("angle", element("time_stamp", 5) + element("angle_data", "1,2"), index=0)
    sensor = "".join(
        element(key, value)
        for key, value in {"generated_by": 105, "hw_revision": 3, "serial_nr": " S7 ", "num_matrices": len(matrices),
                           "converter_resolution": 12}.items()
    )  # fmt: skip
    return element(
        "root",
        element("sensor", sensor + "".join(parts))
        + element("data", element("frame_count", len(tokens)) + "".join(frames))
        + (element("temperatures", element("temp_count", len(readings)) + "".join(warm)) if readings else "")
        + element("joint_angles", element("angle_count", 1) + angle) + tail,
    )  # fmt: skip


def read(folder, text):
    path = folder / "a.dsa"
    path.write_bytes(bz2.compress(text.encode()))
    return dsa.read(str(path))


def test_every_field_is_read(tmp_path):
    found = read(tmp_path, write())
    first, second = found.arrays
    counts = np.array(COUNTS)
    assert first.counts.tolist() == counts[:, :6].tolist()
    assert second.counts.tolist() == counts[:, 6:].tolist()
    assert (first.texels.rows, first.texels.columns, first.texels.name) == (2, 3, "array 0")
    assert (second.texels.rows, second.texels.columns, second.texels.name) == (1, 2, "array 1")
    assert first.texels.pitch == pytest.approx((3.5e-3, 2.5e-3))
    assert second.texels.pitch == pytest.approx((1.5e-3, 4.5e-3))
    assert first.texels.active.tolist() == [True, True, True, True, False, True]
    assert first.enabled.tolist() == [True, True, False, True, True, True]
    assert (second.texels.active.tolist(), second.enabled.tolist()) == ([True, True], [False, True])
    assert (first.centre, second.centre) == (
        pytest.approx((-0.0505, 0.032, 0.00725)),
        pytest.approx((1e-3, 2e-3, 3e-3)),
    )
    assert first.rotation == pytest.approx((math.pi / 6, -math.pi / 4, math.pi / 2))
    assert second.rotation == pytest.approx((math.pi / 18, math.pi / 9, -math.pi / 3))
    assert (first.full_scale, first.unit, second.full_scale, second.unit) == (900, "mV", 32767, "counts")
    assert (found.serial, found.started.timestamp()) == ("S7", 1_400_000_000.25)
    assert found.times == pytest.approx([0, 0.04])
    assert found.temperatures.tolist() == [[20.5, -30.25], [21, 31.5]]
    assert found.temperature_times == pytest.approx([-0.01, 1])
    digest = hashlib.sha256((tmp_path / "a.dsa").read_bytes()).hexdigest()
    assert (found.sha256, found.setup.source, found.setup.source_sha256) == (digest, "a.dsa", digest)
    assert found.path == tmp_path / "a.dsa"


def test_temperatures_may_be_left_out_and_frames_share_a_time(tmp_path):
    found = read(tmp_path, write(readings=[], stamps=[STAMPS[0]] * 2))
    assert (found.temperatures.shape, found.temperature_times.shape) == ((0, 0), (0,))
    assert found.times.tolist() == [0, 0]


def change(number=0, **values):
    return {"matrices": [{**each, **(values if place == number else {})} for place, each in enumerate(MATRICES)]}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (change(cells_x=0), "cells_x is 0; expected 1..64"),
        (change(cells_y=65), "cells_y is 65; expected 1..64"),
        (change(fullscale=0), "fullscale is 0; expected 1..32767"),
        (change(1, fullscale=32768), "fullscale is 32768; expected 1..32767"),
        (change(texel_width=-1), "texel_width or texel_height is 0 mm or less"),
        (change(texel_height=0), "texel_width or texel_height is 0 mm or less"),
        (change(texel_width="nan"), "texel_width is 'nan'; expected a number"),
        (change(matrix_center_y="1,5"), "matrix_center is '1,5'; expected a number"),
        (change(theta_z="1e100"), "theta is '1e100'; expected a number"),
        (change(static_mask="000 000", dynamic_mask="111 111"), "static_mask leaves no texel; expected at least one"),
        (change(static_mask="111"), "static_mask is not 2 lines of 3 digits 0 or 1"),
        (change(dynamic_mask="111 11"), "dynamic_mask is not 2 lines of 3 digits 0 or 1"),
        (change(dynamic_mask="111 112"), "dynamic_mask is not 2 lines of 3 digits 0 or 1"),
        ({"tokens": [[901, -7], TOKENS[1]]}, "texel 0 reads 901; expected at most 900 (0 is masked)"),
        ({"tokens": [[0, 0, 1, -5], TOKENS[1]]}, "texel 2 reads 1; expected at most 0 (0 is masked)"),
        ({"tokens": [[-4, 1, -3], TOKENS[1]]}, "texel 4 reads 1; expected at most 0 (0 is masked)"),
        ({"tokens": [[-6, 1, 1], TOKENS[1]]}, "texel 6 reads 1; expected at most 0 (0 is masked)"),
        ({"tokens": [[-7, 32768], TOKENS[1]]}, "a token is not a whole number of counts or zeros"),
        ({"tokens": [[0.5, -7], TOKENS[1]]}, "a token is not a whole number of counts or zeros"),
        ({"tokens": [[math.inf, -7], TOKENS[1]]}, "a token is not a whole number of counts or zeros"),
        ({"tokens": [[-7], TOKENS[1]]}, "tokens add up to 7 texels; expected 8"),
        ({"stamps": STAMPS[::-1]}, "time stamp 1400000000250 ms; expected 1400000000290 ms, the one before, or later"),
        ({"stamps": [10**15 - 2, 10**15 - 1]}, "time stamp 999999999999998 ms; expected milliseconds since 1970"),
        ({"stamps": ["1.5", "2"]}, "time_stamp is '1.5'; expected a whole number"),
        ({"readings": [READINGS[0], (STAMPS[1], "1,2,3")]}, "3 temperatures; expected 2 as before"),
        ({"readings": [(5, "1"), (4, "1")]}, "time stamp 4 ms; expected 5 ms"),
        ({"readings": [(5, ",".join(["1"] * 65))]}, "more temperatures than the 100000 readings of 64 channels"),
        ({"tokens": [], "stamps": []}, "no frames; expected at least one"),
        ({"matrices": MATRICES * 9}, "unexpected array 16; expected at most 16, before the frames"),
        ({"tail": element("sensor", "")}, "<sensor> lacks generated_by, hw_revision, serial_nr, num_matrices"),
        ({"tail": "<else/>"}, "<else> in <root>; expected sensor, data"),
        ({"tail": "<data><frame_count>0</frame_count></data>"}, "<data> for the second time; expected one"),
    ],
)  # fmt: skip
def test_a_field_beyond_its_limits_is_named(tmp_path, changes, words):
    with pytest.raises(RecordingError) as caught:
        read(tmp_path, write(**changes))
    assert str(caught.value).startswith(f"{tmp_path / 'a.dsa'}: line ")
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "check"),
    [
        (change(fullscale=1, static_mask="111 111"), None),
        ({"tokens": [[-7, 32767], [-8]]}, lambda found: found.arrays[1].counts.tolist() == [[0, 32767], [0, 0]]),
        ({"readings": [(5, ",".join(["1"] * 64))]}, lambda found: found.temperatures.shape == (1, 64)),
        ({"matrices": [MATRICES[1]] * 16, "tokens": [[-32], [-32]]}, lambda found: len(found.arrays) == 16),
        ({"matrices": [{**MATRICES[1], "cells_x": 64, "cells_y": 64, "static_mask": f"{'1' * 64}\n" * 64,
                        "dynamic_mask": f"{'1' * 64}\n" * 64}], "tokens": [[-4096], [-4096]]},
         lambda found: found.arrays[0].counts.shape == (2, 4096)),
        ({"stamps": [0, 1]}, lambda found: found.started.timestamp() == 0),
    ],
)  # fmt: skip
def test_a_field_at_its_limit_is_read(tmp_path, changes, check):
    tokens = {} if "tokens" in changes or check else {"tokens": [[1, -7], [-8]]}
    found = read(tmp_path, write(**changes, **tokens))
    assert check is None or check(found)


def test_frames_stand_after_the_description_of_the_sensor(tmp_path):
    text = write()
    sensor = text[text.index("<sensor") : text.index("</sensor>") + 9]
    with pytest.raises(RecordingError, match="a frame before the description of the sensor; expected <sensor> first"):
        read(tmp_path, text.replace(sensor, "").replace("</data>", f"</data>{sensor}"))


LONG = write()


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ({"values": 16}, None),
        ({"values": 15}, "more than the 15 values accepted, frames times texels"),
        ({"readings": 2}, None),
        ({"readings": 1}, "more temperatures than the 1 readings of 64 channels accepted"),
        ({"xml_bytes": len(LONG)}, None),
        ({"xml_bytes": len(LONG) - 1}, f"unpacks to more than the {len(LONG) - 1} bytes accepted"),
        ({"piece_bytes": 1}, None),
        ({"piece_bytes": 7, "markup_bytes": 40}, None),
        ({"text": 63}, None),
        ({"text": 58}, "more than the 58 characters accepted in one element"),
    ],
)
def test_files_at_and_beyond_the_limits_of_their_size(tmp_path, monkeypatch, limits, words):
    monkeypatch.setattr(dsa, "LIMITS", dsa.Limits(**limits))
    if words is None:
        assert len(read(tmp_path, LONG).times) == 2
        return
    with pytest.raises(RecordingError, match=words):
        read(tmp_path, LONG)


def test_the_limits_hold_an_hour_of_a_hand():
    """486 texels at 34 frames/s; the text of a frame without zeros is 8 characters for each texel."""
    limits = dsa.Limits()
    assert 3600 * 34 * 486 < limits.values == 60_000_000
    assert 8 * 486 < limits.text == 2**16
    assert (limits.xml_bytes, limits.markup_bytes, limits.piece_bytes) == (2**29, 2**20, 2**16)
    assert (limits.cells, limits.arrays, limits.channels, limits.readings) == (64, 16, 64, 100_000)
