"""Limits of sensors against closed forms, symmetry, scaling and simulated frames."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

import fastmodel
import validation
from fastmodel.signal.electronics import Electronics
from fem_reference.closed_form.layer import tabulate_texel_response
from meshes import Cover, TexelArray
from meshes.solids import fingertip, phalanx
from validation.errors import InputError
from validation.resolution.channel import Channel, make_channel
from validation.resolution.limits import Study, find_cell, find_place_error, list_limits
from validation.resolution.touches import find_touches
from validation.sensor_file import CURVED

WTS = validation.load("wts-0614-34")
NOISE = 5e-3
#: Sum of the quantiles of 0.1 % false alarms and 90 % hits.
DETECTION = 3.0902323 + 1.2815516


@pytest.fixture(scope="module")
def study():
    """Touches of 1 N above the middle texel, seen with noise alone."""
    return Study(touches=find_touches(WTS.cover, WTS), channel=Channel(noise=NOISE), texel=38, load=1.0)


@pytest.fixture(scope="module")
def counts():
    return make_channel(fastmodel.load("wts-0614-34").electronics, NOISE, WTS.array.active)[0]


def see(study, channel, **changes):
    return replace(study, channel=channel, **changes)


def by_name(study, separation=None):
    return {each.name: each for each in list_limits(study, separation)}


def test_the_least_force_is_the_closed_form_and_what_frames_show(study):
    shares = study.respond(np.zeros((1, 2)))[0]
    force = study.channel.find_least_force(shares)
    assert force == pytest.approx(DETECTION * NOISE / np.linalg.norm(shares), rel=1e-6)
    assert force == pytest.approx(27.36e-3, rel=1e-3)
    noise = NOISE * np.random.default_rng(3).standard_normal((100_000, len(shares)))
    level = norm.isf(1e-3) * NOISE * np.linalg.norm(shares)
    assert ((noise + force * shares) @ shares > level).mean() == pytest.approx(0.9, abs=0.004)
    assert (noise @ shares > level).mean() == pytest.approx(1e-3, abs=4e-4)


def test_a_dead_zone_is_passed_by_nine_frames_of_ten(study, counts):
    shares = study.respond(study.pitch[None] / 2)[0]
    force = counts.find_least_force(shares)
    frames = NOISE * np.random.default_rng(4).standard_normal((20_000, len(shares))) + force * shares
    assert (counts.electronics.counts(frames) > 0).any(axis=1).mean() == pytest.approx(0.9, abs=0.01)


def test_noise_that_is_seen_without_a_threshold_alarms_once_in_a_thousand_frames(study):
    electronics = Electronics(rate_hz=100.0, sensitivity=1000.0)
    channel, assumed = make_channel(electronics, NOISE, WTS.array.active)
    assert not assumed
    shares = study.respond(np.zeros((1, 2)))[0]
    noise = NOISE * np.random.default_rng(5).standard_normal((20_000, len(shares)))
    most = electronics.counts(noise).max(axis=1)
    level = np.quantile(most, 0.999)
    hits = (electronics.counts(noise + channel.find_least_force(shares) * shares).max(axis=1) > level).mean()
    assert hits == pytest.approx(0.9, abs=0.04)  # whole counts


@pytest.mark.parametrize("noise", [0.15e-3, 0.3e-3, 0.7e-3, 3e-3], ids="{} N".format)
def test_the_information_of_a_count_is_that_of_its_probabilities(noise):
    """A line of 1000 counts per newton, dead below 20.5 mN and full at 80 counts; counts are summed one by one."""
    electronics = Electronics(rate_hz=100.0, sensitivity=1000.0, offset=-20.0, output_max=80)
    channel = Channel(noise=noise, electronics=electronics)
    forces = np.linspace(0.015, 0.105, 61)
    edges = np.array([-np.inf, *((np.arange(1, 81) + 19.5) / 1000), np.inf])
    low, high = ((each[:, None] - forces) / noise for each in (edges[:-1], edges[1:]))
    probability = norm.cdf(high) - norm.cdf(low)
    slope = (norm.pdf(low) - norm.pdf(high)) / noise
    exact = np.where(probability > 1e-14, slope**2 / np.maximum(probability, 1e-14), 0).sum(axis=0)
    found = channel.information(forces[:, None])[:, 0]
    assert found == pytest.approx(exact, rel=0.04, abs=4e-3 / noise**2)


@pytest.mark.slow
def test_the_posterior_is_the_bound_where_the_bound_counts(study):
    gains = tuple(np.random.default_rng(1).uniform(0.8, 1.2, WTS.array.count).tolist())
    electronics = Electronics(rate_hz=100.0, sensitivity=1000.0, offset=50.0, gains=gains)
    for channel in (study.channel, make_channel(electronics, NOISE, WTS.array.active)[0]):
        for known in (True, False):
            bound, posterior, regular = see(study, channel).list_places(known=known)
            assert regular.all()
            size = 2 if known else 3
            ratio = np.sqrt(posterior.mean(axis=0)[:size] / bound.mean(axis=0)[:size])
            assert ratio == pytest.approx(1.0, abs=0.05)


def draw_study(seed):
    """Draw a flat sensor, a texel and a load, and a place of the touch."""
    rng = np.random.default_rng(seed)
    pitch = rng.uniform(2e-3, 5e-3)
    layer = replace(WTS.cover.layers[0], thickness=pitch * rng.uniform(0.6, 1.5))
    ratio = rng.uniform(0.3, 0.499)
    cover = Cover(layers=(replace(layer, material=replace(layer.material, poisson_ratio=ratio)),))
    array = TexelArray.grid(*rng.integers(5, 9, 2), pitch, texel_size=pitch * rng.uniform(0.7, 1.0))
    touches = find_touches(cover, replace(WTS, array=array, cover=cover))
    texel, load = int(rng.integers(array.count)), rng.uniform(1, 3)
    study = Study(touches=touches, channel=Channel(noise=2e-3), texel=texel, load=load)
    return study, rng.uniform(-0.45, 0.45, 2) * study.pitch


def draw_curved_study(seed):
    """Draw a sensor on a cylinder or on a fingertip, with free sides and one coarse mesh, and a place of a touch."""
    rng = np.random.default_rng(seed)
    pitch = rng.uniform(2.5e-3, 4e-3)
    thickness, radius = pitch * rng.uniform(0.6, 1.2), pitch * rng.uniform(2, 5)
    if seed % 3:
        size = {"angle": 4 * pitch / radius, "length": 4 * pitch}
        pad = phalanx(radius=radius, rows=3, columns=3, pitch=pitch, thickness=thickness, **size)
    else:
        pad = fingertip(radius=radius / 2, length=2 * pitch, pitch=pitch, thickness=thickness)
    given = CURVED["phalanx"]
    rubber = replace(given.cover.layers[0].material, poisson_ratio=rng.uniform(0.3, 0.49))
    cover = replace(
        given.cover,
        layers=(replace(given.cover.layers[0], thickness=thickness, material=rubber),),
        make=lambda *_: (pad.mesh(thickness / 2, layers=2),),
        refine=None,
        _made={},
    )
    touches = find_touches(cover, replace(given, array=pad.texels, cover=cover))
    load = rng.uniform(1, 3)
    while True:  # until the bound counts; it does not at the rim of the cover
        texel, place = int(rng.integers(pad.texels.count)), rng.uniform(-0.45, 0.45, 2) * touches.pitch
        study = Study(touches=touches, channel=Channel(noise=0.3e-3), texel=texel, load=load)
        errors = np.sqrt(np.diagonal(study.bound(place[None], 2)[0], axis1=1, axis2=2))
        if study.judge(load * study.respond(place[None]), errors).all():
            return study, place


def estimate(study, place, frames):
    """Estimate x, y and force of simulated frames by least squares; return their deviations from the truth."""
    exact = study.load * study.respond(place[None])[0]
    seen = exact + study.channel.noise * np.random.default_rng(6).standard_normal((frames, len(exact)))
    found = np.tile([*place, study.load], (frames, 1))
    for _ in range(4):
        slopes = study.find_slopes(found[:, :2])[..., :3]
        slopes[..., :2] *= found[:, 2, None, None] / study.load
        left = seen - found[:, [2]] * slopes[..., 2]
        normal = np.einsum("kna,knb->kab", slopes, slopes)
        found += np.linalg.solve(normal, np.einsum("kna,kn->ka", slopes, left)[..., None])[..., 0]
    return found - [*place, study.load]


def check_likelihood(study, place, frames=1500):
    covariance, _ = study.bound(place[None], 3)
    spread = np.sqrt((estimate(study, place, frames) ** 2).mean(axis=0))
    assert spread / np.sqrt(np.diagonal(covariance[0])) == pytest.approx(1.0, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("sensor", ["wts-0614-34", "sdh2-distal"])
def test_the_most_likely_place_and_force_reach_the_bound(sensor):
    found = validation.load(sensor)
    touches = find_touches(found.cover, found)
    study = Study(touches=touches, channel=Channel(noise=2e-3), texel=len(touches.origins) // 2, load=2.0)
    check_likelihood(study, 0.2 * study.pitch)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_the_most_likely_place_and_force_reach_the_bound_on_drawn_sensors(seed):
    study, place = draw_study(seed)
    errors = np.sqrt(np.diagonal(study.bound(place[None], 2)[0], axis1=1, axis2=2))
    assert study.judge(study.load * study.respond(place[None]), errors).all()
    check_likelihood(study, place, 4000)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_the_most_likely_place_and_force_reach_the_bound_on_drawn_curved_sensors(seed):
    check_likelihood(*draw_curved_study(seed), 2000)


@pytest.mark.slow
def test_the_most_likely_place_and_force_reach_the_bound_on_a_curved_cover(small_pad):
    study = Study(touches=find_touches(small_pad.cover, small_pad), channel=Channel(noise=2e-3), texel=4, load=2.0)
    check_likelihood(study, 0.1 * study.pitch)


def test_mirrored_touches_have_mirrored_limits(study, counts):
    rows, columns = WTS.array.rows, WTS.array.columns
    for row, column in ((0, 0), (3, 1)):
        texel, turned = (r * columns + c for r, c in ((row, column), (rows - 1 - row, columns - 1 - column)))
        first, second = (
            see(study, study.channel, texel=each).bound(sign * study.places, 3)[0]
            for each, sign in ((texel, 1), (turned, -1))
        )
        assert np.diagonal(first, axis1=1, axis2=2) == pytest.approx(np.diagonal(second, axis1=1, axis2=2), rel=1e-6)
        errors = [find_place_error(see(study, counts, texel=each)) for each in (texel, turned)]
        assert errors[0] == pytest.approx(errors[1], rel=0.05)  # other noise


@pytest.mark.slow
def test_errors_and_least_force_are_proportional_to_the_noise(study):
    def list_errors(noise, load):
        seen = see(study, Channel(noise=noise), radius=2e-3, load=load)
        errors = np.sqrt(np.diagonal(seen.bound(seen.places, 3)[0], axis1=1, axis2=2))
        return np.column_stack([errors, seen.bound_radius()[0], seen.bound_separation(6e-3)[0]])

    once = list_errors(1e-3, 1.0)
    assert list_errors(2e-3, 1.0) == pytest.approx(2 * once, rel=1e-6)
    # With the load, lengths are told better and the force as before.
    assert list_errors(1e-3, 2.0) * [2, 2, 1, 2, 2] == pytest.approx(once, rel=1e-6)
    shares = study.respond(np.zeros((1, 2)))[0]
    least = [Channel(noise=noise).find_least_force(shares) for noise in (1e-3, 3e-3)]
    assert least[1] == pytest.approx(3 * least[0])


@pytest.mark.slow
def test_a_single_texel_knows_a_pitch_and_no_more(study, counts):
    unknown = study.pitch[0] / np.sqrt(12)
    dark, one = (by_name(see(study, counts, load=load))["place x, force known"] for load in (0.1, 0.3))
    for found in (dark, one):
        assert (found.bound, found.counts) == (None, "posterior")
    assert dark.value == pytest.approx(unknown, rel=1e-3)
    assert one.value == pytest.approx(unknown, rel=0.03)
    alone = by_name(see(study, counts, load=0.3), 3e-3)
    assert "radius" not in alone
    alone = by_name(see(study, counts, load=0.3, radius=1e-3), 3e-3)
    assert {alone[name].value for name in ("radius", "separation")} == {None}
    assert alone["radius"].counts == "singular at 16 of 16 places"


@pytest.mark.parametrize(("thickness", "error"), [(1e-3, 402e-6), (2e-3, 429e-6), (5e-3, 990e-6)])
def test_a_touch_between_texels_is_told_by_those_around_it(study, counts, thickness, error):
    """Root mean square error of 0.3 N in the cell between texels, by a posterior on another grid with other frames."""
    cover = replace(WTS.cover, layers=(replace(WTS.cover.layers[0], thickness=thickness),))
    seen = see(study, counts, touches=find_touches(cover, WTS), load=0.3, shift=0.5)
    assert find_place_error(seen) == pytest.approx(error, rel=0.05)


@pytest.mark.parametrize(("rows", "columns"), [(1, 5), (5, 1), (1, 2), (2, 2), (3, 4)])
def test_a_cell_between_texels_lies_within_the_array(rows, columns):
    """Its middle is that of two neighbours along each axis that has several, and its places are nearer to no other."""
    array = TexelArray.grid(rows, columns, WTS.array.pitch, texel_size=WTS.array.texel_size)
    sensor = replace(WTS, array=array)
    for texel in range(array.count):
        touches = find_touches(WTS.cover, sensor)
        seen = Study(
            touches=touches, channel=Channel(noise=NOISE), texel=texel, load=1.0, shift=find_cell(touches, texel)
        )
        middle = array.centres[texel, :2] + np.mean(seen.ends, axis=0)
        reach = np.sort(np.linalg.norm(array.centres[:, :2] - middle, axis=1))
        corners = 2 if 1 in (rows, columns) else 4
        assert reach[:corners] == pytest.approx(np.full(corners, array.pitch[0] * (0.5 if corners == 2 else 0.5**0.5)))
        assert (np.abs(array.centres[texel, :2] + seen.places) < np.array(array.extent) / 2 + 1e-9).all()


def test_one_texel_has_no_cell_between():
    sensor = replace(WTS, array=TexelArray.grid(1, 1, WTS.array.pitch, texel_size=WTS.array.texel_size))
    with pytest.raises(InputError, match="--prior: no texel that measures is next to texel 0"):
        find_cell(find_touches(sensor.cover, sensor), 0)


@pytest.mark.slow
def test_a_round_touch_is_the_sum_of_its_points():
    radius, place = 1.7e-3, np.array([0.6e-3, -0.4e-3])
    nodes, weights = np.polynomial.legendre.leggauss(40)
    part = (nodes + 1) / 2
    r, turn = radius * np.sqrt(1 - part ** (2 / 3)), 2 * np.pi * np.arange(48) / 48  # equal parts of the force
    point, whole = (tabulate_texel_response(WTS.cover, WTS.array.texel_size, each) for each in (0.0, radius))
    shares = point(place[0] + np.outer(r, np.cos(turn)), place[1] + np.outer(r, np.sin(turn)))
    assert whole(place[[0]], place[[1]])[0] == pytest.approx(float(weights / 2 @ shares.mean(axis=1)), rel=1e-4)
    coarse = find_touches(WTS.cover, WTS).forces(38, place[None], radius)[0, 38]
    assert coarse == pytest.approx(whole(place[[0]], place[[1]])[0], rel=1e-9)


@pytest.mark.slow
def test_the_command_the_function_and_the_map_agree(softcover, tmp_path):
    words = "limits wts-0614-34 --noise 5mN --load 2N --two 6mm --thicknesses 1mm:4mm --picture map.png --json"
    status, out, _ = softcover(*words.split())
    printed = json.loads(out)
    assert status == 0
    assert (tmp_path / "map.png").read_bytes()[:4] == b"\x89PNG"
    found = validation.limits("wts-0614-34", noise="5 mN", load="2 N", two="6 mm", thicknesses="1mm:4mm")
    assert printed | {"by_texel": []} == found.as_json()
    assert len(printed["by_texel"]) == WTS.array.count
    middle = next(each["value"] for each in printed["counted"] if each["name"] == "place x, force known")
    assert printed["by_texel"][printed["texel"]] == pytest.approx(middle, rel=0.1)
    assert printed["thicknesses"][0]["thickness_m"] == 1e-3


@pytest.mark.slow
def test_a_sensor_without_noise_is_said_to_have_one_count(softcover):
    status, out, _ = softcover("limits", "wts-0614-34")
    assert status == 0
    assert "one count, because the sensor states none; give yours with --noise" in " ".join(out.split())


def test_counts_that_fall_or_are_too_many_are_refused():
    falling = Electronics(rate_hz=100.0, sensitivity=1.0, characteristic=(0.0, 1000.0, -300.0, 0.0, 0.0, 0.0))
    fine = Electronics(rate_hz=100.0, sensitivity=1e6, bits=24, output_max=2**24 - 1)
    for electronics, words in ((falling, "must not fall"), (fine, "up to 65535 counts")):
        with pytest.raises(InputError, match=words):
            make_channel(electronics, NOISE, np.ones(3, dtype=bool))[0].edges  # noqa: B018 -- raises


def test_a_load_that_no_texel_shows_leaves_what_the_prior_knows():
    found = {each.name: each.value for each in validation.limits("wts-0614-34", load="0.01 N", noise="5 mN").counted}
    assert found["place x, force known"] == pytest.approx(3.4e-3 / 12**0.5, rel=1e-3)
