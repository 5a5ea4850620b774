"""Follow one guided, frictionless press on a relaxing linear cover in time, from its elastic curve.

With one relaxation function g(t) for all layers and a constant Poisson ratio, the pressure follows from the elastic
pressure p_e at the same contact, p(x, t) = int_0^t g(t - s) dp_e(x, c(s)), as long as the contact grows (Lee and
Radok 1960); c is the depth at which an elastic cover has the contact.  While the contact shrinks, it is that of an
earlier instant t1 with int_t1^t g(t - s) d depth(s) = 0, and the integral for p ends there (Ting 1966).  Both need
contacts that are nested by depth.  A flat face keeps its contact, so that all its histories superpose until it lifts
off.

With a constant bulk modulus the response depends on the ratio of the two moduli.  Its Laplace transform is that of an
elastic cover with the shear modulus s g~(s) G(0).  A polynomial in this modulus through the responses of a few elastic
covers becomes in time the same polynomial in the operator y -> int g(t - s) dy(s).  The symbol of the operator is
complex, while the covers have real moduli.  The polynomial is good where it converges fast, and is refused elsewhere by
its estimated error.  A growing contact is a further approximation, except on a half-space.

An integral over a history is a sum over the n intervals between instants, on which the history is linear, with the mean
of g over each.  A step at the first instant is an interval of length zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import solve_triangular
from scipy.optimize import brentq, newton

from fem_reference.errors import PiercedError, UnsupportedError
from fem_reference.finite_strain.loading_path import Control
from fem_reference.indentation.layered import state_assumptions
from fem_reference.indentation.press import press_path
from fem_reference.indentation.result import Indentation
from fem_reference.interpolation import estimate_interpolation, interpolate
from meshes import Cover, Indenter, Layer, Pose, TexelArray, tilt_indenter
from meshes.array_types import FloatArray
from meshes.relaxation import Relaxation

#: Number of points of an elastic curve under a curved indenter [-].  Depths are squares, as the radius of a round
#: contact on a thick cover grows with the root of the depth.
_POINTS = 10
#: Number of shear moduli for which a cover of constant bulk modulus is pressed [-].
_LEVELS = 5
#: Largest estimated error of the polynomial in the shear modulus, and least modulus over the initial one [-].
_MOST_ERROR, _LEAST = 0.01, 0.01
#: Number of instants of a history, about, for decades that each interval between given ones is divided into [-].
_INSTANTS, _DECADES = 240, 5.0
#: Shortest interval after a change over the least time of relaxation [-], and most decades of an interval [-].
_FIRST, _MOST_DECADES = 0.01, 18.0
#: Decrease of a contact over its depth that is rounding [-].
_ROUNDING = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class ElasticCurve:
    """Force and texel forces over depth of an elastic cover, interpolated between m presses.

    Attributes:
        depths: Ascending depths, at least two, shape (m,) [m].
        values: Force on the indenter, forces on n texels, and force outside, shape (m, n + 2) [N].
    """

    depths: FloatArray
    values: FloatArray

    @classmethod
    def of(cls, presses: Sequence[Indentation]) -> ElasticCurve:
        """Return the curve through presses at ascending depths."""
        values = [np.array([each.total_force, *each.texel_forces, each.outside]) for each in presses]
        return cls(depths=np.array([each.depth for each in presses]), values=np.array(values))

    @cached_property
    def _force(self) -> BSpline:
        return interpolate(np.log(self.depths), np.log(self.values[:, 0]))

    @cached_property
    def _shares(self) -> BSpline:
        return interpolate(np.log(self.depths), self.values / self.values[:, :1])

    def _log_force(self, x: FloatArray) -> FloatArray:
        inside = np.clip(x, *self._force.t[[0, -1]])
        return np.asarray(self._force(inside) + self._force(inside, nu=1) * (x - inside))

    def force(self, depth: FloatArray) -> FloatArray:
        """Return the force at depths [m], of the same shape [N]; a power of the depth outside the points."""
        return np.where(depth > 0, np.exp(self._log_force(np.log(np.where(depth > 0, depth, 1.0)))), 0.0)

    def depth(self, force: FloatArray) -> FloatArray:
        """Return the depth at forces [N], of the same shape [m]."""
        out, pressed = np.zeros_like(force), force > 0
        if pressed.any():
            wanted = np.log(force[pressed])

            def miss(x: FloatArray) -> FloatArray:
                return np.asarray(self._log_force(x) - wanted)

            start = np.interp(wanted, np.log(self.values[:, 0]), np.log(self.depths))
            out[pressed] = np.exp(newton(miss, start, tol=1e-12))
        return out

    def forces(self, depth: FloatArray) -> FloatArray:
        """Return force, forces on n texels and force outside at k depths [m], shape (k, n + 2) [N]."""
        x = np.clip(np.log(np.maximum(depth, 1e-300)), *self._shares.t[[0, -1]])
        return np.asarray(self._shares(x) * self.force(depth)[:, None])

    @property
    def error(self) -> float:
        """Estimated relative error of the force by interpolation, largest over the points [-]."""
        return float(estimate_interpolation(np.log(self.depths), np.log(self.values[:, 0])).max())


@dataclass(frozen=True, kw_only=True, eq=False)
class Followed:
    """A press in time, at k instants.

    Attributes:
        times: The instants, ascending from 0 [s].
        forces: Force on the indenter at each instant, shape (k,) [N].
        depths: Approach of the indenter from first touch, shape (k,) [m].
        contact_depths: Depth at which the elastic cover has the same contact, shape (k,) [m].
        texel_forces: Force on each of n texels, shape (k, n) [N].
        outside: Force on the base outside the texels, shape (k,) [N].
        fast: Forces on the texels and outside of an elastic cover with the initial modulus, under the same load or
            at the same depth, which a model without relaxation has at best, shape (k, n + 1) [N].
        error_estimate: Estimated errors over the largest force and depth [-]: `presses` of the elastic presses, `curve`
            of their interpolation, `time` of the steps of time (twice the step), and `moduli` of the polynomial (degree
            two instead of four), which is zero for a constant Poisson ratio.
        warnings: Sentences about reasons not to rely on the elastic presses.
    """

    times: FloatArray
    forces: FloatArray
    depths: FloatArray
    contact_depths: FloatArray
    texel_forces: FloatArray
    outside: FloatArray
    fast: FloatArray
    error_estimate: dict[str, float]
    warnings: tuple[str, ...] = ()


class _Integral:
    """The integral y -> int g(t - s) dy(s) at the instants of a history, on values that are linear between them."""

    def __init__(self, times: FloatArray, relaxation: Relaxation) -> None:
        ends, starts = times, np.append(0.0, times[:-1])
        past = np.maximum(times[:, None] - ends, 0.0)
        self.weights = np.tril(relaxation.mean(past, np.broadcast_to(ends - starts, past.shape)))

    def over(self, values: FloatArray) -> FloatArray:
        """Return the integral over values, or over each of their columns, shape (n, ...)."""
        return np.asarray(self.weights @ np.diff(values, axis=0, prepend=np.zeros_like(values[:1])))

    def invert(self, values: FloatArray) -> FloatArray:
        """Return the history whose integral has the given values, shape (n,)."""
        return np.cumsum(solve_triangular(self.weights, values, lower=True))

    @cached_property
    def matrix(self) -> FloatArray:
        """The integral as a matrix, shape (n, n)."""
        return self.over(np.eye(len(self.weights)))


def follow_press(
    cover: Cover,
    array: TexelArray,
    indenter: Indenter,
    pose: Pose,
    *,
    times: Sequence[float],
    loads: Sequence[float] | None = None,
    depths: Sequence[float] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Followed:
    """Follow a frictionless press of one indenter in time, under loads or depths that are linear between instants.

    Args:
        cover: Cover of `linear-elastic` layers with one and the same relaxation, on a rigid base.
        array: Array with n texels.
        indenter: The indenter.
        pose: Pose of the indenter, as for `press`; it does not change.
        times: Ascending instants, the first one zero [s].  A value other than zero at the first one is a step.
        loads: Load at each instant [N].  Give either `loads` or `depths`.
        depths: Depth at each instant [m].
        progress: Called with a line of text before each solve.

    Raises:
        UnsupportedError: If the cover is not linear, has no relaxation or several, the indenter lifts off, its contact
            grows a second time, or, with a constant bulk modulus, shrinks or meets too soft a cover.
        PiercedError: If the indenter would pierce the cover.
        ConvergenceError: If the finite elements do not converge.
    """
    relaxation = find_relaxation(cover)
    control: Control = "load" if depths is None else "depth"
    values = np.array(loads if depths is None else depths, dtype=np.float64)
    peak, softest, levels = float(values.max()), 1.0, [1.0]
    if relaxation.bulk == "constant" and any(each.material.poisson_ratio < 0.5 for each in cover.layers):  # noqa: PLR2004
        softest = _find_least(relaxation, times[-1])  # deeper than any history with this load
        nodes = np.cos(np.pi * np.arange(1, _LEVELS) / (_LEVELS - 1))
        levels += ((1 + softest) / 2 + (1 - softest) / 2 * nodes).tolist()
    elif control == "load":
        grid = _divide(np.array(times), relaxation)[0]
        peak = float(_Integral(grid, relaxation).invert(np.interp(grid, times, values)).max())

    def press(level: float, **given: list[float]) -> list[Indentation]:
        return press_path(_soften(cover, level), array, indenter, pose, progress=progress, **given)  # type: ignore[arg-type]

    if control == "load":
        try:
            peak = press(softest, loads=[peak])[0].depth
        except PiercedError as error:
            text = (
                f"{values.max():.4g} N within {times[-1]:.4g} s would pierce the cover, which relaxes; use at most "
                f"{error.largest * values.max() / peak:.3g} N, a shorter time or a wider indenter"
            )
            raise PiercedError(text, "load") from None
    is_flat = tilt_indenter(indenter, pose.tilt).is_flat
    shares = np.array([0.5, 1.0]) if is_flat else np.linspace(1 / _POINTS, 1, _POINTS) ** 2
    presses = {level: press(level, depths=(peak * shares).tolist()) for level in levels}
    curves = {level: ElasticCurve.of(each) for level, each in presses.items()}
    found = follow_curves(curves, relaxation, times, values, control=control, is_flat=is_flat)
    largest = presses[1.0][-1]
    own = max(
        each.error_estimate[name] * getattr(each, name) / getattr(largest, name)
        for each in presses[1.0]
        for name in ("total_force", "depth")
    )
    known = state_assumptions(cover, indenter, float(found.depths.max()))
    warnings = (*largest.warnings, *(known[name] for name in ("facets", "range") if name in known))
    return replace(found, error_estimate={"presses": own} | found.error_estimate, warnings=warnings)


def follow_curves(
    curves: Mapping[float, ElasticCurve],
    relaxation: Relaxation,
    times: Sequence[float],
    values: FloatArray,
    *,
    control: Control,
    is_flat: bool,
) -> Followed:
    """Follow a press in time, given the elastic curves of its cover; see `follow_press`.

    Args:
        curves: Elastic curves by the factor on the shear modulus at a constant bulk modulus; only that of 1 if the
            Poisson ratio is constant.
        relaxation: Relaxation of the cover.
        times: Ascending instants, the first one zero [s].
        values: Load [N] or depth [m] at each instant.
        control: Which of the two the values are.
        is_flat: Whether the contact is the same at all depths.

    Raises:
        UnsupportedError: As `follow_press`.
    """
    instants = np.array(times, dtype=np.float64)
    grids = _divide(instants, relaxation)
    given = [np.interp(grid, instants, values) for grid in grids]
    few = dict(list(curves.items())[::2])
    course, coarse, other = (
        _Follower(_Integral(grids[k], relaxation), chosen, is_flat).follow(control, given[k], grids[k])
        for k, chosen in ((0, curves), (1, curves), (1, few))
    )
    errors = {
        "curve": curves[1.0].error,
        "time": _compare(coarse, course, grids[1], grids[0]),
        "moduli": _compare(other, coarse, grids[1], grids[1]),
    }
    if len(curves) > 1:
        _find_least(relaxation, times[-1], errors["moduli"])
    elastic = curves[1.0].depth(given[0]) if control == "load" else course.depths
    return Followed(
        times=grids[0], forces=course.forces[:, 0], depths=course.depths, contact_depths=course.contact,
        texel_forces=course.forces[:, 1:-1], outside=course.forces[:, -1], fast=curves[1.0].forces(elastic)[:, 1:],
        error_estimate=errors,
    )  # fmt: skip


def find_relaxation(cover: Cover) -> Relaxation:
    """Return the relaxation of all layers of a cover.

    Raises:
        UnsupportedError: If the cover is not linear, or its layers do not relax alike.
    """
    found = {layer.material.relaxation for layer in cover.layers}
    if not cover.small_strain_only:
        raise UnsupportedError("histories need linear-elastic layers; change the model of the material", "history")
    if None in found or len(found) > 1:
        raise UnsupportedError(
            "every layer needs a relaxation, the same in all; write for example relaxation = { g = 0.3, tau = '1 s' } "
            "into the material",
            "history",
        )
    return next(each for each in found if each is not None)


def _soften(cover: Cover, level: float) -> Cover:
    """Return the elastic cover with its shear moduli times a factor, the bulk moduli unchanged."""

    def change(layer: Layer) -> Layer:
        material, shear = layer.material, level * layer.material.shear_modulus
        share = shear / material.bulk_modulus
        ratio = material.poisson_ratio if level == 1 else (3 - 2 * share) / (6 + 2 * share)
        modulus = 2 * shear * (1 + ratio)
        changed = replace(material, parameters={"youngs_modulus": modulus}, poisson_ratio=ratio, relaxation=None)
        return replace(layer, material=changed)

    return replace(cover, layers=tuple(map(change, cover.layers)))


def _find_least(relaxation: Relaxation, time: float, error: float = 0.0) -> float:
    """Return the relaxed share of the shear modulus; refuse it if the polynomial does not hold down to it."""
    if (least := relaxation.at(time)) >= _LEAST and error <= _MOST_ERROR:
        return least
    raise UnsupportedError(
        f"bulk = 'constant' is not computed where the shear modulus falls to {100 * least:.2g} % of its start: the "
        f"estimated error exceeds {_MOST_ERROR:.0%}; let it relax less, end earlier, or take bulk = 'relaxing'",
        "history",
    )


def _divide(instants: FloatArray, relaxation: Relaxation) -> tuple[FloatArray, FloatArray]:
    """Divide the intervals of a history, more finely after each change; return all instants, and every other one."""
    fine, coarse = [instants], [instants]
    for start, length in zip(instants[:-1], np.diff(instants), strict=True):  # the first may begin with a step
        each = _INSTANTS // (4 * (len(instants) - 1 if start else 1))
        decades = np.clip(np.log10(length / (_FIRST * min(relaxation.tau))), _DECADES, _MOST_DECADES)
        x = np.linspace(0, 1, 2 * each + 1 if each else 3)
        if each:
            x = np.union1d(np.geomspace(10**-decades, 1, 2 * math.ceil(each * decades / _DECADES) + 1), x)
        fine.append(start + length * x[1:-1])
        coarse.append(start + length * x[2:-1:2])
    return np.unique(np.concatenate(fine)), np.unique(np.concatenate(coarse))


class _Course(NamedTuple):
    """Course of a press on one grid of k instants.

    Attributes:
        forces: Force, forces on n texels and force outside, shape (k, n + 2) [N].
        depths: Approach of the indenter, shape (k,) [m].
        contact: Depth of the elastic cover with the same contact, shape (k,) [m].
    """

    forces: FloatArray
    depths: FloatArray
    contact: FloatArray


class _Follower:
    """Follows one history on one grid of n instants, given the elastic curves by their share of the shear modulus."""

    def __init__(self, integral: _Integral, curves: Mapping[float, ElasticCurve], is_flat: bool) -> None:
        self._integral, self._flat, self._curve = integral, is_flat, curves[1.0]
        eye = np.eye(len(integral.weights))
        self._parts = [(integral.matrix, self._curve)]
        if len(curves) > 1:
            factors = {
                level: [(integral.matrix - other * eye) / (level - other) for other in curves if other != level]
                for level in curves
            }
            self._parts = [(reduce(np.matmul, factors[level]), curve) for level, curve in curves.items()]

    def follow(self, control: Control, given: FloatArray, times: FloatArray) -> _Course:
        """Return the course of forces and depths.

        Raises:
            UnsupportedError: As `follow_press`.
        """
        contact = given if control == "depth" else self._find_depths(given)
        last = len(given) - 1 if self._flat else _find_growth(contact)
        if last < len(given) - 1 and len(self._parts) > 1:
            raise UnsupportedError(
                f"the contact shrinks from {times[last]:.4g} s on, which is not computed for bulk = 'constant'; end "
                "the history there, or take bulk = 'relaxing'",
                "history",
            )
        grown = np.where(np.arange(len(given)) > last, contact[last], contact)
        forces = sum((matrix @ curve.forces(grown) for matrix, curve in self._parts), np.zeros(1))
        depth, contact, pressed = contact.copy(), grown.copy(), self._curve.forces(grown[: last + 1])
        for i in range(last + 1, len(given)):
            shrink = self._shrink_depth if control == "depth" else self._shrink_load
            found = shrink(i, given[i], depth, pressed[:, 0])
            if found is None or found[1] > contact[i - 1] * (1 + 1e-6):
                fault = "the indenter lifts off" if found is None else "the contact grows a second time"
                raise UnsupportedError(f"{fault} at {times[i]:.4g} s; end the history before", "history")
            (k, contact[i]), weights = found, self._integral.weights[i]
            before = pressed[k - 1] if k else np.zeros_like(pressed[0])
            forces[i] = weights[:k] @ np.diff(pressed[:k], axis=0, prepend=np.zeros_like(pressed[:1]))
            forces[i] += weights[k] * (self._curve.forces(contact[i : i + 1])[0] - before)
        lifted = np.flatnonzero((forces[:-1, 0] <= 0) & (contact[:-1] > 0))
        if len(lifted):
            raise UnsupportedError(f"the indenter lifts off at {times[lifted[0]]:.4g} s; end before", "history")
        return _Course(forces, depth, contact)

    def _find_depths(self, loads: FloatArray) -> FloatArray:
        """Return the depth at each instant under loads, while the contact grows, shape (n,) [m]."""
        if len(self._parts) == 1:
            return self._curve.depth(self._integral.invert(loads))
        depths, values = np.zeros(len(loads)), np.zeros((len(self._parts), len(loads)))
        most = 4 * self._curve.depths[-1]
        for i, load in enumerate(loads.tolist()):
            rest = load - sum(float(matrix[i, :i] @ values[j, :i]) for j, (matrix, _) in enumerate(self._parts))

            def miss(depth: float, i: int = i, rest: float = rest) -> float:
                return sum(float(matrix[i, i] * curve.force(np.array(depth))) for matrix, curve in self._parts) - rest

            depths[i] = brentq(miss, 0.0, most, xtol=1e-18, rtol=1e-12) if rest > 0 else 0.0
            values[:, i] = [curve.force(depths[i]) for _, curve in self._parts]
        return depths

    def _shrink_depth(self, i: int, _: float, depth: FloatArray, elastic: FloatArray) -> tuple[int, float] | None:
        """Return the contact at instant i under given depths; None if the indenter lifts off.

        It is the interval of the loading in which the contact had its size, and its depth on the elastic cover [m].
        """
        weighted = self._integral.weights[i, : i + 1] * np.diff(depth[: i + 1], prepend=0.0)
        kept = np.cumsum(weighted[::-1])[::-1][: len(elastic)]
        found = np.flatnonzero(kept >= 0)
        if not len(found):
            return None
        k = int(found[-1])
        before = depth[k - 1] if k else 0.0
        share = kept[k] / weighted[k] if weighted[k] > 0 else 1.0
        return k, float(before + share * (depth[k] - before))

    def _shrink_load(self, i: int, load: float, depth: FloatArray, elastic: FloatArray) -> tuple[int, float]:
        """Return the contact at instant i under a given load, as `_shrink_depth`, and set the depth there."""
        weights = self._integral.weights[i]
        gained = np.cumsum(weights[: len(elastic)] * np.diff(elastic, prepend=0.0))
        k = min(int(np.searchsorted(gained, load)), len(elastic) - 1)
        contact = float(self._curve.depth(np.array(max(0.0, elastic[k] - (gained[k] - load) / weights[k]))))
        steps = np.diff(depth[:i], prepend=0.0)
        later = weights[k] * (depth[k] - contact) + weights[k + 1 : i] @ steps[k + 1 :]
        depth[i] = depth[i - 1] - later / weights[i]
        return k, contact


def _compare(coarse: _Course, fine: _Course, at: FloatArray, instants: FloatArray) -> float:
    """Return the largest difference of force and depth of two courses over the largest value [-].

    Args:
        coarse: Course at the instants `at` [s].
        fine: Course at `instants` [s].
        at: Instants at which the courses are compared, shape (k,) [s].
        instants: Instants that contain these, shape (n,) [s].
    """
    pairs = (coarse.forces[:, 0], fine.forces[:, 0]), (coarse.depths, fine.depths)
    return max(float(np.abs(np.interp(at, instants, two) - one).max() / two.max()) for one, two in pairs)


def _find_growth(contact: FloatArray) -> int:
    """Return the last instant before a contact first shrinks."""
    shrinks = np.flatnonzero(np.diff(contact) < -_ROUNDING * contact.max())
    return int(shrinks[0]) if len(shrinks) else len(contact) - 1
