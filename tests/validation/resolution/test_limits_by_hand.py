"""Limits of touches whose texel forces are Gaussian functions of the place, against a second computation."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

import validation
from fastmodel import Electronics
from meshes import TexelArray
from tests.support.gaussian_touches import MIDDLE, PITCH, TOUCHES, share
from validation.errors import InputError
from validation.resolution.channel import Channel, make_channel
from validation.resolution.limits import Limit, Limits, Study, find_cell, find_limits, find_place_error, list_limits

NOISE, LOAD = 4e-3, 1.5
STUDY = Study(touches=TOUCHES, channel=Channel(noise=NOISE), texel=MIDDLE, load=LOAD)


def fisher(places, radius=0.0):
    """Fisher matrices of x, y, force and radius, shape (k, 4, 4)."""
    slopes = share(places, radius) * [LOAD, LOAD, 1.0, LOAD]
    return np.einsum("kna,knb->kab", slopes, slopes) / NOISE**2


def test_places_lie_in_the_middles_of_a_quarter_of_the_pitch():
    line = np.array([-0.375, -0.125, 0.125, 0.375])
    expected = [(x * 2e-3, y * 3e-3) for y in line for x in line]
    assert STUDY.places == pytest.approx(np.array(expected))
    moved = replace(STUDY, shift=np.array([0.5, -0.5]))
    assert moved.places - [1e-3, -1.5e-3] == pytest.approx(np.array(expected))
    assert moved.ends[0] == pytest.approx([0.0, -3e-3])
    assert moved.ends[1] == pytest.approx([2e-3, 0.0], abs=1e-12)


@pytest.mark.parametrize("radius", [0.0, 1e-6, 0.7e-3])
def test_slopes_are_those_of_the_forces(radius):
    study = replace(STUDY, radius=radius)
    expected = share(STUDY.places, radius) * [LOAD, LOAD, 1.0, LOAD if radius else 0.0]
    found = study.find_slopes(STUDY.places)
    assert found[..., :3] == pytest.approx(expected[..., :3], rel=1e-5, abs=1e-7)
    assert found[..., 3] == pytest.approx(expected[..., 3], rel=1e-4, abs=1e-5)
    assert study.respond(STUDY.places, 0.3e-3) == pytest.approx(share(STUDY.places, 0.3e-3)[..., 2])


@pytest.mark.parametrize("size", [2, 3, 4])
def test_the_bound_is_the_inverse_of_the_fisher_matrix(size):
    study = replace(STUDY, radius=0.7e-3)
    covariance, forces = study.bound(STUDY.places, size)
    assert forces == pytest.approx(LOAD * share(STUDY.places, 0.7e-3)[..., 2])
    expected = np.linalg.inv(fisher(STUDY.places, 0.7e-3)[:, :size, :size])
    for found, each in zip(covariance, expected, strict=True):
        scale = np.sqrt(np.diag(each))
        assert found / np.outer(scale, scale) == pytest.approx(each / np.outer(scale, scale), abs=2e-3)
    assert np.isinf(replace(STUDY, radius=0.0).bound(STUDY.places, 4)[0]).all()


def test_the_error_of_a_radius_is_that_with_place_and_force_unknown():
    deviation, counts = replace(STUDY, radius=0.7e-3).bound_radius()
    expected = np.sqrt(np.linalg.inv(fisher(STUDY.places, 0.7e-3))[:, 3, 3])
    assert deviation == pytest.approx(expected, rel=1e-3)
    assert counts.tolist() == (expected < 0.7e-3).tolist()
    assert counts.any()
    _, dark = replace(STUDY, radius=0.7e-3, load=0.02).bound_radius()
    assert not dark.any()


@pytest.mark.parametrize("separation", [2.5e-3, 0.2e-3, 0.1e-3])
def test_the_error_of_a_separation_is_that_of_the_difference_of_two_places(separation):
    """Six parameters: x, y and force of each touch, which lie half of the separation to the left and to the right."""
    aside = np.array([separation / 2, 0.0])
    both = np.concatenate([share(STUDY.places + by)[..., :3] * [LOAD, LOAD, 1.0] for by in (-aside, aside)], axis=-1)
    covariance = np.linalg.inv(np.einsum("kna,knb->kab", both, both) / NOISE**2)
    expected = np.sqrt(covariance[:, 0, 0] + covariance[:, 3, 3] - 2 * covariance[:, 0, 3])
    deviation, counts = STUDY.bound_separation(separation)
    assert deviation == pytest.approx(expected, rel=0.01)
    assert counts.tolist() == (expected < separation).tolist()
    assert counts.any() == (separation > 0.15e-3)


def test_one_place_of_two_touches_is_not_told_apart():
    deviation, counts = STUDY.bound_separation(0.0)
    assert np.isinf(deviation).all()
    assert not counts.any()


@pytest.mark.parametrize(
    ("lit", "errors", "counts"),
    [
        (3, (0.199e-3, 0.299e-3), True), (2, (0.199e-3, 0.299e-3), False), (3, (0.2e-3, 0.1e-3), False),
        (3, (0.1e-3, 0.1 * 3e-3), False), (15, (0.1e-3, 0.1e-3), True),
    ],
)  # fmt: skip
def test_the_bound_counts_with_three_lit_texels_and_errors_below_a_tenth_of_the_pitch(lit, errors, counts):
    """A texel is lit above three standard deviations of noise."""
    forces = np.where(np.arange(15) < lit, 3 * NOISE + 1e-9, 3 * NOISE)
    assert STUDY.judge(forces[None], np.array([errors])).tolist() == [counts]


def test_texels_that_frames_may_show_bear_two_hundredths_of_the_noise_at_twice_the_load():
    """Of a touch at a corner or at the middle of the cell; one that is dark everywhere tells nothing."""
    corners = np.array([[x, y] for x in (-1e-3, 1e-3) for y in (-1.5e-3, 1.5e-3)] + [[0.0, 0.0]])
    for load, shift in itertools.product((1.5, 0.02, 0.002), (np.zeros(2), np.array([0.5, -0.5]))):
        most = 2 * load * share(corners + shift * PITCH)[..., 2].max(axis=0)
        study = replace(STUDY, load=load, shift=shift)
        assert study.seen.tolist() == np.flatnonzero(most > 0.02 * NOISE).tolist()


def draw(truth, load, frames, seed):
    normal = np.random.default_rng(seed).standard_normal((frames, 15))
    return load * share(truth)[0, :, 2] + NOISE * normal


def solve(frames, places, forces, load):
    """Mean variances of x, y and force of the posterior with a uniform prior on given points, by the plain sum."""
    x, y, f = np.concatenate([np.column_stack([places, np.full(len(places), force)]) for force in forces]).T
    cases = f[:, None] * share(np.column_stack([x, y]))[..., 2]
    odds = -((frames[:, None] - cases) ** 2).sum(axis=2) / (2 * NOISE**2)
    weights = np.exp(odds - odds.max(axis=1, keepdims=True))
    weights /= weights.sum(axis=1, keepdims=True)
    values = np.column_stack([x, y, f - load])
    mean = weights @ values
    return (weights @ values**2 - mean**2).mean(axis=0)


def cover_cell(count, low=-0.5 * PITCH, high=0.5 * PITCH):
    line = (np.arange(count) + 0.5) / count
    return np.array([low + (high - low) * [x, y] for x in line for y in line])


@pytest.mark.parametrize("load", [0.02, 0.06])
def test_the_posterior_of_a_known_force_is_that_on_a_finer_grid(load):
    study, truth = replace(STUDY, load=load), np.array([[0.3e-3, -0.8e-3]])
    found = study.sample(truth, np.full(2, np.inf), 3, known=True, seed=5)[0]
    expected = solve(draw(truth, load, 3, 5), cover_cell(75), [load], load)
    assert found[:2] == pytest.approx(expected[:2], rel=5e-3)
    assert found[2] == 0
    again = study.sample(np.vstack([truth, -truth]), np.full(2, np.inf), 3, known=True, seed=5)
    assert again.shape == (2, 3)


@pytest.mark.parametrize("load", [0.02, 0.06])
def test_the_posterior_of_an_unknown_force_spans_up_to_twice_the_load(load):
    study, truth = replace(STUDY, load=load), np.array([[0.3e-3, -0.8e-3]])
    found = study.sample(truth, np.full(2, np.inf), 2, known=False, seed=3)[0]
    forces = 2 * load * (np.arange(41) + 0.5) / 41
    expected = solve(draw(truth, load, 2, 3), cover_cell(25), forces, load)
    assert found == pytest.approx(expected, rel=0.02)


def test_a_posterior_around_a_place_is_cut_at_its_half_widths():
    """Half widths of 0.25 mm and 0.4 mm, of which the pitch cuts one end."""
    truth = np.array([[0.9e-3, -0.2e-3]])
    study = replace(STUDY, load=0.06)
    found = study.sample(truth, np.array([0.25e-3, 0.4e-3]), 3, known=True, seed=2)[0]
    places = cover_cell(60, np.array([0.65e-3, -0.6e-3]), np.array([1e-3, 0.2e-3]))
    expected = solve(draw(truth, 0.06, 3, 2), places, [0.06], 0.06)
    assert found[:2] == pytest.approx(expected[:2], rel=0.01)


def by_name(study, separation=None):
    return {each.name: each for each in list_limits(study, separation)}


def root(values):
    return math.sqrt(np.mean(values))


def test_where_all_places_are_bright_the_bound_counts_and_is_near_the_posterior():
    found = by_name(replace(STUDY, radius=0.7e-3), 2.5e-3)
    assert list(found) == [
        "place x, force known", "place y, force known", "place x, force unknown", "place y, force unknown", "force",
        "radius", "separation", "least force, over the texel", "least force, worst place",
    ]  # fmt: skip
    assert [each.unit for each in found.values()] == ["m"] * 4 + ["N", "m", "m", "N", "N"]
    matrices = fisher(STUDY.places, 0.7e-3)
    known, unknown = (np.linalg.inv(matrices[:, :size, :size]) for size in (2, 3))
    for name, variance in (
        ("place x, force known", known[:, 0, 0]), ("place y, force known", known[:, 1, 1]),
        ("place x, force unknown", unknown[:, 0, 0]), ("place y, force unknown", unknown[:, 1, 1]),
        ("force", unknown[:, 2, 2]),
    ):  # fmt: skip
        each = found[name]
        assert each.value == each.bound == pytest.approx(root(variance), rel=1e-3)
        assert each.posterior == pytest.approx(each.bound, rel=0.15)
        assert each.counts == "bound"
    radius = np.linalg.inv(matrices)[:, 3, 3]
    assert found["radius"].value == found["radius"].bound == pytest.approx(root(radius), rel=1e-3)
    assert (found["radius"].posterior, found["radius"].counts) == (None, "bound")
    for name, place in (("least force, over the texel", (0.0, 0.0)), ("least force, worst place", (1e-3, 1.5e-3))):
        shares = share([place], 0.7e-3)[0, :, 2]
        assert found[name].value == pytest.approx((3.0902323 + 1.2815516) * NOISE / np.linalg.norm(shares), rel=1e-6)
        assert (found[name].bound, found[name].posterior) == (None, None)
    assert set(by_name(STUDY)) == set(found) - {"radius", "separation"}


@pytest.mark.parametrize(("load", "count"), [(0.1, 4), (0.12, 12)])
def test_where_some_places_are_dark_each_place_has_its_own(load, count):
    """At both loads three texels are lit at 12 of the 16 places; at the lower one the error is small at 8."""
    study = replace(STUDY, load=load)
    forces = load * share(STUDY.places)[..., 2]
    slopes = load * share(STUDY.places)[..., :2]
    variance = np.diagonal(
        np.linalg.inv(np.einsum("kna,knb->kab", slopes, slopes) / NOISE**2), axis1=1, axis2=2
    )  # fmt: skip
    bright = ((forces > 3 * NOISE).sum(axis=1) >= 3) & (np.sqrt(variance) < 0.1 * PITCH).all(axis=1)
    assert bright.sum() == count
    found = by_name(study)["place x, force known"]
    assert found.counts == f"bound at {bright.sum()} of 16 places, else posterior"
    bound, posterior, regular = study.list_places(known=True)
    assert regular.tolist() == bright.tolist()
    assert bound[:, :2] == pytest.approx(variance, rel=1e-3)
    assert (bound[:, 2] == 0).all()
    assert found.bound == pytest.approx(root(variance[:, 0]), rel=1e-3)
    assert found.posterior == pytest.approx(root(posterior[:, 0]))
    assert found.value == pytest.approx(root(np.where(bright, variance[:, 0], posterior[:, 0])), rel=1e-3)
    dark = study.sample(STUDY.places[~bright], np.full(2, np.inf), 16, known=True)
    assert posterior[~bright] == pytest.approx(dark)
    total = variance[bright].sum(axis=0) + dark[:, :2].sum(axis=0)
    assert find_place_error(study) == pytest.approx(math.sqrt(total.mean() / 16), rel=1e-3)
    fewer = study.sample(STUDY.places[~bright], np.full(2, np.inf), 4, known=True)
    total = variance[bright].sum(axis=0) + fewer[:, :2].sum(axis=0)
    assert find_place_error(study, 4) == pytest.approx(math.sqrt(total.mean() / 16), rel=1e-3)


def test_what_no_texel_shows_has_no_bound_of_radius_and_separation():
    found = by_name(replace(STUDY, radius=1e-5, load=0.02), 0.2e-3)
    assert found["place x, force known"].counts == "posterior"
    assert found["place x, force known"].value == found["place x, force known"].posterior
    for name in ("radius", "separation"):
        assert (found[name].value, found[name].counts) == (None, "singular at 16 of 16 places")
        assert found[name].unit == "m"


def make_limits(**changes):
    def limit(name, counts):
        return Limit(name=name, unit="m", bound=1e-4, posterior=2e-4, value=1e-4, counts=counts)

    counted = (
        limit("place x, force known", "bound"), limit("place y, force known", "bound"), limit("force", "posterior"),
        limit("radius", "bound"), limit("least force, over the texel", "90 %"),
        limit("least force, worst place", "90 %"),
    )  # fmt: skip
    values = {
        "sensor": "s", "load": 1.25, "radius": 0.0, "separation": None, "noise": 4e-3, "noise_assumed": False,
        "texel": 7, "ideal": (), "counted": counted,
    }  # fmt: skip
    return Limits(**(values | changes))


def test_sentences_name_the_touches_the_noise_and_what_counts():
    assert list(make_limits().explain()) == [
        "For point touches of 1.25 N within a pitch around texel 7, and noise of 4 mN.",
        "Place and radius: bound.", "Force: posterior.", "Least force: 90 %.",
    ]  # fmt: skip
    curve = tuple(
        {"thickness_m": t, "ideal_m": 1e-4, "counted_m": e, "least_force_N": 0.1}
        for t, e in ((1e-3, 3e-4), (2.5e-3, 2e-4), (4e-3, None))
    )
    told = list(make_limits(radius=1.5e-3, prior="between", tip_share=0.4567, thicknesses=curve).explain())
    assert told[0].startswith("For round touches of 1.5 mm of 1.25 N in the cell beyond the centre of texel 7, and ")
    assert "measures 0.457 of the force" in told[1]
    assert told[-1] == "Best thickness for the place, as counted: 2.5 mm."


ACTIVE, TIP = np.arange(15) != 2, "through the cover, tip 1 mm"


def thicken(thickness):
    """Touches above the active texels of a cover, of 2 mm or of another thickness that weakens the forces."""
    chosen = np.flatnonzero(ACTIVE)

    def respond(points, axes, radius, among):
        return TOUCHES.respond(points, axes, radius, chosen[among]) * 2e-3 / thickness

    return replace(TOUCHES, origins=TOUCHES.origins[ACTIVE], axes=TOUCHES.axes[ACTIVE], respond=respond)


@pytest.fixture
def sensor(monkeypatch):
    """A sensor of 3 by 5 texels, one of which is off, on 2 mm: its texel forces are those of Gaussian touches."""
    monkeypatch.setattr(
        "validation.resolution.limits.find_touches", lambda cover, _sensor, _progress: thicken(cover.thickness)
    )
    array = replace(TexelArray.grid(3, 5, (2e-3, 3e-3)), active=ACTIVE)
    electronics = Electronics(
        rate_hz=100.0, sensitivity=400.0, offset=-3.0, output_max=150, calibrated=TIP, tip_share=0.45
    )
    return replace(validation.load("wts-0614-34"), name="small", array=array, electronics=electronics)


def test_limits_of_a_sensor_are_those_of_the_study_of_its_middle(sensor):
    channel = make_channel(sensor.electronics, 3e-3, ACTIVE)[0]
    found = find_limits(sensor, load=0.4, noise=3e-3)
    assert (found.sensor, found.load, found.noise, found.noise_assumed) == ("small", 0.4, 3e-3, False)
    assert (found.prior, found.radius, found.separation, found.tip_share) == ("around", 0.0, None, 0.45)
    assert (found.texel, found.by_texel, found.thicknesses) == (7, (), ())
    study = Study(touches=thicken(2e-3), channel=channel, texel=6, load=0.4)
    assert found.counted == list_limits(study, None)
    assert found.ideal == list_limits(replace(study, channel=Channel(noise=3e-3)), None)
    assert found.ideal[0].value < found.counted[0].value


def test_limits_between_texels_of_round_touches_and_of_two(sensor):
    channel = make_channel(sensor.electronics, 3e-3, ACTIVE)[0]
    found = find_limits(sensor, load=0.4, noise=3e-3, radius=0.5e-3, separation=2.5e-3, prior="between")
    study = Study(
        touches=thicken(2e-3), channel=channel, texel=6, load=0.4, radius=0.5e-3, shift=np.array([0.5, 0.5])
    )  # fmt: skip
    assert found.counted == list_limits(study, 2.5e-3)
    assert (found.prior, found.radius, found.separation) == ("between", 0.5e-3, 2.5e-3)
    assert [each.name for each in found.ideal][5:7] == ["radius", "separation"]


def test_the_map_and_the_curve_are_errors_of_place_around_each_texel_and_on_each_thickness(sensor):
    channel, load = make_channel(sensor.electronics, 3e-3, ACTIVE)[0], 0.15
    thick = (1e-3, 2.5e-3)
    found = find_limits(sensor, load=load, noise=3e-3, over_array=True, thicknesses=thick)
    assert len(found.by_texel) == 15
    assert found.by_texel[2] is None
    for texel, number in ((0, 0), (3, 2), (14, 13)):
        study = Study(touches=thicken(2e-3), channel=channel, texel=number, load=load)
        assert found.by_texel[texel] == pytest.approx(find_place_error(study, 4))
    for thickness, row in zip(thick, found.thicknesses, strict=True):
        other = Study(touches=thicken(thickness), channel=channel, texel=6, load=load)
        assert row == pytest.approx({
            "thickness_m": thickness, "ideal_m": find_place_error(replace(other, channel=Channel(noise=3e-3))),
            "counted_m": find_place_error(other),
            "least_force_N": channel.find_least_force(other.respond(np.zeros((1, 2)))[0]),
        })  # fmt: skip
    with pytest.raises(InputError, match="computed for flat covers"):
        find_limits(validation.load("phalanx"), load=1.0, thicknesses=(1e-3,))


@pytest.mark.parametrize(
    ("beside", "cell"),
    [
        ([(1.0, 0.0)], (0.5, 0.0)), ([(-1.0, 0.0)], (-0.5, 0.0)), ([(0.0, 1.0)], (0.0, 0.5)),
        ([(0.0, -1.0), (-1.0, 0.0)], (-0.5, -0.5)), ([(0.0, -1.0), (0.0, 1.0)], (0.0, 0.5)),
        # from half a pitch to one and a half along one axis, and less than half a pitch along the other
        ([(0.51, 0.49)], (0.5, 0.0)), ([(1.49, -0.49)], (0.5, 0.0)), ([(-0.51, 0.49)], (-0.5, 0.0)),
        ([(0.49, 0.0)], None), ([(1.51, 0.0)], None), ([(0.7, 0.7)], None), ([(0.4, 0.4)], None), ([], None),
    ],
)  # fmt: skip
def test_a_texel_is_next_to_another_about_a_pitch_away_along_one_axis(beside, cell):
    places = np.array([(0.0, 0.0), *beside]) * PITCH + [7e-3, -2e-3]
    count = len(places)
    touches = replace(
        TOUCHES, origins=np.column_stack([places, np.full(count, 1e-3)]), axes=np.tile(np.eye(3)[:2], (count, 1, 1))
    )  # fmt: skip
    if cell is None:
        with pytest.raises(InputError, match=r"^--prior: no texel that measures is next to texel 0"):
            find_cell(touches, 0)
    else:
        assert find_cell(touches, 0).tolist() == list(cell)
