"""Made-up presses into solids: targets, meshes that are added for an accuracy, and problems that are refused."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from fem_reference import result_store
from fem_reference.curved_cover import press as module
from fem_reference.curved_cover.press import press_solid
from fem_reference.errors import UnsupportedError
from fem_reference.indentation.result import PressProblem
from meshes import Sphere, TexelArray
from meshes.pose import Pose

COARSE, FINE, FINER = (SimpleNamespace(digest=name) for name in ("coarse", "fine", "finer"))


@dataclass(frozen=True)
class Stated:
    """A result on a mesh, with its largest error."""

    mesh: object
    error_estimate: dict
    warnings: tuple = ()
    seconds: float = 0.0


@pytest.fixture
def solve(monkeypatch):
    """Press with solvers that note their calls; errors are 4, 2 and 1 % on the three meshes."""

    def answer(**options):
        calls, stored, told = [], [], []

        def make(name):
            def solver(meshes, layers, problem, target):
                calls.append((name, [each.digest for each in meshes], layers, target))
                error = {"coarse": 0.04, "fine": 0.02, "finer": 0.01}[meshes[-1].digest] * (1 if target < 1 else 1.5)
                used = meshes[-2] if name == "finite" else meshes[-1]
                return Stated(mesh=used, error_estimate={"depth": error / 2, "peak_texel": error})

            return solver

        def fetch(kind, inputs, compute):
            stored.append((kind, inputs))
            return compute()

        monkeypatch.setattr(result_store, "fetch", fetch)
        for name in ("finite", "rubbing", "small"):
            monkeypatch.setattr(module, f"press_{name}", make(name))
        layers, refine = options.pop("layers", (0.6e-3, 1.4e-3)), options.pop("refine", True)
        cover = SimpleNamespace(
            layers="layers", thicknesses=layers, thickness=sum(layers), meshes=lambda _progress: (COARSE, FINE),
            refine=(lambda given: FINER if given == layers else None) if refine else None,
        )  # fmt: skip
        known = {"indenter": Sphere(radius=3e-3), "pose": Pose(), "targets": (0.5,), "control": "load"}
        problem = PressProblem(**(known | {"array": TexelArray.grid(1, 1, 2e-3), "progress": told.append} | options))
        return SimpleNamespace(found=press_solid(cover, problem), calls=calls, stored=stored, told=told)

    return answer


@pytest.mark.parametrize(
    ("options", "solver"),
    [
        ({}, "small"),
        ({"strain": "small", "friction": 0.3}, "rubbing"),
        ({"friction": np.inf}, "rubbing"),
        ({"strain": "finite"}, "finite"),
    ],
)
def test_strain_and_friction_choose_the_solver_of_each_target(solve, options, solver):
    asked = solve(targets=(0.5, 2.0), **options)
    assert asked.calls == [(solver, ["coarse", "fine"], "layers", target) for target in (0.5, 2.0)]
    assert [each.mesh for each in asked.found] == [COARSE if solver == "finite" else FINE] * 2
    assert asked.told == []
    for (kind, inputs), target in zip(asked.stored, (0.5, 2.0), strict=True):
        assert (kind, inputs["meshes"], inputs["load"]) == ("solid-press", ["coarse", "fine"], target)
        assert (inputs["finite"], inputs["friction"]) == (solver == "finite", options.get("friction", 0.0))


@pytest.mark.parametrize(
    ("accuracy", "options", "meshes", "missed"),
    [
        (None, {}, [["coarse", "fine"]], 0),
        (0.02, {}, [["coarse", "fine"]], 0),
        (0.0199, {}, [["coarse", "fine"], ["fine", "finer"]], 0),
        (0.009, {}, [["coarse", "fine"], ["fine", "finer"]], 1),
        (0.0199, {"refine": False}, [["coarse", "fine"]], 1),
        (0.016, {"targets": (0.5, 2.0)}, [["coarse", "fine"]] * 2 + [["fine", "finer"]] * 2, 0),
        (0.014, {"targets": (0.5, 2.0)}, [["coarse", "fine"]] * 2 + [["fine", "finer"]] * 2, 1),
    ],
)
def test_a_finer_mesh_is_added_where_any_target_misses_the_accuracy(solve, accuracy, options, meshes, missed):
    asked = solve(accuracy=accuracy, **options)
    assert [names for _, names, *_ in asked.calls] == meshes
    added = ["fine", "finer"] in meshes
    assert asked.told == ([f"{100 * accuracy:.3g} % wanted: a finer mesh is added"] if added else [])
    assert asked.found[-1].mesh is (FINER if added else FINE)
    assert sum(len(each.warnings) for each in asked.found) == missed
    assert len(asked.found) == len(options.get("targets", (0.5,)))


@pytest.mark.parametrize(
    ("options", "argument", "words"),
    [
        ({"friction": 0.1, "strain": "finite"}, "friction", "friction is computed at small strain only"),
        ({"strain": "finite", "layers": (1.91e-3, 0.089e-3)}, "strain", "layers thinner than 4.5 % of the cover"),
        ({"strain": "finite", "pose": Pose(tilt=(0.0, 0.01))}, "tilt", "moves along its own axis"),
        ({"accuracy": 0.0069}, "accuracy", "the smallest error that is stated here is 0.70%"),
    ],
)
def test_problems_beyond_the_solvers_name_their_argument(solve, options, argument, words):
    with pytest.raises(UnsupportedError, match=words) as told:
        solve(**options)
    assert told.value.argument == argument


@pytest.mark.parametrize(
    "options",
    [
        {"strain": "finite", "layers": (1.909e-3, 0.091e-3)},
        {"layers": (1.91e-3, 0.089e-3)},
        {"pose": Pose(tilt=(0.0, 0.01))},
        {"accuracy": 0.007},
    ],
)
def test_problems_within_the_limits_are_solved(solve, options):
    assert solve(**options).found


def test_the_time_of_each_target_is_its_own(solve, monkeypatch):
    clock = iter([1.0, 3.5, 10.0, 10.25])
    monkeypatch.setattr(module.time, "perf_counter", lambda: next(clock))
    assert [each.seconds for each in solve(targets=(0.5, 2.0)).found] == [2.5, 0.25]
