"""Cases of tactilebench: attitude of a body, sums over bodies and layers, truths and their digests, cases in files."""

import math
import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tactilebench
from tactilebench import Body, Case, Cover, Layer, Motion
from tactilebench.case import as_numbers, read_arrays
from tactilebench.draw import RELEASES, Draws, draw

BALL = Body(shape={"shape": "sphere", "radius": 5e-3}, at=(1e-3, 2e-3, 3e-3), load=2.5)
LAYER = Layer(thickness=2e-3, youngs_modulus=1e6, poisson_ratio=0.4)


def make_case(**changes):
    """Two rows of three texels under one ball."""
    x, y = np.meshgrid([-2e-3, 0.0, 2e-3], [-1.5e-3, 1.5e-3])
    return Case(**{
        "name": "linear-000", "tier": "linear", "version": "2026.1", "bodies": (BALL,), "cover": Cover(layers=(LAYER,)),
        "rows": 2, "columns": 3, "pitch": (2e-3, 3e-3), "texel_size": (1.5e-3, 2e-3),
        "centres": np.stack([x.ravel(), y.ravel(), np.zeros(6)], axis=1), "normals": np.tile([0.0, 0.0, 1.0], (6, 1)),
    } | changes)  # fmt: skip


def slide(*loads):
    return Motion(times=tuple(0.1 * k for k in range(len(loads))), at=((0.0, 0.0, 2e-3),) * len(loads), loads=loads)


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.3, 0.0), (0.0, -0.4), (0.2, 0.5)])
@pytest.mark.parametrize("yaw", [0.0, 0.7])
@pytest.mark.parametrize("direction", [(0.0, 0.0, -1.0), (0.48, -0.6, -0.64)])
def test_a_body_is_tilted_first_then_turned_and_its_y_axis_stays_near_that_of_the_array(direction, yaw, tilt):
    found = replace(BALL, direction=direction, yaw=yaw, tilt=tilt).rotation
    z = -np.array(direction)
    upright = found @ (Rotation.from_euler("z", yaw) * Rotation.from_rotvec([*tilt, 0.0])).inv().as_matrix()
    assert upright[:, 2] == pytest.approx(z)
    # The y axis lies in the plane of z and the array's y axis, on its side; x completes a right-handed frame.
    assert upright[:, 1] @ np.cross(z, [0.0, 1.0, 0.0]) == pytest.approx(0)
    assert upright[1, 1] == pytest.approx(math.sqrt(1 - z[1] ** 2))
    assert np.linalg.det(found) == pytest.approx(1)
    assert found @ found.T == pytest.approx(np.eye(3))


def test_a_body_of_a_shape_a_place_and_a_load_stands_upright_on_a_cover_without_friction():
    assert BALL.rotation == pytest.approx(np.eye(3))
    assert (BALL.direction, BALL.yaw, BALL.tilt) == ((0, 0, -1), 0, (0, 0))
    assert (LAYER.law, Cover(layers=(LAYER,)).friction, Cover(layers=()).size) == ("linear-elastic", 0, None)


def test_layers_and_loads_are_added_and_areas_are_products():
    top = replace(LAYER, thickness=0.5e-3)
    assert Cover(layers=(LAYER, top)).thickness == pytest.approx(2.5e-3)
    case = make_case(bodies=(BALL, replace(BALL, load=1.5)))
    assert (case.loads, case.load, case.shape) == ((4.0,), 4.0, (6,))
    assert case.areas == pytest.approx(np.full(6, 3e-6))
    moving = make_case(motion=slide(1.0, 3.0, 2.0, 0.5))
    assert (moving.loads, moving.load, moving.shape) == ((1.0, 3.0, 2.0, 0.5), 3.0, (4, 6))
    assert case.surface is None
    assert not re.search("array|truth", repr(case.with_truth(*TRUTH, command="")))


def test_texels_of_a_flat_array_lie_row_by_row_about_the_origin():
    for case in draw("2026.1"):
        if not case.cover.geometry:
            columns, rows = np.tile(np.arange(case.columns), case.rows), np.repeat(np.arange(case.rows), case.columns)
            x, y = (columns - (case.columns - 1) / 2) * case.pitch[0], (rows - (case.rows - 1) / 2) * case.pitch[1]
            np.testing.assert_allclose(case.centres, np.stack([x, y, 0 * x], axis=1), atol=1e-12)
            assert (case.normals == [0, 0, 1]).all()


def test_the_top_of_a_solid_cover_is_made_of_its_triangles():
    """The flat pad's top lies in one plane at its thickness; the triangles cover its area once, counterclockwise."""
    case = next(each for each in draw("2026.1") if each.cover.geometry == "flat-pad")
    vertices, faces = case.surface
    corners = vertices[faces]
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = np.abs(corners[..., 2] - case.cover.thickness).max(axis=1) < 1e-9
    extent = np.ptp(vertices[faces[flat].ravel()], axis=0)
    assert doubled[flat, 2].sum() / 2 == pytest.approx(extent[0] * extent[1])
    assert faces.dtype == np.int64


TRUTH = [np.arange(6.0), np.full(6, 0.1), np.array(0.5), np.array(0.2)]


@pytest.mark.parametrize(
    ("place", "value", "words"),
    [
        (0, np.zeros(5), "must have the shape"), (1, np.zeros((2, 3)), "must have the shape"),
        (2, np.zeros(1), "must have the shape"), (3, np.zeros(1), "must have the shape"),
        (0, np.full(6, np.inf), "must be finite"), (1, np.full(6, np.nan), "must be finite"),
        (2, np.array(np.nan), "must be finite"), (3, np.array(np.inf), "must be finite"),
        (1, np.array([0, 0, 0, -1e-9, 0, 0]), "not negative"), (3, np.array(-1e-9), "not negative"),
    ],
)  # fmt: skip
def test_a_truth_of_wrong_shape_or_sign_is_refused(place, value, words):
    with pytest.raises(tactilebench.BenchError, match=words):
        make_case().with_truth(*TRUTH[:place], value, *TRUTH[place + 1 :], command="")


def test_the_digest_stands_for_definition_command_and_every_number():
    first = make_case().with_truth(*TRUTH, command="a").truth.digest
    others = [
        make_case().with_truth(*TRUTH, command="b"),
        make_case(pitch=(2e-3, 4e-3)).with_truth(*TRUTH, command="a"),
    ]
    for place in range(4):
        changed = [each.copy() for each in TRUTH]
        changed[place] += 1e-12
        others.append(make_case().with_truth(*changed, command="a"))
    assert len({first, *(case.truth.digest for case in others)}) == 7
    whole = [[0, 1, 2, 3, 4, 5], [1] * 6, 1, 2]  # integers and numbers of less digits are the same numbers
    kinds = [
        whole,
        [np.array(each, dtype=np.float32) for each in whole],
        [np.array(each, dtype=">f8") for each in whole],
    ]
    assert len({make_case().with_truth(*each, command="").truth.digest for each in kinds}) == 1
    with pytest.raises(tactilebench.BenchError, match="linear-000 has no truth"):
        make_case().require_truth()


def test_truths_of_one_and_of_many_instants_survive_their_file(tmp_path):
    drawn = {case.name: case for case in draw("2026.1", 3)}
    names = ("moving-001-s3", "linear-004-s3", "curved-002-s3", "moving-000-s3")
    rng, made = np.random.default_rng(2), []
    for case in map(drawn.get, names):
        sizes = (case.shape, case.shape, case.shape[:-1], case.shape[:-1])
        made.append(case.with_truth(*(rng.uniform(0, 1, size) for size in sizes), command=f"solve {case.name}"))
    tactilebench.save_truth(tmp_path / "truth.npz", made, seed=np.int64(3), made_by="nobody 1.0")
    again = tactilebench.load_truth(tmp_path / "truth.npz")
    assert [case.name for case in again] == list(names)
    for before, after in zip(made, again, strict=True):
        assert (after.truth.digest, after.truth.command) == (before.truth.digest, before.truth.command)
        for name in ("forces", "half_width", "outside", "outside_half_width"):
            np.testing.assert_array_equal(getattr(after.truth, name), getattr(before.truth, name))


def test_a_release_without_truth_in_the_package_is_refused(monkeypatch):
    monkeypatch.setitem(RELEASES, "2099.1", 5)
    with pytest.raises(tactilebench.BenchError, match=r"2099\.1\.npz is missing.*install the released wheel"):
        tactilebench.cases("2099.1")
    assert tactilebench.cases("2099.1", seed=0)[0].truth is None


@pytest.mark.parametrize("seed", [-1, 1.0, True, "7", np.float64(1), *np.ones(1, dtype=bool)])
def test_a_seed_is_a_whole_number_from_zero_on(seed):
    with pytest.raises(tactilebench.BenchError, match="let it be a whole number from 0 on"):
        draw("2026.1", seed)


def test_a_seed_may_be_zero_and_a_number_of_numpy():
    cases = draw("2026.1", np.uint8(0))
    assert {case.name[-3:] for case in cases} == {"-s0"}
    assert [case.as_json() for case in cases] == [case.as_json() for case in draw("2026.1", 0)]


def test_draws_are_uniform_in_the_number_or_in_its_logarithm():
    draws = Draws("a key")
    chance = [draws.chance(0.2) for _ in range(4000)]
    assert np.mean(chance) == pytest.approx(0.2, abs=0.03)
    assert np.mean([draws.between(2.0, 6.0) for _ in range(4000)]) == pytest.approx(4, abs=0.06)
    logs = np.log([draws.log(0.5, 8.0) for _ in range(4000)])
    assert logs.mean() == pytest.approx(math.log(2.0), abs=0.05)
    assert (logs.min() >= math.log(0.5), logs.max() <= math.log(8.0)) == (True, True)
    picked = [draws.pick("abcd") for _ in range(4000)]
    assert [picked.count(each) / 4000 for each in "abcd"] == pytest.approx([0.25] * 4, abs=0.03)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (np.array(["1"]), "not <U1"), (np.array([1j]), "not complex128"), (np.array([None]), "not object"),
        (np.array(["2020"], dtype="M8[Y]"), "not datetime64"), ([[1.0], [1.0, 2.0]], "is no array"),
        (np.ma.masked_equal([1.0, 2.0], 2.0), "none masked"),
    ],
)  # fmt: skip
def test_what_are_no_real_numbers_is_refused_with_its_place(values, words):
    with pytest.raises(tactilebench.BenchError, match=f"here: .*{words}"):
        as_numbers("here", values)


@pytest.mark.parametrize("values", [[1, 2], [True, True], np.array([1, 2], dtype="u1"), np.float32([1, 2]),
                                    np.ma.masked_array([1.0, 2.0], [False, False])])  # fmt: skip
def test_real_numbers_of_every_kind_are_read(values):
    found = as_numbers("here", values)
    assert (found.dtype, found.shape) == (np.float64, (2,))
    assert found.tolist() in ([1, 2], [1, 1])


def test_the_reason_why_an_archive_cannot_be_read_is_told(tmp_path):
    (tmp_path / "text").write_text("no archive")
    for name, words in (("none", "No such file"), ("text", "not a zip file")):
        with pytest.raises(tactilebench.BenchError, match=rf"cannot be read: .*{words}.*; write it anew"):
            read_arrays(tmp_path / name)


@pytest.mark.parametrize("kind", ["folder", "pipe", "device"])
def test_what_may_never_end_is_no_file(tmp_path, kind):
    path = {"folder": tmp_path, "pipe": tmp_path / "pipe", "device": Path("/dev/zero")}[kind]
    if kind == "pipe":
        os.mkfifo(path)
    for read in (read_arrays, lambda place: tactilebench.read_forces(place, [make_case()]), tactilebench.load_truth):
        with pytest.raises(tactilebench.BenchError, match=f"{path}: is a folder, a device or a pipe; name a file"):
            read(path)
