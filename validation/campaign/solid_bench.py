"""The bench of a solid cover: the fast model and simpler models against finite elements, press by press."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from fem_reference.curved_cover.responses import find_top
from meshes.array_types import FloatArray
from validation.campaign.bench import Bench, ModelForces, Verification, prepare_bench
from validation.campaign.campaign_file import Inputs
from validation.campaign.case import Case
from validation.campaign.plan import COSTS, measure_pace
from validation.campaign.results import CaseResult
from validation.credibility.uncertainty import InputUncertainty
from validation.credibility.verification import check_finer_mesh, check_shell
from validation.derivation.solid import SolidDerivation
from validation.errors import InputError

if TYPE_CHECKING:
    from fastmodel import Parameters
    from fastmodel.surface import CoverPoints
    from meshes import Pose

#: Names of the scored models of a curved cover, with a description of each for tables.
CURVED_MODELS: Mapping[str, str] = {
    "fast": "the fast model: contact by the compliance of the surface, an operator from its cells to the texels",
    "gaussian": "the contact of the fast model, spread by one fitted Gaussian in surface coordinates",
    "rigid": "the 2015 report's form: the points that rigid bodies touch first, the same Gaussian",
    "no-spread": "null: the same points, their forces on the nearest texels without spread",
    "zeros": "null: an empty image",
}
#: Distance over the thickness up to which points of the cover count as first touched by a rigid indenter [-].
_FIRST = 0.01
#: Angle between the motion and the normal of the cover above which a direction counts as oblique [rad].
_OBLIQUE = math.radians(10)
#: Depth over the thickness that divides the cases into the two groups of shallow and deep ones [-].
_DEEP = 0.08


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidBench(Bench):
    """Bench of a sensor with a solid cover of any shape.

    Attributes:
        derivation: Responses of the texels, and the Gaussian fitted to them.
    """

    models = CURVED_MODELS
    notes: ClassVar[Mapping[str, str]] = {
        "campaign": (
            "What the scores compare. Fast model and reference share their assumptions of contact (along the normals "
            "of the undeformed cover, frictionless, small strain), and the mesh of the fast model is one of the "
            "reference's. Both solve the contact on cells; the reference on more of them, and with the finest mesh. So "
            "the scores show what the fast model loses by its mesh and its cells, not the error of the common "
            "assumptions; the error of the reference is estimated beside each score and checked in the verification. "
            "Texel forces on a curved base do not sum to the load; misplaced force is half the sum of the differences "
            "over the load. Distances (centre of pressure, Wasserstein) are straight lines in space."
        ),
        "cases": (
            "Forces are along the normal of each texel. The maps unroll the surface about the middle texel; y points "
            "up. Pictures: the reference, from left to right contact pressure on the deformed cover, a section, forces "
            "on the texels."
        ),
        "verification": (
            "The first row is independent of this cover and of any contact: a known pressure on a shell whose solution "
            "is a series. The rows of cases compare each mesh of the reference with a finer one, which shares its "
            "statement of contact; the limit of their result is the error that the reference states for itself."
        ),
        "responses": (
            "The Gaussian in surface coordinates is the report's form of the response: two numbers for the whole "
            "cover. The fast model has an operator of its own for every place on the surface."
        ),
        "calibration": (
            "The fast model: compliance and influence of the top by finite elements, before any case was pressed; "
            "nothing is fitted. The Gaussian: least squares to uniform loads over all texels."
        ),
        "limits": (
            "The cover has free sides and is bonded to a rigid base. The indenter is guided along its direction and "
            "does not turn."
        ),
    }
    left_out = (
        (
            "Uncertain thickness and Poisson ratio are not propagated: each needs a new mesh and new responses of all "
            "texels, minutes for each change; modulus, position and yaw are propagated through the fast model."
        ),
        (
            "The error is not divided into stages: the pressures of the reference would have to be solved again on the "
            "mesh of the fast model, as long as the campaign; the row “gaussian” of the table of models shows the "
            "spread to the texels."
        ),
        "Published models are not scored: they are stated for planar arrays.",
        "Recordings are not scored: none of a curved array under known loads is public.",
        "Nothing is compared with the solution of a laterally wide layer: this cover is none.",
    )
    derivation: SolidDerivation

    def require_fast_model(self) -> CoverPoints:
        """Return compliance and influence of the surface, with which the fast model computes.

        Raises:
            InputError: If the meshes are too fine for the fast model.
        """
        from fastmodel.surface import CoverPoints

        surface = self.parameters.surface
        if not isinstance(surface, CoverPoints):
            raise InputError(
                f"{self.derivation.sensor.source}: the meshes of this cover are too fine for the fast model, so there "
                "is nothing to validate; state a larger cover.element_size"
            )
        return surface

    def verify(self, results: Sequence[CaseResult]) -> Iterator[Verification]:
        """Yield the checks of the elements: a shell with a closed form, and a finer mesh of the cover."""
        material, thickness = self.cover.layers[0].material, self.cover.thickness
        meshes = tuple(grid.mesh for grid in self.derivation.responses.grids)
        yield Verification("verification of the elements on a shell", lambda: [check_shell(material, thickness)])
        yield Verification(
            "verification on a finer mesh",
            partial(check_finer_mesh, self.cover, self.parameters.array, meshes, results, self.friction),
            seconds=measure_pace() * COSTS.finer,
        )

    def propagate(self, case: Case, inputs: Inputs) -> InputUncertainty:
        """Propagate modulus, position and yaw through the fast model, by plus and minus one standard uncertainty each.

        A linear cover of modulus c E under the load F has c times the forces of one of modulus E under F / c.
        """
        from fastmodel.contact.points import press_points

        cover, pose, load = self.require_fast_model(), case.pose, case.load

        def press(where: Pose, factor: float = 1.0) -> FloatArray:
            return factor * press_points(cover, case.indenter, where, load=load / factor).texel_forces

        def move(direction: FloatArray) -> Callable[[float], FloatArray]:
            return lambda by: press(replace(pose, point=tuple((pose.position + by * direction).tolist())))

        across = pose.rotation[:, :2].T
        changes: dict[str, tuple[float, Callable[[float], FloatArray]]] = {
            "modulus [relative]": (inputs.modulus, lambda by: press(pose, float(np.exp(by)))),
            "position x [m]": (inputs.position, move(across[0])),
            "position y [m]": (inputs.position, move(across[1])),
            "yaw [rad]": (inputs.yaw, lambda by: press(replace(pose, yaw=pose.yaw + by))),
        }
        return InputUncertainty(
            load=load,
            uncertainties={name: each for name, (each, _) in changes.items() if each},
            image=press(pose),
            effects={name: (image(each) - image(-each)) / 2 for name, (each, image) in changes.items() if each},
            note="thickness, Poisson ratio and friction are not propagated on solid covers",
        )

    def classify(self, result: CaseResult) -> Mapping[str, str]:
        """Return shape, direction and depth of a case as words."""
        deep = result.reference.depth > _DEEP * self.cover.thickness
        return {
            "shape": result.case.shape.split(":")[0],
            "direction": "oblique" if measure_obliquity(result) > _OBLIQUE else "along the normal",
            "depth": f"{'above' if deep else 'up to'} {100 * _DEEP:g} % of the thickness",
        }

    def measure(self, result: CaseResult) -> dict[str, float]:
        """Return the quantities of every bench, and the angle between motion and normal [rad]."""
        return super().measure(result) | {"obliquity_rad": measure_obliquity(result)}

    def compute_models(self, case: Case) -> ModelForces:
        """Compute one case by the fast model, simpler ones and null models."""
        from fastmodel.contact.points import find_first_contact, press_points

        cover, array, gaussian = self.require_fast_model(), self.parameters.array, self.derivation.gaussian
        fast = press_points(cover, case.indenter, case.pose, load=case.load)
        pressed = fast.pressure
        spread = gaussian.spread(array, pressed.place, pressed.normal)
        first = find_first_contact(cover, case.indenter, case.pose, case.pose.towards, within=_FIRST * cover.thickness)
        points, normals = cover.points[first], cover.normals[first]
        # Equal forces along the normals whose components against the motion sum to the load.
        share = case.load / float(-(normals @ case.pose.towards).sum())
        apart = np.linalg.norm(points[:, None] - array.centres[None], axis=2)
        nearest = np.bincount(apart.argmin(axis=1), minlength=array.count)
        forces = {
            "fast": fast.texel_forces,
            "gaussian": pressed.forces @ spread,
            "rigid": share * gaussian.spread(array, points, normals).sum(axis=0),
            "no-spread": share * nearest * array.active,
            "zeros": np.zeros(array.count),
        }
        return ModelForces({name: (each, 0.0) for name, each in forces.items()})


def measure_obliquity(result: CaseResult) -> float:
    """Return the angle between the motion of the indenter and the normal of the cover where it is placed [rad]."""
    pose, top = result.case.pose, find_top(result.reference.found.mesh)
    normal = top.normals[int(np.argmin(np.linalg.norm(top.nodes - pose.position, axis=1)))]
    return float(np.arccos(np.clip(-normal @ pose.towards, -1.0, 1.0)))


@prepare_bench.register(SolidDerivation)
def _(
    derivation: SolidDerivation,
    cases: Sequence[Case],
    progress: Callable[[str], None] | None = None,
    *,
    parameters: Parameters | None = None,
) -> Bench:
    del cases  # No model is fitted to other presses.
    if progress:
        progress("fast model, compliance of the surface")
    sensor = derivation.sensor
    bench = SolidBench(
        cover=sensor.cover,
        parameters=parameters or derivation.parameters,
        friction=sensor.friction,
        derivation=derivation,
    )
    bench.require_fast_model()
    return bench
