# ruff: noqa: E501 -- one plant per line
"""Planted changes of the product: each one patches the code, or changes the parameters of the fast model.

A plant takes pytest's `monkeypatch` and the healthy parameters, and returns the parameters to measure.
"""

from __future__ import annotations

import contextlib
import inspect
import textwrap
from dataclasses import replace

import numpy as np
import pytest

import fastmodel.bench
import fastmodel.contact.boxes
import fastmodel.pressure.cell_grid
import fastmodel.sensor
import fastmodel.signal.electronics
import fastmodel.signal.point_spread
import validation.metrics
import validation.pooling
from fastmodel import Butterworth, ChainFunctions, CoverCells, Electronics, Gaussian
from fastmodel.contact.boxes import BoxReader
from fastmodel.contact.plate import CellReader
from fastmodel.pressure.cell_grid import CellGrid
from fastmodel.pressure.solvers import FoundationSolver
from fastmodel.sensor import Sensor
from fastmodel.signal.creep import Creep
from fem_reference.indentation import press
from fem_reference.indentation.relaxing import ElasticCurve, _Follower
from fem_reference.small_strain_contact.friction_cells import RubbingContact, VectorOperator
from meshes.relaxation import Relaxation
from validation.calibration import next_touches
from validation.campaign import evaluation
from validation.moving import run
from validation.published.in_time import recursion
from validation.published.rules import PUBLISHED
from validation.regression import experiments as fixed_images
from validation.regression.baseline import make_baseline
from validation.regression.quantities import EXPERIMENTS, measure
from validation.regression.reading import Subject
from validation.resolution import design
from validation.resolution.channel import Channel
from validation.resolution.posterior import Posterior
from validation.text import indenter

#: Groups of quantities that need finite elements.
WITH_ELEMENTS = (
    "kernel", "shipped parameters", "reference", "accuracy", "friction", "relaxing cover", "comparison models", "uncertainty", "exported values", "recordings",
)  # fmt: skip


def rewrite(monkeypatch, owner, name, old, new):
    """Replace a piece of the source of a function or method, as an edit of the file would."""
    module = inspect.getmodule(getattr(owner, name))
    source = textwrap.dedent(inspect.getsource(getattr(owner, name)))
    assert source.count(old) == 1, f"{name}: {old!r} stands {source.count(old)} times in the source"
    names = {}
    code = compile(source.replace(old, new), module.__file__, "exec", annotations.compiler_flag)
    exec(code, vars(module) | {}, names)  # noqa: S102 -- ours
    monkeypatch.setattr(owner, name, names[name])


def edit(owner, name, old, new):
    def plant(monkeypatch, parameters):
        rewrite(monkeypatch, owner, name, old, new)
        return parameters

    return plant


def scale_result(owner, name, factor):
    def plant(monkeypatch, parameters):
        healthy = getattr(owner, name)
        monkeypatch.setattr(owner, name, lambda *args, **options: factor * healthy(*args, **options))
        return parameters

    return plant


def change(**parts):
    """Change fields of parts of the parameters, as an edit of `parameters.toml` would."""

    def plant(monkeypatch, parameters):
        return replace(parameters, **{part: replace(getattr(parameters, part), **each) for part, each in parts.items()})

    return plant


def measure_groups(parameters, groups, derivation=None):
    """The baseline of some groups of quantities, all of which can be measured."""
    subject = Subject(parameters=parameters, derivation=derivation)
    readings, failures = measure(
        subject, groups={group: EXPERIMENTS[group] for group in groups}, progress=lambda _: None
    )
    assert not failures
    return make_baseline("sensor", readings)


@contextlib.contextmanager
def take_every(step):
    """Every n-th case of the default campaigns."""
    whole = evaluation.read_plan

    def read_plan(*arguments):
        plan = whole(*arguments)
        return replace(plan, cases=plan.cases[::step])

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evaluation, "read_plan", read_plan)
        yield


def own_filter(**values):
    return lambda monkeypatch, parameters: replace(parameters, filter=Butterworth(**values))


def kernel_sigma(factor):
    def plant(monkeypatch, parameters):
        healthy = fastmodel.signal.point_spread.sample_gaussian
        monkeypatch.setattr(
            fastmodel.signal.point_spread, "sample_gaussian", lambda at, sigma, size: healthy(at, factor * sigma, size)
        )
        return parameters

    return plant


def fitted_sigma(factor):
    def plant(monkeypatch, parameters):
        kernel = parameters.spread
        spread = replace(kernel, sigma_x=factor * kernel.sigma_x, sigma_y=factor * kernel.sigma_y)
        return replace(parameters, spread=spread)

    return plant


def change_image(turn):
    def plant(monkeypatch, parameters):
        healthy = ChainFunctions.frame

        def frame(self, state, noise=None, **options):
            state, output = healthy(self, state, noise, **options)
            return state, output._replace(image=np.array(turn(output.image)))

        monkeypatch.setattr(ChainFunctions, "frame", frame)
        return parameters

    return plant


def change_texel(factor, texel=17):
    def plant(monkeypatch, parameters):
        gains = np.ones(parameters.array.count)
        gains[texel] = factor
        return replace(parameters, electronics=replace(parameters.electronics, gains=tuple(gains)))

    return plant


def lag(monkeypatch, parameters):
    """Make the chain pass each sample on only when the next one arrives."""
    healthy = ChainFunctions.take

    def take(self, state, *signals):
        before, self.waiting = getattr(self, "waiting", signals), signals
        return healthy(self, state, *before)

    monkeypatch.setattr(ChainFunctions, "take", take)
    return parameters


def shift_springs(monkeypatch, parameters):
    """Move the force of the springs under a body by 5 %, up and down in turn, with the sum as it was."""
    healthy = FoundationSolver.solve

    def solve(self, samples, loads):
        stiffness = samples.coverage * np.where(samples.row // 4 % 2, 0.95, 1.05)
        return healthy(self, replace(samples, coverage=stiffness), loads)

    monkeypatch.setattr(FoundationSolver, "solve", solve)
    return parameters


def dead_texel(monkeypatch, parameters):
    """Make the electronics lose the counts of one texel."""
    healthy = Electronics.counts

    def counts(self, forces, noise=None):
        found = healthy(self, forces, noise)
        found[..., 5] = 0
        return found

    monkeypatch.setattr(Electronics, "counts", counts)
    return parameters


def cover_depth(monkeypatch, parameters):
    healthy = CellReader._sum

    def total(self, *args):
        solved = healthy(self, *args)
        approach = solved.reading.approach
        return (
            solved if approach is None else solved._replace(reading=solved.reading._replace(approach=1.05 * approach))
        )

    monkeypatch.setattr(CellReader, "_sum", total)
    return parameters


def transposed_influence(monkeypatch, parameters):
    """Take the influence of a cell with rows and columns exchanged."""
    healthy = CoverCells.influence_factors.func
    monkeypatch.setattr(CoverCells, "influence_factors", property(lambda self: healthy(self)[::-1]))
    return parameters


def slow_down(monkeypatch, parameters):
    monkeypatch.setitem(PUBLISHED["tegin-2005"].terms, "y = 0.1 f + 0.9 y every 2.5 ms", recursion(0.1, 3e-3))
    return parameters


FLOAT = "measured = as_floats(xp, forces)"
#: Plants that are asked for by name, with the group and words of the title of a quantity that must be red.
REQUIRED = {
    "sigma of the kernel +3 %": (kernel_sigma(1.03), "spread: share"),
    "fitted sigma +3 %": (fitted_sigma(1.03), "spread: share"),
    "cut-off +5 %": (edit(Butterworth, "sections", "self.cutoff_hz, fs", "1.05 * self.cutoff_hz, fs"), "filter: rise time"),
    "cut-off +5 %, of the sensor": (own_filter(cutoff_hz=31.5, order=2), "filter: rise time"),
    "sensitivity +5 %": (change(electronics={"sensitivity": 1.05 * 2665.7}), "characteristic: sensitivity"),
    "sensitivity +5 %, in the code": (
        edit(Electronics, "counts", "self.sensitivity * applied", "1.05 * self.sensitivity * applied"),
        "characteristic: sensitivity",
    ),
    "one texel dead": (dead_texel, "characteristic: counts of each texel"),
    "one texel dead, by its gain": (change_texel(0.0), "characteristic: counts of each texel"),
    "image transposed": (change_image(np.transpose), "orientation: image"),
    "filter order one too high": (edit(Butterworth, "sections", "butter(self.order,", "butter(self.order + 1,"), "filter: overshoot"),
    "filter order one too low, of the sensor": (own_filter(cutoff_hz=30.0, order=1), "filter: overshoot"),
    "load +3 %": (edit(fastmodel.bench, "add_indenter", "= load / STANDARD_GRAVITY", "= 1.03 * load / STANDARD_GRAVITY"), "H: cover, load carried"),
    "saturation 5 % low": (
        edit(fastmodel.signal.electronics, "saturate", "xp = find", "output_max = 0.95 * output_max; xp = find"),
        "characteristic: largest count (saturation)",
    ),
    "saturation 5 % low, of the sensor": (
        change(electronics={"output_max": round(0.95 * 3895)}),
        "characteristic: largest count (saturation)",
    ),
    "noise doubled": (edit(Electronics, "counts", "self.noise * drawn", "2 * self.noise * drawn"), "noise: standard deviation"),
    "frame one step late": (lag, "frames: delay of the force"),
    "frame one step late, in its time": (
        edit(Sensor, "_count_due", "(time - self._start)", "(time - self._start - self._timestep)"),
        "frames: time of the first frames",
    ),
    "springs 5 % unequal": (shift_springs, "H: foundation, force of each texel"),
    "misplaced force 5 % small": (scale_result(validation.metrics, "misplaced_force", 0.95), "metric: misplaced force"),
    "relative L2 5 % small": (scale_result(validation.metrics, "relative_l2", 0.95), "metric: relative l2"),
    "total force error 5 % small": (scale_result(validation.metrics, "total_force_error", 0.95), "metric: total force error"),
    "centre of pressure 5 % small": (scale_result(validation.metrics, "centre_of_pressure_error", 0.95), "metric: centre of pressure"),
    "Wasserstein 5 % small": (scale_result(validation.metrics, "wasserstein", 0.95), "metric: wasserstein"),
    "peak error 5 % small": (scale_result(validation.metrics, "peak_error", 0.95), "metric: peak error"),
    "image changed 5 % small": (edit(validation.metrics, "score_images", "100 * difference", "95 * difference"), "metric: image changed"),
}  # fmt: skip
#: Further plants of the same classes.
NEIGHBOURS = {
    "sigma along x and y exchanged": (edit(Gaussian, "operator", "sample_gaussian(offset_x, self.sigma_x", "sample_gaussian(offset_x, self.sigma_y"), "oblong texels: boxes, largest force after spread"),
    "force outside lost": (edit(fastmodel.bench, "_describe", "reading.carried - texel_forces.sum()", "0.0"), "H: boxes, force outside"),
    "image upside down": (change_image(np.flipud), "orientation: image"),
    "filter of the sensor lost": (lambda monkeypatch, parameters: replace(parameters, filter=None), "filter: rise time"),
    "share of the calibration tip -1 %": (change(electronics={"tip_share": 0.99 * 0.7646}), "characteristic: sensitivity"),
    "gain of one texel +3 %": (change_texel(1.03), "characteristic: counts of each texel"),
    "frame rate +1 %": (change(electronics={"rate_hz": 1.01 * 271}), "characteristic: frame rate"),
    "counts cut instead of rounded": (edit(Electronics, "counts", "round_half_to_even(xp, limited)", "limited"), "electronics: gains of texels"),
    "hysteresis halved": (edit(Electronics, "apply_hysteresis", "forces - self.hysteresis_width, forces", "forces - 0.5 * self.hysteresis_width, forces"), "electronics: hysteresis"),
    "hysteresis not reset": (
        edit(Sensor, "_settle", "self._functions.settle(*_list_signals(self._reading))", "self._functions.settle(*_list_signals(self._reading))._replace(**({'play': self._state.play} if hasattr(self, '_state') else {}))"),
        "reset: trace of the load before",
    ),
    "noise with a mean": (edit(Electronics, "counts", "self.noise * drawn", "self.noise * (drawn + 0.1)"), "noise: mean"),
    "seed ignored": (edit(fastmodel.sensor, "make_generator", "SeedSequence(seed.entropy,", "SeedSequence(0,"), "noise: correlation"),
    "seed never the same": (edit(fastmodel.sensor, "make_generator", "PCG64(own)", "PCG64()"), "noise: difference for the same seed"),
    "frame stamped one step late": (edit(Sensor, "step", "self._reading, self._sampled_at = reading, now", "self._reading, self._sampled_at = reading, now + self._timestep"), "frames: delay of the time"),
    "load carried by the boxes +5 %": (edit(BoxReader, "read", "None, carried)", "None, 1.05 * carried)"), "H: boxes, load carried"),
    "cover: depth +5 %": (cover_depth, "ball: cover, depth"),
    "foundation modulus +5 %": (scale_result(CoverCells, "foundation_modulus", 1.05), "spread: foundation modulus"),
    "cells of the cover along x and y exchanged": (edit(CellGrid, "over", "(array.pitch[0] / per_texel, array.pitch[1] / per_texel)", "(array.pitch[1] / per_texel, array.pitch[0] / per_texel)"), "oblong texels: cover, force of each texel"),
    "influence of the cover transposed": (transposed_influence, "oblong texels: cover, force of each texel"),
    "force on masked texels lost": (edit(fixed_images, "score", " + float(f_all[~array.active].sum())", ""), "metric: misplaced force"),
    "interval of pooled scores too narrow": (edit(validation.pooling, "pool", "(1 + level) / 2", "level"), "pooling: skill"),
    "skill against the own error": (edit(fixed_images, "skill", "e.mean() / c.mean()", "c.mean() / e.mean()"), "pooling: skill"),
}  # fmt: skip


#: Plants of what changes in time, and of touches.
IN_TIME = {
    "noise told 5 % smaller": (edit(Channel, "information", "self.noise**-2", "1.1 * self.noise**-2"), "touches: bound of x and y"),
    "intervals 20 % narrower": (edit(Posterior, "summarise", "[0.025, 0.975]", "[0.06, 0.94]"), "touches: interval of x and y"),
    "errors of places neglected": (edit(next_touches, "inform", "errors.place * slopes", "0 * slopes"), "touches: interval of planned gains and cover"),
    "pitch of a design 2 % larger": (edit(design, "_scale_array", "pitch / min", "1.02 * pitch / min"), "touches: numbers of a design"),
    "creep 5 % too small": (edit(Creep, "step", "self.weight * xp", "0.95 * self.weight * xp"), "in time: creep of a held load"),
    "a filter that is computed more rarely": (slow_down, "in time: step through published filters, after 6 and 20 ms"),
    "misplaced force halved": (scale_result(run, "measure_misplaced", 0.5), "in time: scores of a moving case"),
    "error by one percent of itself": (scale_result(run, "measure_error", 1.01), "in time: scores of a moving case"),
    "latency 2 % longer": (scale_result(run, "find_latency", 1.02), "in time: delay and latency of a moving case"),
    "frames that lose 0.5 % of force": (scale_result(run, "hold", 0.995), "in time: scores of a moving case"),
    "loads interpolated 1 % too high": (scale_result(run, "interpolate", 1.01), "in time: force on the texels of a moving case"),
}  # fmt: skip


def change_results(monkeypatch, change_one):
    """Pass every result of the finite elements through a function."""
    healthy = press.press_path
    monkeypatch.setattr(
        press, "press_path", lambda *args, **options: [change_one(each) for each in healthy(*args, **options)]
    )


def change_reference(**factors):
    """Multiply results of the finite elements by factors."""

    def plant(monkeypatch, parameters):
        change_results(
            monkeypatch,
            lambda found: replace(found, **{name: factor * getattr(found, name) for name, factor in factors.items()}),
        )
        return parameters

    return plant


def halve_estimates(monkeypatch, parameters):
    change_results(
        monkeypatch,
        lambda found: replace(
            found, error_estimate={name: 0.5 * value for name, value in found.error_estimate.items()}
        ),
    )
    return parameters


#: Plants that only sensors under a known cover show, with all titles that must be red.
REFERENCE = {
    "load +3 %, as read": (
        scale_result(indenter, "_read_positive", 1.03),
        {"reference: load", "reference: largest texel force"},
    ),
    "reference: texel forces +1 %": (change_reference(texel_forces=1.01), {"reference: largest texel force"}),
    "reference: force outside +20 %": (change_reference(outside=1.2), {"reference: force outside"}),
    "reference: depth +1 %": (change_reference(depth=1.01), {"reference: depth"}),
    "reference: contact area +2 %": (change_reference(contact_area=1.02), {"reference: contact area"}),
    "reference: error estimates halved": (halve_estimates, {"reference: estimated error"}),
    "load of the fast model +3 %": (
        edit(fastmodel.bench, "add_indenter", "= load / STANDARD_GRAVITY", "= 1.03 * load / STANDARD_GRAVITY"),
        {"accuracy: misplaced force", "accuracy: total force error"},
    ),
    "metric 5 % small": (
        scale_result(validation.metrics, "misplaced_force", 0.5),
        {"accuracy: mean misplaced force of each method"},
    ),
}
FRICTION = {
    "coefficient of friction +10 %": (
        edit(RubbingContact, "_slide", "self.friction * np.maximum", "1.1 * self.friction * np.maximum"),
        {"friction: shear"},
    ),
    "the cover is stiffer across than it is": (
        edit(
            VectorOperator,
            "__init__",
            "(x, y, *cell)",
            "(x, y, *cell) * np.outer([1, 0.9, 0.9], [1, 0.9, 0.9])[..., None, None]",
        ),
        {"friction: shear"},
    ),
}
RELAXING = {
    "times of relaxation 5 % too long": (
        edit(Relaxation, "mean", "zip(self.g, self.tau,", "zip(self.g, [1.05 * tau for tau in self.tau],"),
        {"force at a held depth", "depth under a held load", "force of a growing contact"},
    ),
    "the depth of a growing contact relaxes instead of its force": (
        edit(_Follower, "follow", "matrix @ curve.forces(grown)", "curve.forces(matrix @ grown)"),
        {"force of a growing contact"},
    ),
    "depths for 0.2 % more force": (
        edit(ElasticCurve, "depth", "self._log_force(x) - wanted", "self._log_force(x) - wanted - 0.002"),
        {"depth under a held load"},
    ),
}
