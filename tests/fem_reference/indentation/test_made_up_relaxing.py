"""Presses in time from made-up elastic presses: which are asked for, what is stated, and what is refused."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from fem_reference.errors import PiercedError, UnsupportedError
from fem_reference.indentation import relaxing
from fem_reference.indentation.relaxing import ElasticCurve, follow_curves, follow_press
from meshes import Cylinder, Sphere, TexelArray
from meshes.pose import Pose
from meshes.relaxation import Relaxation
from tests.support.rubber import make_cover

ARRAY, BALL, FACE = TexelArray.grid(1, 2, 2e-3), Sphere(radius=4e-3), Cylinder(radius=1e-3)
PRONY = Relaxation(g=(0.4,), tau=(2.0,))
CONSTANT = replace(PRONY, bulk="constant")


@dataclass
class Pressed:
    """A press by a law of its own: force = stiffness * depth^power, shared by two texels and the rest."""

    depth: float
    total_force: float
    error_estimate: dict
    warnings: tuple = ("told by the press",)
    texel_forces: np.ndarray = field(default_factory=lambda: np.zeros(2))
    outside: float = 0.0


class Presses:
    """Presses that are noted; the stiffness is proportional to the shear modulus."""

    def __init__(self, power, most=np.inf):
        self.power, self.most, self.calls = power, most, []

    def __call__(self, cover, array, indenter, pose, *, progress, loads=None, depths=None):
        material = cover.layers[0].material
        self.calls.append((material, loads, depths))
        assert (array, progress) == (ARRAY, None)
        assert material.relaxation is None or material.relaxation == PRONY
        stiff = 1e6 * material.shear_modulus / SHEAR * 1e-3 ** (1 - self.power)
        if depths is None:
            depths = [(load / stiff) ** (1 / self.power) for load in loads]
        if depths[-1] > self.most:
            raise PiercedError("too deep", "load", 3.0)
        out = []
        for number, depth in enumerate(depths):
            force = stiff * depth**self.power
            errors = {"total_force": 1e-3 * (number + 1), "depth": 2e-3}
            shares = np.array([0.5, 0.3])
            out.append(Pressed(depth, force, errors, texel_forces=shares * force, outside=0.2 * force))
        return out


COVER = make_cover(0.4, "linear-elastic")
SHEAR = COVER.layers[0].material.shear_modulus


def relax(relaxation, nu=0.4):
    layer = make_cover(nu, "linear-elastic").layers[0]
    return replace(COVER, layers=(replace(layer, material=replace(layer.material, relaxation=relaxation)),))


def follow(monkeypatch, cover, indenter, power, *, pose=None, most=np.inf, times=(0.0, 10.0), **given):
    made = Presses(power, most)
    monkeypatch.setattr(relaxing, "press_path", made)
    monkeypatch.setattr(relaxing, "_INSTANTS", 32)
    return follow_press(cover, ARRAY, indenter, pose or Pose(), times=list(times), **given), made.calls


def test_a_ball_is_pressed_at_squares_of_tenths_of_its_largest_depth(monkeypatch):
    found, calls = follow(monkeypatch, relax(PRONY), BALL, 1.5, depths=[0.1e-3, 0.3e-3])
    ((_, loads, depths),) = calls
    assert loads is None
    assert depths == pytest.approx(0.3e-3 * (np.arange(1, 11) / 10) ** 2)
    # The largest error of any press over the last force or depth.
    assert found.error_estimate["presses"] == pytest.approx(0.01)
    assert found.error_estimate["moduli"] == 0.0
    assert found.warnings == ("told by the press",)
    assert found.forces[0] == pytest.approx(1e6 * 1e-3**-0.5 * 0.1e-3**1.5, rel=1e-3)
    assert found.texel_forces == pytest.approx(np.outer(found.forces, [0.5, 0.3]))
    assert found.outside == pytest.approx(0.2 * found.forces)


def test_a_load_asks_for_the_depth_of_the_largest_elastic_load_that_creep_reaches(monkeypatch):
    """After a step the depth^1.5 of creep is that of an elastic load 1 + g / (1 - g) (1 - exp(-t (1 - g) / tau))."""
    found, calls = follow(monkeypatch, relax(PRONY), BALL, 1.5, loads=[0.2, 0.2])
    grown = 1 + 0.4 / 0.6 * (1 - np.exp(-10.0 * 0.6 / 2.0))
    assert calls[0][1] == pytest.approx([0.2 * grown], rel=5e-3)
    assert calls[1][2][-1] == pytest.approx(found.depths[-1], rel=1e-9)
    assert (found.depths[-1] / found.depths[0]) ** 1.5 == pytest.approx(grown, rel=5e-3)
    assert found.fast[:, 0] == pytest.approx(0.1)


@pytest.mark.parametrize("loads", [(0.3, 0.1), (0.1, 0.3), (0.0, 0.2)])
def test_presses_go_as_deep_as_the_deepest_instant_of_the_finer_history(monkeypatch, loads):
    """The depth after a peak of the load is that of creep until there."""
    found, calls = follow(monkeypatch, relax(PRONY), BALL, 1.5, loads=list(loads))
    assert calls[1][2][-1] == pytest.approx(found.contact_depths.max(), rel=1e-9)
    assert len(found.times) == len(np.unique(found.times)) > 32
    _, (first, *_) = follow(monkeypatch, relax(CONSTANT), FACE, 1.0, loads=list(loads))
    assert first[1] == pytest.approx([max(loads)])


@pytest.mark.parametrize(("pose", "count"), [(Pose(), 2), (Pose(tilt=(0.01, 0.0)), 10)])
def test_a_face_is_pressed_twice_unless_it_is_tilted(monkeypatch, pose, count):
    _, calls = follow(monkeypatch, relax(PRONY), FACE, 1.0, pose=pose, depths=[0.1e-3, 0.1e-3])
    assert len(calls[0][2]) == count
    if count == 2:
        assert calls[0][2] == pytest.approx([0.05e-3, 0.1e-3])


def test_a_constant_bulk_modulus_is_pressed_at_five_moduli_with_the_same_bulk(monkeypatch):
    cover = relax(CONSTANT)
    found, calls = follow(monkeypatch, cover, FACE, 1.0, loads=[0.2, 0.2])
    softest = 1 - 0.4 * (1 - np.exp(-10.0 / 2.0))
    levels = [1.0, *((1 + softest) / 2 + (1 - softest) / 2 * np.cos(np.pi * np.arange(1, 5) / 4))]
    # The softest cover tells the depth of the load.
    assert calls[0][0].shear_modulus == pytest.approx(softest * SHEAR)
    assert calls[0][1] == pytest.approx([0.2])
    assert [each[0].shear_modulus / SHEAR for each in calls[1:]] == pytest.approx(levels)
    assert [each[2][-1] for each in calls[1:]] == pytest.approx([0.2 / (1e6 * softest)] * 5)
    for material, *_ in calls:
        assert material.bulk_modulus == pytest.approx(COVER.layers[0].material.bulk_modulus)
    # A force in proportion to the shear modulus creeps as at a constant Poisson ratio.
    grown = 1 + 0.4 / 0.6 * (1 - np.exp(-found.times * 0.6 / 2.0))
    assert found.depths == pytest.approx(0.2e-6 * grown, rel=5e-3)


def test_an_incompressible_cover_needs_one_modulus_alone(monkeypatch):
    _, calls = follow(monkeypatch, relax(CONSTANT, 0.5), FACE, 1.0, depths=[0.1e-3, 0.1e-3])
    assert len(calls) == 1


def test_a_load_that_pierces_in_time_is_refused_with_the_load_that_does_not(monkeypatch):
    """The elastic cover bears 3 N; creep over 10 s makes 5 N act like 5 N times 1.63."""
    grown = 1 + 0.4 / 0.6 * (1 - np.exp(-10.0 * 0.6 / 2.0))
    with pytest.raises(
        PiercedError, match=r"5 N within 10 s would pierce the cover, which relaxes; use at most"
    ) as told:
        follow(monkeypatch, relax(PRONY), BALL, 1.5, most=1e-6, loads=[5.0, 5.0])
    assert float(str(told.value).split("at most ")[1].split(" N")[0]) == pytest.approx(3.0 / grown, rel=0.01)


@pytest.mark.parametrize(
    ("cover", "words"),
    [
        (make_cover(0.4), "histories need linear-elastic layers"),
        (COVER, "every layer needs a relaxation, the same in all"),
        (replace(COVER, layers=(relax(PRONY).layers[0], COVER.layers[0])), "the same in all"),
        (replace(COVER, layers=(relax(PRONY).layers[0], relax(CONSTANT).layers[0])), "the same in all"),
        (relax(replace(CONSTANT, g=(0.9995,))), "estimated error exceeds 1%; let it relax less, end earlier, or take"),
    ],
)
def test_covers_that_do_not_relax_alike_or_too_far_are_refused(cover, words, monkeypatch):
    with pytest.raises(UnsupportedError, match=words):
        follow(monkeypatch, cover, FACE, 1.0, depths=[0.1e-3, 0.1e-3])


def test_deep_presses_at_small_strain_are_warned_of(monkeypatch):
    found, _ = follow(monkeypatch, relax(PRONY), BALL, 1.5, depths=[0.7e-3, 0.7e-3])
    assert found.warnings[-1] == "indented to 35% of the thickness: more than small strain is meant for"


@pytest.mark.parametrize(
    ("relaxation", "indenter", "depths", "words"),
    [
        (CONSTANT, BALL, (0.0, 0.2e-3, 0.1e-3), r"shrinks from 4 s on, which is not computed for bulk = 'constant'"),
        (PRONY, FACE, (0.1e-3, 0.1e-3, 0.001e-3), "the indenter lifts off at"),
    ],
)
def test_contacts_that_shrink_or_lift_off_are_refused(monkeypatch, relaxation, indenter, depths, words):
    with pytest.raises(UnsupportedError, match=words) as told:
        follow(monkeypatch, relax(relaxation), indenter, 1.0, times=(0.0, 4.0, 10.0), depths=list(depths))
    if indenter is BALL:
        return
    # A step of 0.1 mm, less what comes back at 0.099 mm in six seconds: g - 0.99 / 6 times the integral of g.
    t = np.linspace(4, 10, 60_001)
    g = 1 - 0.4 * (1 - np.exp(-t / 2))
    left = g - 0.99 / 6 * (0.6 * (t - 4) + 0.4 * 2 * (1 - np.exp(-(t - 4) / 2)))
    lifts = t[np.argmax(left <= 0)]
    assert lifts <= float(str(told.value).split("lifts off at ")[1].split(" s")[0]) < lifts + 1


@pytest.mark.parametrize(
    ("instants", "fastest", "decades"),
    [
        # Each interval begins with a hundredth of the shortest time of relaxation: five to eighteen decades.
        ((0.0, 3.0, 50.0), 0.5, (5.0, 5.0)),
        ((0.0, 3.0, 50.0), 1e-6, (np.log10(3e8), np.log10(47e8))),
        ((0.0, 3.0, 50.0), 1e-20, (18.0, 18.0)),
        (tuple(np.arange(101.0)), 0.5, (5.0,) * 100),
    ],
)
def test_intervals_of_a_history_are_divided_evenly_and_by_decades(instants, fastest, decades):
    """Sixty steps of two, or the part of them that each later interval gets; a middle alone where that is none."""
    expected, count = [*instants], len(instants) - 1
    for number, (start, end, reach) in enumerate(zip(instants[:-1], instants[1:], decades, strict=True)):
        steps = 60 if number == 0 else 60 // count
        parts = [0.5]
        if steps:
            powers = np.linspace(-reach, 0, 2 * int(np.ceil(steps * reach / 5)) + 1)
            parts = [*np.arange(1, 2 * steps) / (2 * steps), *(10.0**powers)[:-1]]
        expected += [start + (end - start) * part for part in parts]
    depths = 1e-4 * np.linspace(0.2, 1, 6) ** 2
    force = 1e3 * depths**1.5
    curve = ElasticCurve(depths=depths, values=np.column_stack([force, force, 0 * force]))
    law = Relaxation(g=(0.2, 0.1), tau=(fastest, 30.0))
    found = follow_curves(
        {1.0: curve}, law, list(instants), np.linspace(0.1e-4, 1e-4, len(instants)), control="depth", is_flat=False
    )  # fmt: skip
    expected = np.unique(np.array(expected))
    kept = np.append(True, np.diff(expected) > 1e-12 * expected[1:])
    times = found.times[np.append(True, np.diff(found.times) > 1e-12 * found.times[1:])]
    assert times == pytest.approx(expected[kept], rel=1e-9)
