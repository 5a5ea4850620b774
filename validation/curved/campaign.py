"""Campaigns on curved covers: the fast model and simpler models against finite elements, press by press."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fastmodel.surface import CoverPoints
from fem_reference.result_store import NotStoredError, stored_only
from meshes.array_types import FloatArray
from validation.campaign.case import Case
from validation.campaign.cost import Clock, Plan
from validation.campaign.results import CampaignResult, CaseResult, Reference
from validation.campaign.run import predict, run_cases, summarise
from validation.curved.derive import CurvedDerivation
from validation.curved.fast import press_fast
from validation.curved.reference import press_case
from validation.errors import InputError

if TYPE_CHECKING:
    from fastmodel import Parameters
    from fastmodel.surface import CoverPoints
    from meshes.solids import SolidMesh
    from validation.sensor_file import SensorDescription

#: Names of the scored models of a curved cover, with a description of each for tables.
CURVED_MODELS: Mapping[str, str] = {
    "fast": "the fast model: contact by the compliance of the surface, an operator from its points to the texels",
    "gaussian": "the contact of the fast model, spread by one fitted Gaussian in surface coordinates",
    "rigid": "the 2015 report's form: the points that rigid bodies touch first, the same Gaussian",
    "no-spread": "null: the same points, their forces on the nearest texels without spread",
    "zeros": "null: an empty image",
}
#: Distance over the thickness up to which points of the cover count as touched first by a rigid indenter [-].
_FIRST = 0.01
#: Time of a press that is not stored, and of one that is, and of everything else without and with stored responses [s].
_PRESS, _STORED_PRESS, _REST, _STORED_REST = 8.0, 0.5, 150.0, 60.0


@dataclass(frozen=True, kw_only=True, eq=False)
class CurvedCampaign:
    """What the cases of a campaign on one curved cover share.

    Attributes:
        derivation: Responses of the texels, and the Gaussian that is fitted to them.
        meshes: Meshes of the cover, coarsest first.
    """

    derivation: CurvedDerivation
    meshes: tuple[SolidMesh, ...]

    @property
    def parameters(self) -> Parameters:
        """Parameters of the fast model."""
        return self.derivation.parameters

    def require_fast_model(self) -> CoverPoints:
        """Return the arrays of the fast model.

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

    def run(
        self, cases: Sequence[Case], plan: Plan, progress: Callable[[int, int, str], None] | None
    ) -> CampaignResult:
        """Compute and score all cases; see `run_cases`."""
        run = run_cases(cases, self.solve, Clock(plan), progress)
        return summarise(run.results, run.skipped, None, interrupted=run.interrupted, models=CURVED_MODELS)

    def solve(self, case: Case) -> CaseResult:
        """Compute one case by finite elements and by all models, and score the models.

        Raises:
            ValueError: If a model cannot compute the case.
            ConvergenceError: If the finite elements did not converge.
        """
        reference = Reference.of(press_case(self.derivation.sensor, self.meshes, case))
        forces = self._compute_models(case)
        predictions = predict(
            reference, {name: (each, 0.0) for name, each in forces.items()}, case.load, self.parameters
        )
        return CaseResult(case=case, reference=reference, predictions=predictions, warnings=())

    def _compute_models(self, case: Case) -> dict[str, FloatArray]:
        """Compute the texel forces of each model, shape (n,) [N]."""
        from fastmodel.contact.points import find_first_contact

        cover, array, gaussian = self.require_fast_model(), self.derivation.sensor.array, self.derivation.gaussian
        fast = press_fast(cover, case.indenter, case.pose, case.load)
        pressed = np.flatnonzero(fast.forces)
        spread = gaussian.spread(array, cover.points[pressed], cover.normals[pressed])
        first = find_first_contact(cover, case.indenter, case.pose, case.pose.towards, within=_FIRST * cover.thickness)
        points, normals = cover.points[first], cover.normals[first]
        # Equal forces along the normals whose components against the motion sum to the load.
        share = case.load / float(-(normals @ case.pose.towards).sum())
        apart = np.linalg.norm(points[:, None] - array.centres[None], axis=2)
        nearest = np.bincount(apart.argmin(axis=1), minlength=array.count)
        return {
            "fast": fast.texel_forces,
            "gaussian": fast.forces[pressed] @ spread,
            "rigid": share * gaussian.spread(array, points, normals).sum(axis=0),
            "no-spread": share * nearest * array.active,
            "zeros": np.zeros(array.count),
        }


def plan_presses(sensor: SensorDescription, meshes: tuple[SolidMesh, ...], cases: Sequence[Case]) -> Plan:
    """Find out which presses are missing from the store, and how long the cases take.

    Args:
        sensor: A sensor with a curved cover.
        meshes: Meshes of the cover, coarsest first.
        cases: The indentations.
    """
    missing = []
    for case in cases:
        try:
            with stored_only():
                press_case(sensor, meshes, case)
            missing.append(False)
        except NotStoredError:
            missing.append(True)
    return Plan(
        cases=len(cases),
        missing=tuple(missing),
        seconds=tuple(_PRESS if absent else _STORED_PRESS for absent in missing),
        rest=_REST if any(missing) else _STORED_REST,
    )
