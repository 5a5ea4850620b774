"""Presses on relaxing covers in time against closed forms, and against contacts of rings that assume no growth."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from fem_reference.closed_form.contact import indent
from fem_reference.errors import UnsupportedError
from fem_reference.indentation import relaxing
from fem_reference.indentation.relaxing import ElasticCurve, follow_curves, follow_press
from meshes import Cover, Cylinder, Layer, Material, Pose, Sphere
from meshes.catalogue import ARRAYS
from meshes.relaxation import Relaxation
from tests.exact.relaxing_rings import press_rings

PRONY = Relaxation(g=(0.3, 0.2), tau=(0.1, 10.0))
POWER = Relaxation(exponent=0.15, tau=(0.02,))
BALL, STIFF = 5e-3, 1e6 / (1 - 0.49**2)


def g_of(t):
    return 1 - 0.3 * (1 - np.exp(-t / 0.1)) - 0.2 * (1 - np.exp(-t / 10))


def make_cover(relaxation=None, level=1.0):
    """A cover of 2 mm, with the shear modulus times a level at the same bulk modulus."""
    shear, bulk = level * 1e6 / (2 * 1.49), 1e6 / (3 * 0.02)
    ratio = (3 * bulk - 2 * shear) / (2 * (3 * bulk + shear))
    modulus = {"youngs_modulus": 2 * shear * (1 + ratio)}
    material = Material(
        name="rubber", model="linear-elastic", parameters=modulus, poisson_ratio=ratio, relaxation=relaxation
    )
    return Cover(layers=(Layer(thickness=2e-3, material=material),))


def hertz_curve(deepest, count=10):
    """The curve of a ball on a half-space, with one texel that bears all."""
    depth = deepest * np.linspace(1 / count, 1, count) ** 2
    force = 4 / 3 * STIFF * np.sqrt(BALL) * depth**1.5
    return ElasticCurve(depths=depth, values=np.column_stack([force, force, np.zeros(count)]))


def layer_curve(cover, ball, deepest, count=16):
    depth = deepest * np.linspace(1 / count, 1, count) ** 2
    force = np.array([indent(cover, ball, depth=each).force for each in depth])
    return ElasticCurve(depths=depth, values=np.column_stack([force, force, np.zeros(count)]))


def follow_ball(relaxation, times, **values):
    (control, given), curve = next(iter(values.items())), hertz_curve(4e-4)
    return follow_curves({1.0: curve}, relaxation, times, np.array(given), control=control, is_flat=False)


@pytest.mark.parametrize("relaxation", [PRONY, POWER])
def test_a_ball_that_goes_in_steadily_follows_lee_and_radok(relaxation):
    """At depth v t the force is 4/3 E* sqrt(R) times the integral of g(t - s) d (v s)^1.5."""
    found = follow_ball(relaxation, [0.0, 2.0], depth=[0.0, 4e-4])
    for k in (60, 120, 180, -1):
        t, speed = found.times[k], 2e-4
        wanted = quad(lambda s, t=t: relaxation.at(t - s) * 1.5 * np.sqrt(s), 0, t, limit=200)[0] * speed**1.5
        assert found.forces[k] == pytest.approx(4 / 3 * STIFF * np.sqrt(BALL) * wanted, rel=1e-3)
    assert max(found.error_estimate.values()) < 1e-3


def test_a_ball_under_a_step_of_load_creeps_as_the_compliance():
    """One Prony term: the compliance is 1 + g / (1 - g) (1 - exp(-t (1 - g) / tau)), and depth^1.5 is its multiple."""
    found = follow_ball(Relaxation(g=(0.4,), tau=(3.0,)), [0.0, 20.0], load=[0.2, 0.2])
    wanted = 1 + 0.4 / 0.6 * (1 - np.exp(-found.times * 0.6 / 3.0))
    assert (found.depths / found.depths[0]) ** 1.5 == pytest.approx(wanted, rel=1e-3)
    assert found.forces == pytest.approx(0.2)


@pytest.mark.parametrize("count", [2, 20])
@pytest.mark.parametrize("seconds", [10.0, 3600.0])
def test_the_estimate_covers_relaxation_much_faster_than_the_history(count, seconds):
    """A modulus that falls to a tenth within 1 ms, with a load that is held at `count` instants."""
    times = np.linspace(0, seconds, count).tolist()
    found = follow_ball(Relaxation(g=(0.9,), tau=(1e-3,)), times, load=[0.05] * count)
    wanted = ((1 - 0.9 * np.exp(-found.times * 0.1 / 1e-3)) / 0.1) ** (2 / 3) * found.depths[0]
    error = np.abs(found.depths - wanted).max() / wanted.max()
    assert error < found.error_estimate["time"] < 5e-3


def follow_rational(g):
    """A face held at a depth, with a force of 4 N x / (x + 0.3) at a share x of the modulus; and the exact force."""
    levels = (2 - g) / 2 + g / 2 * np.cos(np.pi * np.arange(5) / 4)
    force = {x: 2e5 * np.array([1e-5, 2e-5]) * x / (x + 0.3) for x in levels.tolist()}
    curves = {
        x: ElasticCurve(depths=np.array([1e-5, 2e-5]), values=np.column_stack([f, f, 0 * f])) for x, f in force.items()
    }
    relaxation = Relaxation(g=(g,), tau=(1.0,), bulk="constant")
    found = follow_curves(curves, relaxation, [0.0, 40.0], np.array([2e-5, 2e-5]), control="depth", is_flat=True)
    late, early = (1 - g) / (1.3 - g), 1 / 1.3
    return found, 4.0 * (late + (early - late) * np.exp(-(1.3 - g) / 1.3 * found.times))


def test_a_polynomial_in_the_modulus_is_refused_where_it_does_not_hold():
    found, wanted = follow_rational(0.4)
    assert np.abs(found.forces - wanted).max() / wanted.max() < found.error_estimate["moduli"] + 2e-4 < 0.01
    with pytest.raises(UnsupportedError, match=r"falls to 5 % of its start: the estimated error exceeds 1%; let"):
        follow_rational(0.95)


@pytest.mark.parametrize(("power", "is_flat"), [(1.0, True), (1.5, False)])
def test_a_constant_bulk_modulus_delays_the_creep_under_a_load(power, is_flat, monkeypatch):
    """A force (a + b x) depth^power at a share x of the modulus, as if relaxation were b g / (a + b) in all."""
    monkeypatch.setattr(relaxing, "_INSTANTS", 16)
    a, b, g, tau, load = 2.0, 3.0, 0.5, 2.0, 0.7
    depth = 1e-5 * np.linspace(0.1, 1, 10) ** 2
    curves = {}
    for x in (1 - g / 2 + g / 2 * np.cos(np.pi * np.arange(5) / 4)).tolist():
        force = (a + b * x) * (depth / 1e-5) ** power
        curves[x] = ElasticCurve(depths=depth, values=np.column_stack([force, 0.8 * force, 0.2 * force]))
    relaxation = Relaxation(g=(g,), tau=(tau,), bulk="constant")
    found = follow_curves(curves, relaxation, [0.0, 9.0], np.full(2, load), control="load", is_flat=is_flat)
    part = g * b / (a + b)
    creep = 1 + part / (1 - part) * (1 - np.exp(-found.times * (1 - part) / tau))
    assert (found.depths / 1e-5) ** power == pytest.approx(load / (a + b) * creep, rel=5e-3)
    assert found.forces == pytest.approx(load)
    assert found.texel_forces[:, 0] == pytest.approx(0.8 * found.forces)
    assert found.outside == pytest.approx(0.2 * found.forces)
    # Without relaxation the same load leaves the first depth and the same shares.
    assert found.fast == pytest.approx(np.tile([0.8 * load, 0.2 * load], (len(found.times), 1)))


def test_a_modulus_that_vanishes_is_refused_before_a_solve():
    cover = make_cover(Relaxation(g=(1.0,), tau=(1.0,), bulk="constant"))
    with pytest.raises(UnsupportedError, match=r"falls to 8.8e-25 % of its start"):
        follow_press(cover, ARRAYS["wts-0614-34"], Cylinder(radius=10e-3), Pose(), times=[0.0, 60.0], loads=[2.0, 2.0])


def test_a_ball_that_comes_back_follows_ting():
    """t1 solves the integral of g(t - s) d depth from t1 to t; the force is that integral of depth^1.5 up to t1."""
    found = follow_ball(PRONY, [0.0, 1.0, 1.8], depth=[0.0, 4e-4, 0.8e-4])

    def area(t, low, high):
        return quad(lambda s: g_of(t - s), low, high)[0]

    for k in np.flatnonzero(found.times > 1.02)[::12]:
        t = found.times[k]
        start = brentq(lambda s, t=t: area(t, s, 1.0) - area(t, 1.0, t), 0.0, 1.0)
        wanted = quad(lambda s, t=t: g_of(t - s) * 1.5 * np.sqrt(s), 0, start)[0] * 4e-4**1.5
        assert found.forces[k] == pytest.approx(4 / 3 * STIFF * np.sqrt(BALL) * wanted, rel=2e-3)
        assert found.contact_depths[k] == pytest.approx(4e-4 * start, rel=1e-3)


def test_loads_and_depths_of_one_press_belong_together():
    """The depths that loads give, given as depths, give the loads, also where the contact shrinks."""
    loads = follow_ball(PRONY, [0.0, 1.0, 1.7], load=[0.0, 1.0, 0.3])
    back = follow_ball(PRONY, loads.times, depth=loads.depths)
    assert np.interp(loads.times, back.times, back.forces) == pytest.approx(loads.forces, abs=2e-3)


@pytest.mark.parametrize(
    ("times", "values", "fault"),
    [
        ([0, 1, 2], {"depth": [0, 4e-4, 0]}, r"lifts off at 1\.\d+ s; end the history before"),
        ([0, 1, 2, 9], {"load": [0, 1, 0.4, 0.4]}, "the contact grows a second time at 2 s"),
        ([0, 1, 2, 3], {"depth": [0, 4e-4, 2e-4, 4e-4]}, "the contact grows a second time at 2 s"),
    ],
)
def test_histories_beyond_the_integrals_are_refused(times, values, fault):
    with pytest.raises(UnsupportedError, match=fault):
        follow_ball(PRONY, times, **values)


@pytest.fixture(scope="module")
def faces():
    """Presses of a face of a/h 5 held at a depth and under a load, for both choices of the bulk."""
    out = {}
    for bulk in ("relaxing", "constant"):
        cover = make_cover(Relaxation(g=PRONY.g, tau=PRONY.tau, bulk=bulk))
        face = cover, ARRAYS["wts-0614-34"], Cylinder(radius=10e-3), Pose()
        times = [0.0, 30.0, 60.0]
        out[bulk, "depth"] = follow_press(*face, times=times, depths=[5e-6] * 3)
        out[bulk, "load"] = follow_press(*face, times=times, loads=[5.0, 5.0, 2.0])
    return out


@pytest.mark.slow
def test_a_face_at_a_fixed_depth_relaxes_as_its_material(faces):
    found = faces["relaxing", "depth"]
    assert found.forces / found.forces[0] == pytest.approx(g_of(found.times), rel=1e-3)
    assert found.forces[0] == pytest.approx(indent(make_cover(), Cylinder(radius=10e-3), depth=5e-6).force, rel=2e-3)


@pytest.mark.slow
def test_texels_under_a_face_keep_their_shares_at_a_constant_poisson_ratio(faces):
    found = faces["relaxing", "load"]
    shares = found.texel_forces / found.forces[:, None]
    assert np.abs(shares - shares[0]).max() < 1e-6
    assert np.abs(found.fast[:, :-1] - found.texel_forces).max() < 1e-6
    moved = faces["constant", "load"].texel_forces / faces["constant", "load"].forces[:, None]
    assert np.abs(moved - moved[0]).max() > 1e-4


@pytest.mark.slow
def test_a_tilted_face_has_a_contact_that_grows():
    face = make_cover(PRONY), ARRAYS["wts-0614-34"], Cylinder(radius=3e-3), Pose(tilt=(0.02, 0.0))
    found = follow_press(*face, times=[0.0, 60.0], loads=[0.05, 0.05])
    moved = np.abs(found.texel_forces[-1] - found.fast[-1, :-1]).sum() / 0.05
    assert moved > 0.01
    assert found.depths[-1] < 1.9 * found.depths[0]


@pytest.mark.slow
def test_a_constant_bulk_modulus_stiffens_a_confined_face(faces):
    """After a long time the cover is elastic, with its relaxed shear modulus and its own bulk modulus."""
    found = faces["constant", "depth"]
    face = Cylinder(radius=10e-3)
    late = indent(make_cover(level=float(g_of(60.0))), face, depth=5e-6).force
    assert found.forces[-1] == pytest.approx(late, rel=3e-3)
    assert found.forces[-1] / faces["relaxing", "depth"].forces[-1] == pytest.approx(1.167, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("radius", "deepest"), [(5e-3, 4e-4), (0.5, 5e-5)])
def test_a_ball_on_a_thin_cover_agrees_with_rings_in_time(radius, deepest):
    """Loading and unloading on 2 mm, contacts of 0.8 and 3.9 thicknesses."""
    cover, ball = make_cover(), Sphere(radius=radius)
    times = np.concatenate([np.linspace(0, 1, 61), 1 + np.linspace(0, 0.8, 41)[1:]])
    depths = np.interp(times, [0, 1, 1.8], [0, deepest, 0.3 * deepest])
    within = 1.05 * indent(cover, ball, depth=deepest).contact_radius
    rings = press_rings({1.0: cover}, ball, g_of, times=times, depths=depths, radius=within, rings=40)
    curves = {1.0: layer_curve(cover, ball, deepest)}
    found = follow_curves(curves, PRONY, times, depths, control="depth", is_flat=False)
    assert np.interp(times, found.times, found.forces) == pytest.approx(rings, abs=2e-3 * rings.max())


@pytest.mark.slow
def test_a_ball_on_a_cover_of_constant_bulk_modulus_agrees_with_rings_in_time():
    """A contact of 3.9 thicknesses: the growth is approximate, within 0.6 % of the force."""
    levels = (1 + g_of(60.0)) / 2 + (1 - g_of(60.0)) / 2 * np.cos(np.pi * np.arange(5) / 4)
    covers, ball, deepest = {x: make_cover(level=x) for x in levels.tolist()}, Sphere(radius=0.5), 5e-5
    times = np.concatenate([np.linspace(0, 1, 41), 1 + np.geomspace(0.01, 59, 30)])
    depths = np.minimum(times, 1.0) * deepest
    rings = press_rings(covers, ball, g_of, times=times, depths=depths, radius=9.8e-3, rings=60)
    curves = {x: layer_curve(each, ball, deepest) for x, each in covers.items()}
    constant = Relaxation(g=PRONY.g, tau=PRONY.tau, bulk="constant")
    found = follow_curves(curves, constant, times, depths, control="depth", is_flat=False)
    assert np.interp(times, found.times, found.forces) == pytest.approx(rings, abs=6e-3 * rings.max())
    alone = follow_curves({1.0: curves[1.0]}, PRONY, times, depths, control="depth", is_flat=False)
    assert np.abs(np.interp(times, alone.times, alone.forces) - rings).max() > 0.05 * rings.max()


@pytest.mark.parametrize(
    ("parameters", "fault"),
    [
        ({"g": (0.7, 0.5), "tau": (1.0, 2.0)}, "sum to at most one"),
        ({"g": (0.5,), "tau": (-1.0,)}, "positive time"),
        ({"g": (0.0,), "tau": (1.0,)}, "positive terms, not 0"),
        ({"g": (0.5, 0.1), "tau": (1.0,)}, "one positive time for each of 2 terms"),
        ({"tau": (1.0,)}, "either g, the Prony terms, or exponent"),
        ({"exponent": 1.5, "tau": (1.0,)}, "between 0 and 1"),
    ],
)
def test_relaxations_that_no_material_has_are_refused(parameters, fault):
    with pytest.raises(ValueError, match=fault):
        Relaxation(**parameters)
