"""Planned touches against the joint information of all unknowns, all choices of a small problem, and simulated fits."""

import csv
import itertools
import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import least_squares

import validation
from fastmodel.signal.electronics import TEXEL_FORCE, Electronics
from meshes import TexelArray
from validation.calibration.next_touches import GAIN, THICKNESS, Covers, Errors, Plan, exchange, inform
from validation.cli import main
from validation.errors import InputError
from validation.resolution.channel import Channel

WTS = validation.load("wts-0614-34")
#: An array of 3 x 4 oblong texels that are smaller than their pitches, one of them switched off.
ARRAY = TexelArray.grid(
    3, 4, (3e-3, 4e-3), texel_size=(2.4e-3, 3.5e-3), active=[[1, 1, 1, 1], [1, 1, 0, 1], [1, 1, 1, 1]]
)
ELECTRONICS = Electronics(rate_hz=271.0, sensitivity=2e3, offset=0.0, calibrated=TEXEL_FORCE)
SMALL = replace(WTS, array=ARRAY, electronics=ELECTRONICS)
CHANNEL = Channel(noise=4e-3)
ERRORS = Errors(place=0.15e-3, shift=0.4e-3, force=0.02)
RADIUS, LOAD = 0.8e-3, 0.7


@pytest.fixture(scope="module")
def covers():
    return Covers(SMALL)


@pytest.fixture(scope="module")
def plan(covers):
    return Plan(covers, CHANNEL, ERRORS, load=LOAD, radius=RADIUS, wanted=("gains", "thickness"))


def run(arguments):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    return ended.value.code or 0


def expected(found):
    return {each.name: each for each in found.expected}


def test_errors_of_a_touch_are_eliminated_as_in_the_joint_matrix(covers, plan):
    texels = len(covers.main.origins)
    place = np.array([[0.4e-3, -0.9e-3]])

    def force(x, y, thickness, poisson, factor):
        cover = covers.change(thickness, poisson)
        return LOAD * factor * cover.forces(4, place + np.array([x, y]), RADIUS)[0]

    base = np.array([0.0, 0.0, 1.0, 0.0, 1.0])
    steps = np.array([2e-5, 2e-5, 0.02, 0.0, 1e-3])
    slopes = {}
    for index in (0, 1, 2, 4):
        by = np.eye(5)[index] * steps
        slopes[index] = (force(*(base + by)) - force(*(base - by))) / (2 * steps[index])
    lower = force(0, 0, 1.0, -0.0008, 1.0)
    rows = np.zeros((texels, texels + 4 + 3))
    rows[np.arange(texels), np.arange(texels)] = force(*base)
    rows[:, texels] = slopes[2]
    rows[:, texels + 1] = (force(*base) - lower) / 0.0008
    rows[:, texels + 2] = rows[:, texels + 4] = slopes[0]
    rows[:, texels + 3] = rows[:, texels + 5] = slopes[1]
    rows[:, texels + 6] = slopes[4]
    own = np.diag([0.0] * (texels + 4) + [ERRORS.place**-2, ERRORS.place**-2, ERRORS.force**-2])
    joint = rows.T @ rows / CHANNEL.noise**2 + own
    kept, dropped = slice(0, texels + 4), slice(texels + 4, None)
    wanted = joint[kept, kept] - joint[kept, dropped] @ np.linalg.solve(joint[dropped, dropped], joint[dropped, kept])
    root = inform(covers.respond(4, place, RADIUS), np.array([LOAD]), CHANNEL, ERRORS)[0]
    found = root.T @ root
    scale = np.sqrt(np.diag(wanted))
    assert np.abs(found - wanted).max() < 1e-2 * np.abs(wanted).max()
    strong = [*np.flatnonzero(scale[:texels] > 0.1 * scale[:texels].max()).tolist(), *range(texels, texels + 4)]
    chosen = np.ix_(strong, strong)
    np.testing.assert_allclose(
        (found / np.outer(scale, scale))[chosen], (wanted / np.outer(scale, scale))[chosen], atol=0.02
    )


def test_two_touches_of_a_small_problem_are_the_best_of_all_pairs(plan):
    roots = plan.roots[::7][..., plan.free]

    def cost(chosen):
        information = plan.prior + sum(roots[each].T @ roots[each] for each in chosen)
        return plan.wanted @ np.diag(np.linalg.inv(information))

    best = min(itertools.combinations_with_replacement(range(len(roots)), 2), key=cost)
    assert cost(exchange(plan.prior, roots, plan.wanted, 2, ())) == pytest.approx(cost(best), rel=1e-9)


def test_one_texel_and_no_other_errors_have_the_closed_form():
    one = replace(SMALL, array=TexelArray.grid(1, 1, (2e-3, 2e-3)))
    none = Errors(place=0.0, shift=0.0, force=0.0)
    plan = Plan(Covers(one), CHANNEL, none, load=LOAD, radius=RADIUS, wanted=("gains",))
    centre = int(np.flatnonzero((plan.spots[:, 4:] == 0).all(axis=1))[0])
    share, thinner = plan.response.shares[centre, 0], plan.response.cover[centre, 0, 0]
    times = 5
    slope = LOAD / CHANNEL.noise * np.array([share, thinner])
    wanted = np.linalg.inv(times * np.outer(slope, slope) + np.diag([GAIN**-2, THICKNESS**-2]))
    after = plan.add(plan.prior, plan.roots[[centre] * times])
    widths = {each.name: each.after for each in plan.expect(plan.prior, after)}
    assert widths["gains"] == pytest.approx(1.959964 * wanted[0, 0] ** 0.5, rel=1e-6)
    assert widths["thickness"] == pytest.approx(1.959964 * wanted[1, 1] ** 0.5, rel=1e-6)
    assert thinner < 0 < share


def test_every_place_over_and_between_texels_that_measure_is_a_candidate_once(plan):
    centres = ARRAY.centres[ARRAY.active, :2]
    half = np.array([[x, y] for x in (-1, 0, 1) for y in (-1, 0, 1)]) * (1.5e-3, 2e-3)
    wanted = {tuple(np.round(1e6 * (centre + by)).astype(int)) for centre in centres for by in half}
    found = [tuple(each) for each in np.round(1e6 * plan.spots[:, :2]).astype(int)]
    assert len(found) == len(set(found))
    assert set(found) == wanted


@pytest.mark.slow
def test_thirty_six_touches_settle_gains_and_thickness_of_as_many_texels():
    square = replace(WTS, electronics=ELECTRONICS, array=TexelArray.grid(6, 6, 3.4e-3))
    found = validation.next_touches(square, 36, noise="5 mN", shift_error="0.1 mm")
    widths = expected(found)
    # Standard deviations of below 1.5 % and 1 %.
    assert widths["gains"].after / 1.96 < 0.015
    assert widths["thickness"].after / 1.96 < 0.01
    assert all(each.identified for each in found.expected)
    beside = np.array([each.at for each in found.touches]) - square.array.centres[[t.texel for t in found.touches]]
    np.testing.assert_allclose(beside[:, 2], WTS.cover.thickness)
    assert set(np.round(np.abs(beside[:, :2]) / 1.7e-3, 6).ravel()) <= {0.0, 1.0}
    assert {each.load for each in found.touches} == {1.0}


def test_touches_in_one_place_do_not_settle_the_cover_and_the_next_ones_do():
    rows = [[0.3e-3, -0.2e-3, load, 4e-3] for load in (1.0, 2.0, 4.0, 6.0, 8.0)] * 6
    stamp = SimpleNamespace(touches=np.array(rows))
    found = validation.next_touches(SMALL, 12, after=stamp, noise="4 mN", load="2 N")
    assert found.earlier == 30
    gains, thickness = (expected(found)[name] for name in ("gains", "thickness"))
    assert not gains.known
    assert not thickness.known
    assert gains.identified
    assert thickness.identified
    assert gains.after < gains.before / 4
    assert any(
        "earlier touches: gains, worst gain, thickness. These touches change that" in each for each in found.explain()
    )


def test_better_forces_more_touches_and_less_noise_settle_more():
    def width(count=12, **options):
        return expected(validation.next_touches(SMALL, count, **({"noise": "4 mN"} | options)))["gains"].after

    base = width()
    assert width(24) < 0.8 * base
    assert width(force_error=0.1) > 1.5 * base
    assert width(noise="8 mN") > 1.02 * base
    assert width(place_error="0.5 mm") > base


def test_the_poisson_ratio_is_settled_where_it_is_wanted(covers):
    known = expected(validation.next_touches(SMALL, 24, noise="1 mN", want=("thickness",)))
    both = expected(validation.next_touches(SMALL, 24, noise="1 mN", want=("thickness", "poisson")))
    assert "poisson" not in known
    assert both["thickness"].after > known["thickness"].after
    assert both["poisson"].after < both["poisson"].before
    soft = covers.change(1.0, -0.01)
    assert abs(soft.forces(0, np.zeros((1, 2)))[0] - covers.main.forces(0, np.zeros((1, 2)))[0]).max() > 1e-4


def test_the_plan_is_written_as_table_protocol_path_and_picture(tmp_path, capsys):
    folder = tmp_path / "plan"
    command = ["calibrate", "--sensor", "wts-0614-34", "--next", "5", "--noise", "5mN", "--load", "2N"]
    assert run([*command, "--plan", str(folder)]) == 0
    assert "thickness" in capsys.readouterr().out
    rows = list(csv.DictReader((folder / "touches.csv").read_text().splitlines()))
    places = [(row["x [mm]"], row["y [mm]"]) for row in rows]
    assert len(places) == 5
    assert {row["load [N]"] for row in rows} == {"2"}
    path = (folder / "touches.gcode").read_text()
    assert re.findall(r"^G1 X(\S+) Y(\S+) ", path, re.MULTILINE) == places
    before = re.findall(r"^G0 X(\S+) Y(\S+)$", path, re.MULTILINE)
    np.testing.assert_allclose(np.array(before, float) + 1, np.array(places, float), atol=1e-9)
    assert {float(z) for z in re.findall(r"Z(\d\S*)", path.split("G21")[1])} == {5.0}
    assert path.count("\nM0") == 5
    protocol = (folder / "protocol.md").read_text()
    assert all(f"| {x} | {y} |" in protocol for x, y in places)
    assert (folder / "touches.png").stat().st_size > 1000


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--next", "0"], "--next: must lie in 1..476"),
        (["--next", "100000"], "--next: must lie in 1..476"),
        (["--next", "3", "--load", "-1N"], "--load: must be positive"),
        (["--next", "3", "--load", "1mm"], "--load: "),
        (["--next", "3", "--want", "gians"], "--want: "),
        (["--next", "3", "--want", ","], "--want: name gains, thickness, poisson"),
        (["--next", "3", "--force-error", "5"], "--force-error: must lie in 0..1"),
        (["--next", "3", "--load", "0.001N", "--noise", "1mN"], "--load: no texel shows"),
        (["--load", "2N"], "--next NUMBER is missing"),
        (["--next", "3", "--out", "x.toml"], "--out: has no effect with --next without recordings"),
        (["missing.csv", "--next", "3", "--tip", "1mm"], "--tip: has no effect with --next"),
        ([], "RECORDINGS: name recordings"),
    ],
)
def test_wrong_options_are_one_line_with_the_remedy(options, words, capsys):
    assert run(["calibrate", "--sensor", "wts-0614-34", *options]) == 2
    said = capsys.readouterr()
    assert words in said.err
    assert not said.out


def test_a_curved_cover_has_planned_gains_alone():
    curved = validation.load("fingertip")
    with pytest.raises(InputError, match="gains alone"):
        validation.next_touches(curved, 3)
    with pytest.raises(InputError, match="flat covers"):
        validation.next_touches(curved, 3, want=("gains",), after=SimpleNamespace(touches=np.ones((1, 4))))


class Laboratory:
    """Makes and fits simulated touches with unknown gains, thickness, shift, places and forces."""

    def __init__(self, covers, plan, chosen):
        self.covers, self.plan, self.chosen = covers, plan, chosen
        self.texels, self.count = len(covers.main.origins), len(chosen)
        self.origins = covers.main.origins[:, :2]
        self.spots = plan.spots[chosen, :2] - self.origins[0]
        self.deviations = np.concatenate([
            np.full(self.texels, GAIN), [THICKNESS], np.full(2, ERRORS.shift),
            np.full(2 * self.count, ERRORS.place), np.full(self.count, ERRORS.force),
        ])  # fmt: skip

    def forces(self, vector):
        """Texel forces of all touches, shape (k, n), by a parabola in the logarithm of the thickness."""
        gains, by = np.exp(vector[: self.texels]), vector[self.texels] / 0.1
        own = vector[self.texels + 3 : -self.count].reshape(-1, 2)
        places = self.spots + vector[self.texels + 1 : self.texels + 3] + own
        thin, same, thick = (
            self.covers.change(factor, 0.0).forces(0, places, RADIUS) for factor in (np.exp(-0.1), 1.0, np.exp(0.1))
        )
        shares = same + by * (thick - thin) / 2 + by**2 * (thick - 2 * same + thin) / 2
        return LOAD * gains * (1 + vector[-self.count :, None]) * shares

    def slopes(self, vector):
        """Slopes of the forces, shape (k, n, parameters)."""
        base, size = self.forces(vector), len(vector)
        found = np.zeros((*base.shape, size))
        found[:, np.arange(self.texels), np.arange(self.texels)] = base
        for index, step in ((self.texels, 1e-4), (self.texels + 1, 1e-7), (self.texels + 2, 1e-7)):
            moved = vector.copy()
            moved[index] += step
            found[..., index] = (self.forces(moved) - base) / step
        touches = np.arange(self.count)
        for axis in (0, 1):
            found[touches, :, self.texels + 3 + 2 * touches + axis] = found[touches, :, self.texels + 1 + axis]
        found[touches, :, size - self.count + touches] = base / (1 + vector[-self.count :, None])
        return found

    def recover(self, rng):
        """Return how far fitted gains, thickness and shift are from the truth, shape (n + 3,)."""
        truth = self.deviations * rng.standard_normal(len(self.deviations))
        truth[self.texels] *= 0.1
        seen = self.forces(truth) + CHANNEL.noise * rng.standard_normal((self.count, self.texels))
        scale, noise = self.deviations, CHANNEL.noise

        def residuals(vector):
            return np.concatenate([((self.forces(vector * scale) - seen) / noise).ravel(), vector])

        def jacobian(vector):
            rows = self.slopes(vector * scale).reshape(-1, len(vector)) * scale / noise
            return np.vstack([rows, np.eye(len(vector))])

        fitted = least_squares(residuals, np.zeros_like(truth), jac=jacobian, method="lm").x
        return (scale * fitted - truth)[: self.texels + 3]


@pytest.mark.slow
def test_two_hundred_simulated_fits_have_the_predicted_intervals(covers, plan, record_property):
    chosen = plan.choose(plan.prior, 22)
    predicted = np.sqrt(np.diag(np.linalg.inv(plan.add(plan.prior, plan.roots[chosen]))))
    laboratory, rng = Laboratory(covers, plan, chosen), np.random.default_rng(11)
    errors = np.array([laboratory.recover(rng) for _ in range(200)])
    ratio = errors.std(axis=0) / predicted
    inside = np.abs(errors) < 1.959964 * predicted
    record_property("median ratio and coverage", (float(np.median(ratio)), float(inside.mean())))
    assert np.median(ratio) == pytest.approx(1, abs=0.1)
    assert inside.mean() == pytest.approx(0.95, abs=0.03)


def test_a_folder_that_cannot_be_replaced_is_named_by_the_option_plan(softcover, tmp_path):
    (tmp_path / "taken").write_text("not a folder")
    plan = ["calibrate", "--sensor", "wts-0614-34", "--next", "2", "--noise", "5mN"]
    status, out, error = softcover(*plan, "--plan", "taken")
    assert (status, out) == (2, "")
    assert "--plan: " in error
    assert "taken is a file; name a folder" in error
    status, out, _ = softcover(*plan, "--json")
    assert status == 0
    assert len(json.loads(out)["touches"]) == 2
