"""Experiments of the regression check on what is written for others: data sheets, exported models and values."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import numpy as np

from fastmodel import Butterworth, Parameters
from fastmodel.adapters.gazebo import write_block
from fastmodel.adapters.rigid_models import list_boxes, write_sdf, write_urdf
from meshes import Cover, TexelArray
from validation.data_sheet import make_datasheet
from validation.regression.experiments import LINE, STAGES, make_oblong
from validation.regression.reading import Reading, Readings, Subject, list_numbers, read
from validation.simulator_models import make_mjcf

if TYPE_CHECKING:
    from validation.simulator_values.scoring import ScoredValues

#: Pattern of a number in a text.
_NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?(?![\w.])", re.IGNORECASE)
#: Normal of the two texels of the exported array, so that roll, pitch and yaw of their boxes are not zero [-].
_NORMAL = (0.36, -0.48, 0.8)
#: Formats whose values are guarded; the other ones share their laws.
_FORMS = ("drake", "genesis", "isaac", "lerobot")


def measure_data_sheet(subject: Subject) -> Readings:
    """Collect the numbers of the data sheets of the sensor and of a made-up one, which states everything."""
    made_up = replace(
        make_oblong(),
        electronics=replace(LINE, **{**STAGES["all"], "gains": None, "noise": 0.05}),
        filter=Butterworth(cutoff_hz=20.0, order=2),
    )
    sheets = {"of the sensor": subject.parameters, "of a made-up sensor": made_up}
    return {
        name: read(
            list_numbers({entry.name: entry.values for entry in make_datasheet(parameters, None).entries}),
            "SI",
            "0.5 % of each",
        )
        for name, parameters in sheets.items()
    }


def measure_exports(subject: Subject) -> Readings:  # noqa: ARG001 -- every experiment takes the sensor
    """Export two tilted texels as MJCF, SDF and URDF and the oblong array for Gazebo, and list all numbers."""
    oblong = make_oblong()
    whole = replace(oblong.array, active=np.ones(oblong.array.count, dtype=bool))
    parameters = _make_tilted()
    boxes = list_boxes(parameters, method="boxes")
    texts = {
        "MJCF": make_mjcf(parameters, name="tilted", method="boxes"),
        "SDF": write_sdf(boxes, name="tilted", rate_hz=parameters.electronics.rate_hz, mass=0.02),
        "URDF": write_urdf(boxes, name="tilted", mass=0.02),
        "Gazebo": write_block(replace(oblong, array=whole, electronics=replace(LINE, threshold=30.0))),
    }
    return {name: read(_list_numbers_of(text), "as written", "0.1 % of each") for name, text in texts.items()}


def measure_values(subject: Subject) -> Readings:
    """Fit and score the values for simulators over the sensor's range of loads, and list those of Drake's file."""
    from validation.simulator_values.scoring import make_presses
    from validation.simulator_values.targets import TARGETS, score_target

    sensor = None if subject.derivation is None else subject.derivation.sensor
    parameters = subject.parameters
    if sensor is None or not isinstance(sensor.cover, Cover) or sensor.cover.size is not None:
        return {}
    if not parameters.array.regular:
        return {}
    presses = make_presses(sensor.cover, parameters, None, lambda _: None)
    scores = {
        form: score_target(
            form, sensor, parameters, loads=None, command="", progress=lambda _: None, presses=presses
        )
        for form in _FORMS
    }  # fmt: skip
    rows = {f"{form}, {row.name}": row for form, found in scores.items() for row in found.rows}
    drake = TARGETS["drake"].write(scores["drake"], sensor, parameters)

    def collect(unit: str, tolerance: float | str, take: Callable[[ScoredValues], object]) -> Reading | None:
        return read(list_numbers({name: take(row) for name, row in rows.items()}), unit, tolerance)

    return {
        "values": collect("SI", "1 % of each", lambda row: row.parameters),
        "misplaced force": collect("%", 0.1, lambda row: [row.mean, row.worst]),
        "depth": collect("of the reference", "1 % of each", lambda row: [each.depth_ratio for each in row.presses]),
        "spread": read(
            {"": np.asarray(scores["drake"].spread["share"])[0].tolist()}, "of the force", "0.5 % of largest"
        ),
        "file for Drake": read(_list_numbers_of(drake), "as written", "1 % of each"),
    }


def _list_numbers_of(text: str) -> dict[str, list[float]]:
    """List the numbers of each element of an XML text, by the place and the tag of the element."""
    elements = ET.fromstring(text).iter()  # noqa: S314 -- our own text
    texts = {
        f"{place:02}, {each.tag}": " ".join([*each.attrib.values(), each.text or ""])
        for place, each in enumerate(elements)
    }
    return {name: row for name, each in texts.items() if (row := [float(number) for number in _NUMBER.findall(each)])}


def _make_tilted() -> Parameters:
    """Make the parameters of two oblong texels whose normals have x, y and z components."""
    array = TexelArray(
        centres=np.array([[1e-3, 2e-3, 3e-3], [4e-3, 2.5e-3, 2e-3]]),
        normals=np.array([_NORMAL, _NORMAL]),
        texel_size=(2e-3, 3e-3),
        pitch=(2.5e-3, 3.5e-3),
        rows=1,
        columns=2,
        active=np.ones(2, dtype=bool),
    )
    return replace(make_oblong(), array=array, surface=None)
