"""Files for simulators that ask for a value: the value, its error, and how both were found.

Every target has contact laws, of which the first row is written, and a form.  The forms follow the sources that each
target names; softcover's tests load only what they can, so that a form may have changed since.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from validation.campaign.evaluation import versions
from validation.errors import InputError
from validation.json_values import to_json_values
from validation.results import Array, JsonObject, Result, result_model
from validation.sensor_file import SensorDescription
from validation.simulator_values.models import (
    POINTS_PER_TEXEL,
    POWER,
    Candidate,
    divide,
    list_fast,
    list_hydroelastic,
    list_penalty,
    list_taxels,
    tabulate_kernel,
    weigh_points,
)
from validation.simulator_values.scoring import Presses, ScoredValues, check_fit, make_presses, score

if TYPE_CHECKING:
    from fastmodel import Parameters

#: Points of the pressure law, and spacing of the table of the spread over the smaller pitch [-].
_LAW_POINTS, _SPREAD_STEP = 17, 1 / 16
#: Radius of Genesis' probes [m]: their depth counts from the radius, whose default is 10 mm.
_PROBE_RADIUS = 1e-9
#: Reach of the table of the spread beyond a texel, over the thickness [-].
_SPREAD_REACH = 6.0
#: Poisson ratio from which the oedometric modulus is more than six times Young's [-].
_NEARLY_INCOMPRESSIBLE = 0.45


@result_model
class Scores(Result):
    """The values for a simulator, their errors, and the conditions under which both hold.

    Attributes:
        sensor: Name of the sensor.
        format: Name of the target.
        loads: Smallest and largest load that was scored [N].
        rows: Contact laws; the values of the first one are written.
        pressure_law: Depths [m] and pressures [Pa] of the fitted power law, shape (k, 2); empty without hydroelastic
            contact.
        spread: Share of a point force on the top that a texel receives, `share`, shape (k, l) [-], at the distances
            `along_x`, shape (l,), and `along_y`, shape (k,), of the force from the texel's centre [m].
        cover: The cover, as `SensorDescription.describe_cover`.
        left_out: Presses that are not scored, one sentence each.
        notes: Where the values do not hold, one sentence each.
        form: Where the form of the file was read.
        command: Command that wrote the file and scored the values.
        versions: Versions of the packages by name.
    """

    sensor: str
    format: str
    loads: tuple[float, float]
    rows: tuple[ScoredValues, ...]
    pressure_law: Array
    spread: JsonObject
    cover: JsonObject
    left_out: tuple[str, ...]
    notes: tuple[str, ...]
    form: str
    command: str
    versions: Mapping[str, str]

    @property
    def values(self) -> Mapping[str, float]:
        """The values that are written."""
        return self.rows[0].parameters

    def describe(self) -> list[str]:
        """Describe values, errors, range, shapes and command, one line of text each."""
        presses = self.rows[0].presses
        low, high = self.loads
        layers = "; ".join(
            f"{1e3 * each['thickness_m']:.3g} mm {each['material']}, E {each['youngs_modulus']:.4g} Pa, "
            f"nu {each['poisson_ratio']:.4g}"
            for each in self.cover["layers"]
        )
        rows = [
            f"  {row.name}: {_write_values(row)}misplaced {100 * row.mean:.2f} % in the mean, {100 * row.worst:.2f} % "
            "at worst"
            + ("" if math.isnan(row.unseen) else f", {100 * row.unseen:.2f} % on shapes the fit has not seen")
            for row in self.rows
        ]
        by_press = [
            f"  {each.indenter} at {each.load:.4g} N: {100 * each.misplaced_force:.2f} %"
            + ("" if math.isnan(each.depth_ratio) else f", depth {each.depth_ratio:.2f} of the finite elements'")
            for each in presses
        ]
        return [
            f"softcover: {self.format} values of {self.sensor} for loads from {low:.4g} N to {high:.4g} N",
            f"cover: {layers}; {'assumed, not measured' if self.cover['assumed'] else 'as stated'}",
            "Misplaced force is the share of the load on a wrong texel, against finite elements without friction.",
            "Scores; the values of the first row are written:",
            *rows,
            "Scored with these shapes, misplaced force of the first row:",
            *by_press,
            *(f"  left out: {each}" for each in self.left_out),
            *self.notes,
            f"form: {self.form}",
            f"scored by: {self.command} (softcover {self.versions['softcover']})",
        ]


def _write_values(row: ScoredValues) -> str:
    texts = [f"{name} {value:.4g} {row.units.get(name, '')}".strip() for name, value in row.parameters.items()]
    return ", ".join(texts) + ", " if texts else ""


#: Function that writes the text of a file from the scores, the sensor and the parameters of its fast model.
Write = Callable[[Scores, SensorDescription, "Parameters"], str]


@dataclass(frozen=True, kw_only=True)
class Target:
    """A simulator that asks for a value.

    Attributes:
        suffix: Ending of the file.
        laws: Function from cover and parameters to the contact laws; the first one is written.
        write: Function that writes the file.
        form: Where the form of the file was read, and what could not be verified.
        notes: Where the values do not hold in this simulator, one sentence each.
    """

    suffix: str
    laws: Callable[..., list[Candidate]]
    write: Write
    form: str
    notes: tuple[str, ...] = ()


def score_target(
    form: str,
    sensor: SensorDescription,
    parameters: Parameters,
    *,
    loads: tuple[float, float] | None,
    command: str,
    progress: Callable[[str], None],
    presses: Presses | None = None,
) -> Scores:
    """Fit and score the values that a simulator asks for.

    Args:
        form: Name of the target, a key of `TARGETS`.
        sensor: The sensor, with a wide cover of planar layers.
        parameters: Parameters of its fast model.
        loads: Smallest and largest load [N]; None for those of the electronics, see `find_loads`.
        command: Command that is written into the file, without its loads.
        progress: Called with a line of text before each step.
        presses: The presses, if they were made before; otherwise they are made.

    Raises:
        InputError: If nothing is scored on this kind of array or cover, the cover does not bear the loads, or these
            are too small to settle the values.
        ConvergenceError: If the finite elements do not converge.
    """
    cover, target, array = sensor.layered_cover, TARGETS[form], parameters.array
    if not array.regular or cover.size is not None:
        raise InputError(
            f"--format {form}: values are scored on a regular flat array under a cover without side edges only; "
            f"{sensor.source} has {'side edges (cover.size)' if cover.size is not None else 'another array'}"
        )
    laws = target.laws(cover, parameters)
    presses = presses or make_presses(cover, parameters, loads, progress)
    progress(f"fits of {len(presses.presses)} presses")
    rows = score(laws, cover, presses.presses)
    check_fit(laws[0], rows[0], presses.presses)
    deepest = max(press.reference.depth for press in presses.presses)
    law = next((row.parameters for row in rows if row.name == POWER), None)
    depths = np.linspace(0.0, 1.25 * deepest, _LAW_POINTS)
    step = _SPREAD_STEP * min(array.pitch)
    along = [np.arange(0.0, size / 2 + _SPREAD_REACH * cover.thickness, step) for size in array.texel_size]
    x, y = np.meshgrid(*along)
    share = presses.response(x.ravel(), y.ravel()).reshape(x.shape)
    return Scores(
        sensor=array.name,
        format=form,
        loads=presses.loads,
        rows=tuple(rows),
        pressure_law=np.zeros((0, 2))
        if law is None
        else np.column_stack([depths, law["modulus"] * (depths / cover.thickness) ** law["exponent"]]),
        spread={"along_x": along[0], "along_y": along[1], "share": share},
        cover=sensor.describe_cover(),
        left_out=presses.left_out,
        notes=(*_list_limits(sensor, deepest), *target.notes),
        form=target.form,
        command=f"{command} --load {presses.loads[0]:.6g}N:{presses.loads[1]:.6g}N",
        versions=versions(),
    )


def _list_limits(sensor: SensorDescription, deepest: float) -> list[str]:
    """List where values do not hold, one sentence each.

    Args:
        sensor: The sensor.
        deepest: Largest depth of the scored presses [m].
    """
    cover = sensor.layered_cover
    strain = "small strain (linear)" if cover.small_strain_only else "finite strain"
    limits = [
        "Outside this range of loads nothing was scored; nor on curved covers, with friction, tilt or sharp edges.",
        f"The deepest press reaches {deepest / cover.thickness:.0%} of the thickness, computed at {strain}.",
    ]
    if sensor.friction:
        limits.append(f"The friction of {sensor.source}, {sensor.friction:g}, is not in these scores.")
    ratio = max(layer.material.poisson_ratio for layer in cover.layers)
    if ratio >= 0.5:  # noqa: PLR2004 -- incompressible
        limits.append("The oedometric modulus is undefined at a Poisson ratio of 0.5: there is no row for it.")
    elif ratio > _NEARLY_INCOMPRESSIBLE:
        limits.append(
            f"At a Poisson ratio of {ratio:g} the oedometric modulus depends on its last digit: it is no guide."
        )
    return limits


def _write_sdf(scores: Scores, sensor: SensorDescription, parameters: Parameters) -> str:
    height, modulus = sensor.layered_cover.thickness, scores.values["modulus"]
    x, y = np.round(parameters.array.centres.mean(axis=0)[:2], 9) + 0.0
    width, length = (
        pitch * count
        for pitch, count in zip(parameters.array.pitch, (parameters.array.columns, parameters.array.rows), strict=True)
    )
    smallest = min(width, length, height)
    box = modulus / height * smallest / 2
    about = "\n".join(scores.describe())  # not in a comment, which must not hold two hyphens
    return f"""<?xml version="1.0"?>
<?softcover
{about}
Drake's pressure is the modulus times the extent, which is 1 at half the smallest edge s of a box: a box gets s / 2h of
the modulus of a half space whose slab is h thick.
  box with smallest edge {smallest:.6g} m: hydroelastic_modulus {box:.6g} Pa
  half space, slab_thickness {height:.6g} m: hydroelastic_modulus {modulus:.6g} Pa
?>
<sdf version="1.9" xmlns:drake="https://drake.mit.edu">
  <model name="cover">
    <link name="cover">
      <collision name="cover">
        <pose>{x:.6g} {y:.6g} {-height / 2:.6g} 0 0 0</pose>
        <geometry><box><size>{width:.6g} {length:.6g} {height:.6g}</size></box></geometry>
        <drake:proximity_properties>
          <drake:compliant_hydroelastic/>
          <drake:hydroelastic_modulus>{box:.6g}</drake:hydroelastic_modulus>
          <drake:mesh_resolution_hint>{min(parameters.array.pitch) / 4:.6g}</drake:mesh_resolution_hint>
        </drake:proximity_properties>
      </collision>
    </link>
  </model>
</sdf>
"""


def _write_usda(scores: Scores, sensor: SensorDescription, parameters: Parameters) -> str:
    height, array = sensor.layered_cover.thickness, parameters.array
    x, y = np.round(array.centres.mean(axis=0)[:2], 9) + 0.0
    size = f"({array.pitch[0] * array.columns:.6g}, {array.pitch[1] * array.rows:.6g}, {height:.6g})"
    law = ", ".join(f"({depth:.6g}, {pressure:.6g})" for depth, pressure in scores.pressure_law)
    about = "\n".join(f"# {each}" for each in scores.describe())
    return f"""#usda 1.0
{about}
# kh = {scores.values["modulus"] / height:.6g} N/m^3 is p / d.  Two bodies act in series: the other one needs at least
# 100 times this kh.  Newton's default of 1e10 N/m^3 leaves 1 / (1 / kh + 1e-10).
# For a pressure function (HydroelasticSDF.Config, pressure_func) take softcover:pressureLaw, pairs (depth [m],
# pressure [Pa]), and continue it below zero depth; the function is not part of USD.
(
    defaultPrim = "cover"
    metersPerUnit = 1
    upAxis = "Z"
)

def Cube "cover" (
    prepend apiSchemas = ["PhysicsCollisionAPI", "NewtonSDFCollisionAPI"]
)
{{
    double size = 1
    double3 xformOp:translate = ({x:.6g}, {y:.6g}, {-height / 2:.6g})
    double3 xformOp:scale = {size}
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
    bool newton:hydroelasticEnabled = true
    float newton:hydroelasticStiffness = {scores.values["modulus"] / height:.6g}
    uniform float newton:sdfNarrowBandInner = {-height:.6g}
    uniform float newton:sdfNarrowBandOuter = {height:.6g}
    custom double2[] softcover:pressureLaw = [{law}]
}}
"""


def _write_json(scores: Scores, options: Mapping[str, Any]) -> str:
    return json.dumps({"about": scores.describe(), **to_json_values(options)}, indent=1, allow_nan=False) + "\n"


def _write_genesis(scores: Scores, sensor: SensorDescription, parameters: Parameters) -> str:
    fine = divide(parameters.array, POINTS_PER_TEXEL)
    options = {
        "probe_local_pos": fine.centres.reshape(fine.rows, fine.columns, 3),
        "probe_radius": _PROBE_RADIUS,
        "normal_stiffness": scores.values["stiffness"],
        "normal_exponent": scores.values["exponent"],
        "normal_damping": 0.0,
        "shear_scalar": 0.0,
        "twist_scalar": 0.0,
        "crosstalk_kernel": tabulate_kernel(sensor.layered_cover, fine),
    }
    weights = weigh_points(parameters.array, POINTS_PER_TEXEL)
    return _write_json(scores, {"sensor": "gs.sensors.KinematicTaxel", "options": options, "point_weights": weights})


def _write_isaac(scores: Scores, sensor: SensorDescription, parameters: Parameters) -> str:
    """Return the options of Isaac Lab's sensor, for a mesh of the size of the array in the array's frame.

    Along the mesh's axes a and b the sensor places n_a and n_b points with one spacing, the smaller one of
    (size - 2 margin) / (n + 1), and lists them a by a.
    """
    fine = divide(parameters.array, POINTS_PER_TEXEL)
    spacing = min(fine.pitch)
    if not math.isclose(*fine.pitch, rel_tol=1e-6):
        raise InputError(
            f"--format isaac: its points have one spacing along both sides, which the pitches of {sensor.source} do "
            "not allow; take genesis, whose points are placed one by one"
        )
    options = {
        "normal_contact_stiffness": scores.values["stiffness"],
        "tactile_array_size": (fine.columns, fine.rows),
        "tactile_margin": -spacing / 2,
    }
    mesh = [spacing * fine.columns, spacing * fine.rows]
    behind = {
        "elastomer_size_m": mesh,
        "kernel_behind": tabulate_kernel(sensor.layered_cover, fine).T,
        "point_weights": weigh_points(parameters.array, POINTS_PER_TEXEL).T,
    }
    return _write_json(scores, {"sensor": "VisuoTactileSensorCfg", "options": options, **behind})


def _give_example(scores: Scores, parameters: Parameters) -> tuple[str, np.ndarray]:
    """Return the words and the texel forces of an example, a ball in the middle at the smallest load [N]."""
    from fastmodel import indent
    from validation.text.indenter import read_indenter

    shape, load = scores.rows[0].presses[-1].indenter, scores.loads[0]
    at = tuple(parameters.array.centres.mean(axis=0)[:2])
    return f"{shape} at {load:.4g} N", indent(parameters, read_indenter(shape), load=load, at=at).texel_forces


def _write_lerobot(scores: Scores, sensor: SensorDescription, parameters: Parameters) -> str:
    array = parameters.array
    words, forces = _give_example(scores, parameters)
    key = "observation.tactile"
    return _write_json(
        scores,
        {
            "features": {key: {"dtype": "float32", "shape": (array.count, 1), "names": ["Fz"]}},
            "absent": {"dx, dy, dz": "the base is rigid", "Fx, Fy": "a texel measures the force along its normal"},
            "fps": sensor.electronics.rate_hz,
            "points": {"centres_m": array.centres, "normals": array.normals, "active": array.active},
            "example": {"of": words, key: forces[:, None]},
        },
    )


def _write_message(scores: Scores, sensor: SensorDescription, parameters: Parameters) -> str:  # noqa: ARG001
    from validation.recordings.mcap_writer import FRAME, FRAME_DEFINITION

    words, forces = _give_example(scores, parameters)
    counts = ", ".join(map(str, parameters.electronics.counts(forces)))
    listed = ", ".join(f"{force:.5g}" for force in forces)
    array = parameters.array
    example = [
        f"# example: {words}; ros2 topic pub --once /frame {FRAME} with this YAML:",
        f"#   {{header: {{frame_id: {array.name}}}, host_monotonic: 0, device_ticks: 0,",
        f"#   counts: [{counts}],",
        f"#   texel_forces: [{listed}]}}",
    ]
    return "\n".join(
        [
            *(f"# {each}" for each in scores.describe()),
            f"# {FRAME}: {array.rows} rows of {array.columns} texels, row by row; texel_forces along the normals [N]",
            "# There is no shear: a texel measures the force along its normal.",
            *example,
            FRAME_DEFINITION,
        ]
    )


_NO_SPREAD = "Contact forces lie on the top of the cover; scored.json holds the spread to the texels: force j adds "
_SPREAD = _NO_SPREAD + "f_j share(|x_i - x_j|, |y_i - y_j|) to texel i.  Without it the rows `no spread` hold."
_EDGE = (
    "The box ends at the edge of the array, where the scored cover goes on: a press that reaches over it is not scored."
)
_KINEMATIC = (
    "The depth of the bodies is that at which the forces carry the load; the engine must let them sink so far.",
    f"Behind the kernel add the {POINTS_PER_TEXEL} x {POINTS_PER_TEXEL} points of each texel, times `point_weights`.",
    "`point_weights` are below 1 where a point stands for a part of a gap between texels.",
)
#: The simulators by name of the format.
TARGETS = {
    "drake": Target(
        suffix=".sdf", laws=list_hydroelastic, write=_write_sdf,
        form="read by Drake 1.51; its pressures in a box and in a half space were compared with p = k d",
        notes=(_SPREAD, "A box is softer again beyond half its smallest edge; there the law above ends.", _EDGE),
    ),
    "newton": Target(
        suffix=".usda", laws=list_hydroelastic, write=_write_usda,
        form="the USD importer of newton 1.8.0 reads size, kh and narrow band; contact was not run: finalize refuses "
        "hydroelastic shapes without CUDA",
        notes=(_SPREAD, "Depth counts from the nearest face: beyond half the thickness the law ends.", _EDGE),
    ),
    "genesis": Target(
        suffix=".json", laws=list_taxels, write=_write_genesis,
        form="genesis/options/sensors/tactile.py of genesis-world 1.4.5, whose sensor runs on the CPU",
        notes=(
            *_KINEMATIC,
            "`read` holds the kernel, `read_ground_truth` does not; pressure gives negative z.",
            "Keep the depth query `sdf`: `raycast` finds no face beyond the probe's radius.",
            "It feels bodies that the rigid solver finds in contact, all of them at `contact_pruning_tolerance=None`.",
        ),
    ),
    "isaac": Target(
        suffix=".json", laws=list_penalty, write=_write_isaac,
        form="isaaclab_contrib/sensors/tacsl_sensor/visuotactile_sensor.py of isaaclab 2.3.2.post1, read but not run; "
        "the same stiffness is kn of FlexiTac",
        notes=(
            *_KINEMATIC,
            "The sensor has no kernel: convolve its normal forces with `kernel_behind`.",
            "The margin is for an elastomer mesh of `elastomer_size_m` along the x and y of the array.",
            "Points, weights and kernel run along y fastest: transpose them to get texels row by row.",
            "The sensor puts the points of a flat box on the side of its smallest z: turn that side to the bodies.",
        ),
    ),
    "lerobot": Target(
        suffix=".json", laws=list_fast, write=_write_lerobot,
        form="huggingface/lerobot, pull request 4469, open: observation.tactile as points; its kind `force` wants Fx, "
        "Fy, Fz, of which these texels have Fz alone; not verified",
    ),
    "ros2": Target(
        suffix=".msg", laws=list_fast, write=_write_message,
        form="the message of the recordings that softcover writes and reads; ROS 2 has no standard message of texels",
    ),
}  # fmt: skip
