"""The sensor that a regression check measures, and helpers that the experiments share."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from fastmodel import Parameters
from meshes import TexelArray

if TYPE_CHECKING:
    from validation.campaign.results import CampaignResult
    from validation.derivation.derive import Derivation

#: Value of a quantity, in SI units: a number, numbers by label, or an image as rows of numbers by label.  None where
#: the quantity does not apply to a sensor.
Value = float | Mapping[str, float | Sequence[float]] | None
#: What an experiment returns: values of quantities by name.
Values = Mapping[str, Value]


@dataclass(frozen=True, kw_only=True, eq=False)
class Subject:
    """The sensor that is measured.

    Attributes:
        parameters: Parameters of its fast model.
        derivation: Derivation of the parameters by finite elements; None for a folder of parameters.
        seed: Seed of all random numbers in the experiments.
        progress: Called with the number of finished cases, the number of all cases and the name of the next case.
    """

    parameters: Parameters
    derivation: Derivation | None = None
    seed: int = 0
    progress: Callable[[int, int, str], None] | None = None

    @cached_property
    def campaign(self) -> CampaignResult | None:
        """Scores of the fast model in the default list of cases; None for a folder of parameters."""
        if self.derivation is None:
            return None
        from validation.campaign.bench import LayeredBench
        from validation.campaign.campaign_file import default_cases
        from validation.campaign.run import run_campaign

        cases = default_cases(self.parameters.array)
        bench = LayeredBench(cover=self.derivation.sensor.layered_cover, fast=self.parameters)
        return run_campaign(bench, cases, progress=self.progress)


def describe_sensor(name: str, array: TexelArray, *, derived: bool) -> str:
    """Describe in one line what must be equal in two measurements that are compared: name, texels, and origin.

    Args:
        name: Name of the sensor.
        array: Its texels.
        derived: Whether the parameters are derived by finite elements for the measurement.
    """
    x, y = (1e3 * pitch for pitch in array.pitch)
    origin = "with" if derived else "without"
    return f"{name}: {array.rows} rows x {array.columns} columns, pitch {x:.6g} x {y:.6g} mm, {origin} finite elements"


def list_rows(image: npt.ArrayLike) -> dict[str, list[float]]:
    """Convert an image, shape (rows, columns), to lists of numbers by the label of the row."""
    rows = np.asarray(image, dtype=np.float64)
    digits = len(str(len(rows) - 1))
    return {f"row {index:0{digits}}": row for index, row in enumerate(rows.tolist())}


def list_texels(array: TexelArray, values: npt.ArrayLike) -> dict[str, list[float]]:
    """Convert values of n texels, shape (n,), to lists of numbers by the label of the row."""
    return list_rows(array.image(values))
