"""A kind of cover that no file of the package knows: it presses, is derived and is scored by registration alone."""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

import validation
from fastmodel import Parameters
from fastmodel.signal.point_spread import Gaussian
from fem_reference import press, press_path
from fem_reference.errors import UnsupportedError
from fem_reference.indentation.press import solve_press
from fem_reference.indentation.result import Indentation
from meshes import Layer, Material, Pose, Sphere
from validation.campaign.bench import Bench, ModelForces, prepare_bench
from validation.campaign.case import Case
from validation.campaign.run import run_campaign
from validation.derivation.base import derive_cover
from validation.derivation.derive import derive
from validation.errors import InputError
from validation.sensor_file import BUILT_IN

#: Edge of the cells on which the bed is solved [m].
CELL = 0.05e-3
BALL = Sphere(radius=5e-3)
FOAM = Material(name="foam", model="linear-elastic", parameters={"youngs_modulus": 1e5}, poisson_ratio=0.0)


@dataclasses.dataclass(frozen=True, kw_only=True)
class SpringBed:
    """Independent springs (Winkler): the pressure is a stiffness [Pa/m] times the overlap."""

    stiffness: float
    layers: tuple[Layer, ...] = (Layer(thickness=2e-3, material=FOAM),)
    assumed: bool = False
    base: str = "bonded"
    size: None = None
    source: str = "a bed of springs"
    notes: tuple[str, ...] = ()
    thickness: float = 2e-3


@solve_press.register
def _(cover: SpringBed, problem) -> list[Indentation]:
    if problem.friction:
        raise UnsupportedError("springs bear no shear; leave it out", "friction")
    return [_press_springs(cover, problem, target) for target in problem.targets]


def _press_springs(cover, problem, target):
    array, indenter, pose = problem.array, problem.indenter, problem.pose
    half = math.ceil(max(indenter.footprint) / CELL)
    x, y = (CELL * each.ravel() for each in np.meshgrid(*(np.arange(-half, half) + 0.5,) * 2))
    gap = indenter.gap(x, y)

    def pressed(depth):
        return cover.stiffness * CELL**2 * np.maximum(depth - gap, 0.0)

    depth = target
    if problem.control == "load":
        low, depth = 0.0, cover.thickness
        for _ in range(60):
            middle = (low + depth) / 2
            low, depth = (middle, depth) if pressed(middle).sum() < target else (low, middle)
    force = pressed(depth)
    at_x, at_y = pose.to_array(x, y)
    beside = np.abs(array.centres[:, None, :2] - np.stack([at_x, at_y], axis=1)) <= np.array(array.pitch) / 2
    texels = (beside.all(axis=2) @ force) * array.active
    total = float(force.sum())
    whole = np.array([0.0, 0.0, -total])
    return Indentation(
        texel_forces=texels, outside=total - float(texels.sum()), total_force=total, force=whole, moment=np.zeros(3),
        base_force=whole, unmeasured=np.zeros(3), balance=0.0, depth=depth, contact_area=CELL**2 * (force > 0).sum(),
        contact_points=np.stack([at_x, at_y, np.zeros_like(x)], axis=1),
        contact_forces=np.stack([*np.zeros((2, len(x))), -force], axis=1),
        error_estimate={"total_force": 1e-3, "peak_texel": 1e-3}, warnings=(),
        assumptions={"strain": "small", "friction": "frictionless"},
    )  # fmt: skip


@derive_cover.register
def _(cover: SpringBed, sensor, progress=None):
    """Springs do not spread a load."""
    del cover, progress
    narrow = Gaussian(sigma_x=0.1, sigma_y=0.1, ksize_x=1, ksize_y=1)
    parameters = Parameters(array=sensor.array, spread=narrow, electronics=sensor.electronics)
    return SpringDerivation(sensor=sensor, parameters=parameters)


class SpringDerivation(SimpleNamespace):
    """The sensor, and the parameters of its fast model."""


class SpringBench(Bench):
    """Scores two models against the springs."""

    models: ClassVar = {"fast": "the bed as it is known", "zeros": "an empty image"}

    def compute_models(self, case):
        # A model of the right shape that lacks a tenth of the load.
        found = press(self.cover, self.parameters.array, case.indenter, case.pose, load=case.load)
        near = 0.9 * found.texel_forces
        return ModelForces({"fast": (near, case.load - float(near.sum())), "zeros": (0 * near, 0.0)})

    def verify(self, results):
        return iter(())

    def propagate(self, case, inputs):
        raise NotImplementedError

    def classify(self, result):
        return {"shape": result.case.shape}

    def measure(self, result):
        return {"load_N": result.case.load}


@prepare_bench.register
def _(derivation: SpringDerivation, cases, progress=None, *, parameters=None):
    del cases, progress, parameters
    return SpringBench(cover=derivation.sensor.cover, parameters=derivation.parameters)


BED = SpringBed(stiffness=2e8)
SENSOR = dataclasses.replace(BUILT_IN["wts-0614-34"], name="springs", cover=BED)


def test_it_presses_with_the_closed_form_of_a_ball_on_springs():
    """The load is pi k R d^2 for depths far below the radius."""
    found = press(BED, SENSOR.array, BALL, Pose.planar((1e-3, 2e-3), yaw=0.3), depth=0.2e-3)
    assert found.total_force == pytest.approx(math.pi * 2e8 * 5e-3 * 0.2e-3**2, rel=0.02)
    again = press_path(BED, SENSOR.array, BALL, loads=[found.total_force / 4, found.total_force])
    assert again[1].depth == pytest.approx(0.2e-3, rel=1e-6)
    assert again[0].depth == pytest.approx(0.1e-3, rel=0.03)


def test_what_its_solver_refuses_names_the_option():
    with pytest.raises(InputError, match="--friction: springs bear no shear; leave it out"):
        validation.press(SENSOR, "sphere:radius=5mm", load="1 N", friction="0.3", models=("fem",))


def test_it_presses_through_the_public_verb_by_both_models():
    found = validation.press(SENSOR, "sphere:radius=5mm", load="1 N", at="1mm,2mm")
    assert found.fem.total_force == pytest.approx(1.0)
    assert found.fast.total_force == pytest.approx(1.0, rel=0.02)
    shown = found.as_json()
    assert shown["cover"]["body"] == "a bed of springs"
    assert shown["models"]["fem"]["error_estimate"]["peak_texel"] == 1e-3
    assert 0 < shown["scores"]["misplaced_force"] < 1


@pytest.mark.slow
def test_it_is_derived_and_scored():
    cases = [Case(name=f"ball {load} N", indenter=BALL, shape="sphere:radius=5mm", load=load) for load in (0.5, 1.0)]
    result = run_campaign(prepare_bench(derive(SENSOR), cases), cases)
    assert not result.skipped
    assert result.pooled["fast"]["misplaced_force"].mean < result.pooled["zeros"]["misplaced_force"].mean


def test_a_cover_without_a_solver_is_told_so():
    with pytest.raises(TypeError, match="no solver is registered for a cover of type str"):
        press("glue", SENSOR.array, BALL, load=1.0)
