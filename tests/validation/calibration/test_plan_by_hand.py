"""Information of touches against plain matrices, their choice against all choices, and what a plan says."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

import validation
from fastmodel.signal.electronics import TEXEL_FORCE, Electronics
from meshes import Cover, Layer, Material, TexelArray
from validation.calibration.next_touches import (
    Covers,
    Errors,
    Expected,
    NextTouches,
    Plan,
    Response,
    Touch,
    exchange,
    inform,
    plan_touches,
)
from validation.errors import InputError
from validation.resolution.channel import Channel

WTS = validation.load("wts-0614-34")
ERRORS = Errors(place=0.15e-3, shift=0.4e-3, force=0.03)
CHANNEL = Channel(noise=4e-3)
#: Two layers, whose Poisson ratios lie far from 0.5 and close to it.
COVER = Cover(layers=tuple(
    Layer(thickness=thick, material=Material(name="m", model="linear-elastic", poisson_ratio=ratio,
                                             parameters={"youngs_modulus": modulus}))
    for thick, modulus, ratio in ((0.7e-3, 1e6, 0.4), (1.4e-3, 3e6, 0.4995))
))  # fmt: skip
PAIR = replace(
    WTS, cover=COVER, array=TexelArray.grid(1, 3, (3e-3, 4e-3), texel_size=(2.4e-3, 3.5e-3), active=[[1, 0, 1]]),
    electronics=Electronics(rate_hz=271.0, sensitivity=2e3, offset=0.0, calibrated=TEXEL_FORCE),
)  # fmt: skip


def respond(seed=4, count=3, texels=5):
    """A made-up response, whose last texel feels next to nothing."""
    random = np.random.default_rng(seed)
    size = np.array([*np.ones(texels - 1), 1e-3])
    return Response(
        shares=random.uniform(0.2, 1, (count, texels)) * size,
        moved=random.normal(0, 300, (count, texels, 2)) * size[:, None],
        cover=random.normal(0, 0.4, (count, texels, 2)) * size[:, None],
    )


@pytest.mark.parametrize("errors", [ERRORS, Errors(place=0.0, shift=1.0, force=0.2), replace(ERRORS, force=0.0)])
def test_information_is_that_of_texels_with_common_errors_of_the_touch(errors):
    response, loads = respond(), np.array([0.5, 1.3, 2.0])
    roots = inform(response, loads, CHANNEL, errors)
    assert roots.shape == (3, 4, 9)  # the fifth texel tells nothing
    for touch, newtons in enumerate(loads):
        forces = newtons * response.shares[touch, :4]
        moved = newtons * response.moved[touch, :4]
        slopes = np.hstack([np.diag(forces), np.zeros((4, 1)), newtons * response.cover[touch, :4], moved])
        noise = 4e-3**2 * np.eye(4) + errors.force**2 * np.outer(forces, forces) + errors.place**2 * moved @ moved.T
        expected = slopes.T @ np.linalg.inv(noise) @ slopes
        np.testing.assert_allclose(roots[touch].T @ roots[touch], expected, rtol=1e-8, atol=1e-6 * expected.max())


@pytest.mark.parametrize(("tells", "rows"), [("shares", 5), ("moved", 5), ("cover", 5), (None, 4)])
def test_a_texel_counts_if_it_tells_a_thousandth_of_anything(tells, rows):
    """Information goes with the square of a slope: 0.033 of the largest slope is enough, 0.03 is not."""
    response = respond()
    for name in ("shares", "moved", "cover"):
        values = getattr(response, name)
        largest = np.abs(values[0, :4]).max(axis=0)
        values[0, 4] = (0.033 if name == tells else 0.03) * largest
        values[1:, 4] = 0.0
    assert inform(response, np.ones(3), CHANNEL, ERRORS).shape[1] == rows


@pytest.mark.parametrize(("count", "first"), [(1, ()), (2, ()), (3, ()), (3, (0, 1)), (3, (5, 5, 5))])
def test_an_exchange_finds_the_best_of_all_choices(count, first):
    random = np.random.default_rng(7)
    roots = random.normal(size=(8, 2, 4)) * random.uniform(0.2, 3, (8, 1, 1))
    start, weights = np.diag([1.0, 2.0, 0.5, 1.5]), np.array([1.0, 0.3, 0.0, 2.0])

    def cost(chosen):
        return weights @ np.diag(np.linalg.inv(start + sum(roots[k].T @ roots[k] for k in chosen)))

    found = exchange(start, roots, weights, count, first)
    assert len(found) == count
    best = min(map(cost, itertools.combinations_with_replacement(range(8), count)))
    assert cost(found) == pytest.approx(best, rel=2e-3)
    assert start.tolist() == np.diag([1.0, 2.0, 0.5, 1.5]).tolist()


def test_equivalent_candidates_are_taken_in_their_order():
    roots = np.array([[[0.0, 0.5]], [[0.0, 2.0]], [[0.0, 2.0 * (1 + 1e-9)]], [[0.0, -2.0]]])
    assert exchange(np.eye(2), roots, np.ones(2), 2, ()) == [1, 1]


@pytest.fixture(scope="module")
def covers():
    return Covers(PAIR)


@pytest.fixture(scope="module")
def plan(covers):
    return Plan(covers, CHANNEL, ERRORS, load=0.7, radius=0.8e-3, wanted=("thickness", "gains", "poisson"))


def test_covers_change_in_thickness_and_poisson_ratio(covers):
    place = np.array([[0.3e-3, -0.6e-3]])
    for factor, raised, ratios in ((1.3, 0.0, (0.4, 0.4995)), (1.0, -0.01, (0.39, 0.4895)), (0.8, 0.05, (0.45, 0.5))):
        layers = tuple(
            replace(each, thickness=factor * each.thickness, material=each.material.with_poisson_ratio(ratio))
            for each, ratio in zip(COVER.layers, ratios, strict=True)
        )
        alone = Covers(replace(PAIR, cover=replace(COVER, layers=layers))).main
        found = covers.change(factor, raised)
        assert found.forces(1, place, 0.5e-3) == pytest.approx(alone.forces(1, place, 0.5e-3), rel=1e-6)
        assert covers.change(factor, raised) is found
    assert covers.change(1.0, 0.0) is covers.main


def test_a_response_has_the_slopes_of_the_forces(covers):
    places, radius = np.array([[0.3e-3, -0.9e-3], [-0.8e-3, 0.2e-3]]), 0.6e-3
    found = covers.respond(1, places, radius)
    np.testing.assert_allclose(found.shares, covers.main.forces(1, places, radius))
    for axis in (0, 1):
        by = 2e-5 * np.eye(2)[axis]
        slope = (covers.main.forces(1, places + by, radius) - covers.main.forces(1, places - by, radius)) / 4e-5
        np.testing.assert_allclose(found.moved[..., axis], slope, rtol=0.02, atol=1e-2 * np.abs(slope).max())
    thick, thin = (covers.change(factor, 0.0).forces(1, places, radius) for factor in (1.02, 1 / 1.02))
    np.testing.assert_allclose(found.cover[..., 0], (thick - thin) / (2 * np.log(1.02)), rtol=0.02, atol=1e-4)
    low = covers.change(1.0, -0.002).forces(1, places, radius)
    np.testing.assert_allclose(found.cover[..., 1], (found.shares - low) / 0.002, rtol=0.2, atol=1e-3)


@pytest.mark.parametrize(
    ("wanted", "shift", "deviations", "weights"),
    [
        (("gains", "thickness"), 0.4e-3, [0.2, 0.2, 0.5, 0.4e-3, 0.4e-3], [0.5, 0.5, 1, 0, 0]),
        (("thickness", "poisson"), 0.1e-3, [0.2, 0.2, 0.5, 0.1, 0.1e-3, 0.1e-3], [0, 0, 1, 1, 0, 0]),
        (("gains",), 0.0, [0.2, 0.2, 0.5], [0.5, 0.5, 0]),
    ],
)
def test_priors_and_weights_follow_from_what_is_wanted(covers, wanted, shift, deviations, weights):
    made = Plan(covers, CHANNEL, replace(ERRORS, shift=shift), load=0.7, radius=0.8e-3, wanted=wanted)
    np.testing.assert_allclose(made.prior, np.diag(np.array(deviations) ** -2.0))
    np.testing.assert_allclose(made.wanted, weights)
    assert made.free.sum() == len(weights)


def test_candidates_are_judged_one_standard_deviation_beside_their_place(covers, plan):
    beside = np.hypot(0.15e-3, 0.4e-3)
    texel, place = plan.spots[2, 3], plan.spots[2, 4:]
    expected = covers.respond(int(texel), place[None] + beside, 0.8e-3)
    np.testing.assert_allclose(plan.response.shares[2], expected.shares[0])
    roots = inform(plan.response, np.full(len(plan.spots), 0.7), CHANNEL, ERRORS)
    np.testing.assert_allclose(plan.roots, roots)
    origins = covers.main.origins[plan.spots[:, 3].astype(int)]
    np.testing.assert_allclose(plan.spots[:, :2], origins[:, :2] + plan.spots[:, 4:], atol=1e-7)
    assert len(plan.spots) == 18  # two texels that are not neighbours share no place
    assert set(np.round(1e3 * np.abs(plan.spots[:, 4]), 6)) == {0.0, 1.5}
    assert set(np.round(1e3 * np.abs(plan.spots[:, 5]), 6)) == {0.0, 2.0}
    assert np.all(np.diff(plan.spots[:, 3]) >= 0)


def test_information_is_added_of_what_is_free(plan):
    chosen = [3, 3, 7]
    rows = plan.roots[chosen][..., plan.free]
    expected = plan.prior + sum(each.T @ each for each in rows)
    np.testing.assert_allclose(plan.add(plan.prior, plan.roots[chosen]), expected)


@pytest.mark.parametrize("count", [1, 3])
def test_the_better_of_two_choices_is_taken(plan, count):
    def cost(chosen):
        return plan.wanted @ np.diag(np.linalg.inv(plan.add(plan.prior, plan.roots[list(chosen)])))

    found = plan.choose(plan.prior, count)
    best = min(map(cost, itertools.combinations_with_replacement(range(18), count)))
    assert len(found) == count
    assert cost(found) == pytest.approx(best, rel=0.01)


def make_information(*deviations):
    return np.diag(np.array(deviations) ** -2.0)


def test_what_is_known_follows_from_the_information(plan):
    """Gains, thickness, Poisson ratio and shift of known errors; the prior of gains counts a 900th for judgement."""
    before = make_information(0.15, 0.1, 0.24, 0.06, 0.3e-3, 0.2e-3)
    after = make_information(0.05, 0.08, 0.1, 0.04, 0.1e-3, 0.15e-3)
    rows = {each.name: each for each in plan.expect(before, after)}
    factor = 1.959964
    assert list(rows) == ["gains", "worst gain", "thickness", "poisson", "shift"]
    expected = {
        "gains": (np.hypot(0.15, 0.1) / 2**0.5, np.hypot(0.05, 0.08) / 2**0.5), "worst gain": (0.15, 0.08),
        "thickness": (0.24, 0.1), "poisson": (0.06, 0.04), "shift": (0.3e-3, 0.15e-3),
    }  # fmt: skip
    for name, widths in expected.items():
        assert (rows[name].before, rows[name].after) == pytest.approx((factor * widths[0], factor * widths[1])), name
        assert rows[name].unit == ("m" if name == "shift" else "-")

    def loosen(*deviations):
        return [(each**-2.0 - (1 - 1 / 900) * 0.2**-2.0) ** -0.5 for each in deviations]

    loose = [loosen(0.15, 0.1), loosen(0.05, 0.08)]
    known = [np.sqrt(np.mean(np.square(each))) < 0.1 for each in loose]
    assert (rows["gains"].known, rows["gains"].identified) == tuple(known) == (False, True)
    assert (rows["worst gain"].known, rows["worst gain"].identified) == tuple(max(each) < 0.1 for each in loose)
    assert (rows["thickness"].known, rows["thickness"].identified) == (True, True)  # below 0.25
    assert (rows["poisson"].known, rows["poisson"].identified) == (False, True)  # 0.05
    assert (rows["shift"].known, rows["shift"].identified) == (True, True)


@pytest.mark.parametrize(("thickness", "known"), [(0.2499, True), (0.2501, False)])
def test_half_of_the_prior_is_known(plan, thickness, known):
    state = make_information(0.05, 0.05, thickness, 0.09, 1e-3, 1e-3)
    rows = {each.name: each for each in plan.expect(state, state)}
    assert (rows["thickness"].known, rows["thickness"].identified) == (known, known)


def test_planned_touches_are_the_chosen_places_in_a_drawn_order():
    said = []
    found = plan_touches(
        PAIR, 6, errors=ERRORS, load=0.7, radius=0.8e-3, noise=4e-3, wanted=("thickness", "gains", "poisson"),
        progress=said.append,
    )  # fmt: skip
    made = Plan(Covers(PAIR), replace(CHANNEL, electronics=PAIR.electronics), ERRORS, load=0.7, radius=0.8e-3,
                wanted=("thickness", "gains", "poisson"))  # fmt: skip
    chosen = made.choose(made.prior, 6)
    places = sorted(tuple(made.spots[each, :3]) for each in chosen)
    np.testing.assert_allclose(sorted(each.at for each in found.touches), places)
    assert {each.texel for each in found.touches} <= {0, 2}  # the one in the middle is off
    assert {each.load for each in found.touches} == {0.7}
    for each in found.touches:
        assert np.abs(each.at[:2] - PAIR.array.centres[each.texel, :2]).max() < 2.1e-3
    assert (found.sensor, found.radius, found.noise, found.noise_assumed) == (PAIR.name, 0.8e-3, 4e-3, False)
    assert found.earlier == 0
    assert said[-1] == "choice of 6 touches from 18 places"
    assert [each.before for each in found.expected] == pytest.approx([1.959964 * each for each in
                                                                     (0.2, 0.2, 0.5, 0.1, 0.4e-3)])  # fmt: skip
    assert all(each.after < each.before for each in found.expected)


def test_the_noise_of_a_count_is_assumed_and_earlier_touches_count():
    earlier = np.array([[0.2e-3, -0.3e-3, 0.9, 0.5e-3], [-3e-3, 0.1e-3, 1.1, 0.0]])
    found = plan_touches(PAIR, 2, errors=ERRORS, load=0.7, radius=0.8e-3, earlier=earlier)
    assert (found.earlier, found.noise_assumed) == (2, True)
    assert found.noise == pytest.approx(1 / 2e3)
    names = [each.name for each in found.expected]
    assert names == ["gains", "worst gain", "thickness", "shift"]
    covers = Covers(PAIR)
    channel = replace(CHANNEL, noise=1 / 2e3, electronics=PAIR.electronics)
    made = Plan(covers, channel, ERRORS, load=0.7, radius=0.8e-3, wanted=("gains", "thickness"))
    state = made.prior
    for x, y, force, radius in earlier:
        place = np.array([[x, y]]) - covers.main.origins[0, :2]
        state = made.add(state, inform(covers.respond(0, place, radius), np.array([force]), channel, ERRORS))
    expected = made.expect(state, state)
    assert [each.before for each in found.expected] == pytest.approx([each.before for each in expected])
    assert found.expected[2].before < 0.9 * 1.959964 * 0.5


def test_a_touch_that_no_texel_shows_is_refused():
    with pytest.raises(InputError, match=r"--load: no texel shows a touch of 1e-06 N; give a larger load"):
        plan_touches(PAIR, 2, errors=ERRORS, load=1e-6, radius=0.8e-3, noise=4e-3)


def make(expected, **options):
    touches = (Touch(texel=1, at=(1.23456e-3, -0.5e-3, 2e-3), load=1.5),) * 3
    return NextTouches(**{"sensor": "pad", "radius": 1.25e-3, "noise": 4.56e-3, "noise_assumed": False, "earlier": 0,
                          "touches": touches, "expected": expected} | options)  # fmt: skip


def judge(name, when, unit="-"):
    """A quantity that is known "before" or "after" the touches, or "never"."""
    return Expected(
        name=name, before=0.2, after=0.1, unit=unit, known=when == "before", identified=when in ("before", "after")
    )


def test_what_stays_unknown_is_said():
    rows = (judge("a", "never"), judge("b", "after"), judge("c", "before"), judge("d", "never", "m"))
    first, *others = make(rows).explain()
    assert first == (
        "3 touches with a loaded circle of 1.25 mm radius, after 0 earlier ones; noise of 4.56 mN. Their order is "
        "drawn, so that drift is no pattern over the array."
    )
    assert others == ["Not identifiable from these touches, and bounded by the prior alone: a."]
    _, _, changed = make(rows, earlier=7, noise_assumed=True).explain()
    assert changed == (
        "Not identifiable from the earlier touches: b. These touches change that; the first is at 1.23, -0.5 mm."
    )
    assert len(list(make((judge("c", "before"),), earlier=7).explain())) == 1
    assert "one count, because the sensor states none" in next(make(rows, noise_assumed=True).explain())


def test_half_widths_are_listed_in_percent_micrometres_or_as_numbers():
    rows = tuple(
        Expected(name=name, before=before, after=after, unit=unit, known=True, identified=True)
        for name, before, after, unit in (("gains", 0.23456, 0.012345, "-"), ("poisson", 0.0456789, 0.00123, "-"),
                                          ("shift", 3.21e-4, 9.876e-6, "m"))
    )  # fmt: skip
    assert list(make(rows).list_expected()) == [
        ("gains", "+-23.5 %", "+-1.23 %"), ("poisson", "+-0.0457", "+-0.00123"), ("shift", "+-321 um", "+-9.88 um")
    ]  # fmt: skip
