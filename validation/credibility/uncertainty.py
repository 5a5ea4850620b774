"""Input uncertainty of a tactile image, and comparison errors with their validation uncertainty (ASME V&V 20-2009).

Input uncertainty is the change of an image within the uncertainties of modulus, thickness, pose and friction.  Every
input is changed by plus and minus its standard uncertainty, one at a time.  Half the difference of the two images is
the sensitivity times the uncertainty.  The images come from the small-strain contact on a coarse grid of cells and the
exact layer solution, because a sensitivity needs no finer grid.  Covers of rubber have their linear properties at zero
load.  Contributions are added in quadrature (section 3; first-order propagation).

The comparison error of a quantity is E = S - D (sections 1 and 5), with the fast model S and the reference D. The
validation uncertainty is u_val = sqrt(u_num^2 + u_input^2 + u_D^2).  Where the absolute value of E is below u_val, a
comparison cannot distinguish the error of the model from those of inputs, numerics and data.  The two models share
their inputs, so that u_input cancels in their own comparison, and E is compared with u_num alone. u_val applies to a
real sensor whose cover and pose are known within the stated uncertainties.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np

from meshes import Cover, Cylinder, Indenter, Material, TexelArray
from meshes.array_types import FloatArray
from validation.campaign.campaign_file import Inputs
from validation.campaign.case import Case
from validation.campaign.results import CaseResult, texel_error
from validation.campaign.texel_metrics import centre_of_pressure, second_moments
from validation.derivation.contact_range import linearise, linearise_material
from validation.results import Array, Bound, Column, Number, Result, result_model

if TYPE_CHECKING:
    from fem_reference.closed_form.layer import TexelResponse
    from fem_reference.linear_response.surface_compliance import SurfaceCompliance

#: Number of cells across the contact [-].  With half as many cells the propagated uncertainty changes by less than 2 %.
CELLS = 32
#: Standard deviation of a uniform distribution over its width [-].
_OF_WIDTH = 1 / math.sqrt(12)
#: Standard deviation of a uniform distribution over its half width [-].
_OF_HALF_WIDTH = 1 / math.sqrt(3)
#: Smallest distance from a contact up to which compliances are tabulated, over the size of the contact [-].
_REACH = 3.0
#: Smallest distance from a contact up to which compliances are tabulated, over the decay length of the cover's response
#: [-].
_DECAY = 4.0
#: Name of the input for the coefficient of friction.
FRICTION = "friction"


#: Range of ignorance of the thickness of an assumed cover, over its thickness [-], uniform in the logarithm.  The
#: published recordings of an SDH-2 finger fit covers of 1 mm to 6 mm about equally well; 2 mm are assumed.
ASSUMED_THICKNESS = (0.5, 3.0)


def find_missing_range(cover: Cover) -> str:
    """Describe in a sentence the range that an assumed cover lacks, so that u_input is unknown; empty if none."""
    names = [each.material.name for each in cover.layers if not each.material.spread and not each.material.spread_above]
    if not cover.assumed or not names:
        return ""
    return (
        f"the cover is assumed and no range is stated for the modulus of {', '.join(names)}: u_input, u_val and an "
        "interval of the model error are unknown, and no comparison shows or excludes an error of the model"
    )


@result_model
class InputUncertainty(Result):
    """Effect of the uncertain inputs on the image of one case.

    Attributes:
        load: Applied force [N].
        uncertainties: Standard uncertainty of each input by its name, with its unit in the name.
        image: Forces on the n texels with the nominal inputs, on the coarse grid, shape (n,) [N].
        effects: Change of the image by one standard uncertainty, by the name of the input, shape (n,) each [N].
        note: Sentence about inputs that were not propagated; empty if all were.
        known: Whether a range is stated for every input.
    """

    load: float
    uncertainties: Mapping[str, Bound]
    image: Array
    effects: Mapping[str, Array]
    note: str = ""
    known: bool = True
    computed = (("misplaced", "misplaced"), ("misplaced_total", "misplaced_total"))

    def of(self, quantity: Callable[[FloatArray], float]) -> dict[str, float]:
        """Return the standard uncertainty of a quantity of the image due to each input.

        Args:
            quantity: Function that returns the change of the quantity for a change of the image.
        """
        return {name: abs(quantity(effect)) for name, effect in self.effects.items()}

    @property
    def misplaced(self) -> dict[str, float]:
        """Misplaced force between the nominal image and one changed by one standard uncertainty, by input [-].

        It is half the sum of the absolute changes of the texel forces and of the force outside, over the load.
        """
        return {
            name: float(np.abs(effect).sum() + abs(effect.sum())) / (2 * self.load)
            for name, effect in self.effects.items()
        }

    @property
    def misplaced_total(self) -> float:
        """Root of the sum of squares of `misplaced` [-]."""
        return math.sqrt(sum(value**2 for value in self.misplaced.values()))


def propagate_inputs(cover: Cover, array: TexelArray, case: Case, inputs: Inputs) -> InputUncertainty:
    """Propagate the input uncertainties to the image of one case, or read the result from the store.

    Args:
        cover: Laterally wide cover.
        array: The array.
        case: The indentation.
        inputs: Standard uncertainties.

    Raises:
        ValueError: If the case has several bodies.
        ConvergenceError: If a contact does not converge.
    """
    from fem_reference import result_store

    if case.others:
        raise ValueError("uncertain inputs are propagated under one body only")
    case = case.turned
    listed = {name: uncertainty for name, uncertainty, _ in list_inputs(cover, inputs)}
    note = missing = find_missing_range(cover)

    def compute() -> dict[str, FloatArray]:
        return {"image": simulate_image(cover, array, case)} | {
            f"effect {name}": effect for name, effect in _find_effects(cover, array, case, inputs)
        }

    key = {
        "cover": cover,
        "centres": array.centres,
        "active": array.active,
        "texel_size": array.texel_size,
        "case": [case.indenter, case.load, list(case.pose.at), case.pose.yaw],
        "inputs": [[name, value] for name, value in listed.items()],
        "cells": CELLS,
        "code": result_store.hash_file(__file__),
    }
    data = result_store.fetch("input-uncertainty", key, compute)
    effects = {name: data[f"effect {name}"] for name in listed}
    if inputs.friction:
        found = _find_friction_effect(cover, array, case, inputs.friction)
        listed[FRICTION] = inputs.friction
        if found is None:
            note = "; ".join(filter(None, (note, "friction not propagated: no round body stands for this indenter")))
        else:
            effects[FRICTION] = found
    return InputUncertainty(
        load=case.load,
        uncertainties=listed,
        image=data["image"],
        effects=effects,
        note=note,
        known=not missing,
    )


#: Function of a cover, a case and the change of one input that returns the changed cover and case.
Change = Callable[[Cover, Case, float], tuple[Cover, Case]]


def list_inputs(cover: Cover, inputs: Inputs) -> Iterator[tuple[str, float, Change]]:
    """List the inputs besides friction: name with unit, standard uncertainty, and the function that changes the input.

    The last argument of the function is the change of the input.  Inputs without uncertainty are omitted.
    """
    several = len(cover.layers) > 1
    ignorance = math.log(ASSUMED_THICKNESS[1] / ASSUMED_THICKNESS[0]) * _OF_WIDTH if cover.assumed else 0.0
    thickness = max(inputs.thickness, ignorance)
    for index, layer in enumerate(cover.layers):
        material = layer.material
        of = f" of {material.name}, layer {index + 1}" if several else ""
        spread = _spread_modulus(material) if material.spread or material.spread_above else inputs.modulus
        poisson = material.poisson_spread * _OF_HALF_WIDTH if material.poisson_spread else inputs.poisson_ratio
        named: tuple[tuple[str, float, Change], ...] = (
            (f"modulus{of} [relative]", spread, partial(_change_layer, index, "modulus")),
            (f"Poisson ratio{of} [-]", poisson, partial(_change_layer, index, "poisson")),
            (f"thickness{of} [relative]", thickness, partial(_change_layer, index, "thickness")),
        )
        yield from (each for each in named if each[1])
    of_pose = (("position x [m]", inputs.position), ("position y [m]", inputs.position), ("yaw [rad]", inputs.yaw))
    for axis, (name, uncertainty) in enumerate(of_pose):
        if uncertainty:
            yield name, uncertainty, partial(_change_pose, axis)


def _spread_modulus(material: Material) -> float:
    """Compute the standard uncertainty of the logarithm of the modulus, uniform over the range of the material [-].

    Sources that state a range with k = 2 are treated as the others, which gives the larger uncertainty.
    """
    low, high = material.modulus_range
    # The lower end has no logarithm.  It is taken as far below the modulus, in the logarithm, as the upper end is
    # above.
    if low <= 0:
        low = material.youngs_modulus**2 / high
    return math.log(high / low) / 2 * _OF_HALF_WIDTH


def _change_layer(index: int, what: str, cover: Cover, case: Case, by: float) -> tuple[Cover, Case]:
    """Change a layer: the logarithm of its `modulus`, its `poisson` ratio, or the logarithm of its `thickness`."""
    layer = cover.layers[index]
    material, thickness = linearise_material(layer.material), layer.thickness
    if what == "modulus":
        material = replace(material, parameters={"youngs_modulus": material.youngs_modulus * math.exp(by)})
    elif what == "poisson":
        # Young's modulus is constant; the Poisson ratio is limited to 0..0.5.
        material = replace(material, poisson_ratio=float(np.clip(material.poisson_ratio + by, 0.0, 0.5)))
    else:
        thickness *= math.exp(by)
    layers = list(cover.layers)
    layers[index] = replace(layer, thickness=thickness, material=material)
    return replace(cover, layers=tuple(layers)), case


def _change_pose(axis: int, cover: Cover, case: Case, by: float) -> tuple[Cover, Case]:
    """Change x, y or yaw of a case, which are the axes 0, 1 and 2."""
    x, y, yaw = (by if axis == each else 0.0 for each in range(3))
    at_x, at_y, z = case.pose.point
    return cover, replace(case, pose=replace(case.pose, point=(at_x + x, at_y + y, z), yaw=case.pose.yaw + yaw))


def _find_effects(cover: Cover, array: TexelArray, case: Case, inputs: Inputs) -> Iterator[tuple[str, FloatArray]]:
    """Yield the name of each input besides friction and the change of the image by one standard uncertainty."""
    for name, uncertainty, change in list_inputs(cover, inputs):
        changed = [change(cover, case, sign * uncertainty) for sign in (1, -1)]
        high, low = (simulate_image(each, array, moved) for each, moved in changed)
        span = 2 * uncertainty
        if name.startswith("Poisson ratio"):
            # At the limit of 0.5 only one side is possible, and the difference spans less than two uncertainties.
            above, below = (sum(layer.material.poisson_ratio for layer in each.layers) for each, _ in changed)
            span = max(above - below, np.finfo(float).eps)
        yield name, (high - low) * uncertainty / span


def simulate_image(cover: Cover, array: TexelArray, case: Case) -> FloatArray:
    """Compute the forces on n texels at small strain, on the coarse grid of cells, shape (n,) [N].

    Args:
        cover: Laterally wide cover; its layers have their linear elastic properties at zero load.
        array: The array.
        case: The indentation, not tilted.
    """
    *places, forces = _solve_cells(cover, case.indenter, case.load, CELLS)
    x, y = case.pose.to_array(*places)
    response = _tabulate_response(cover, array.texel_size)
    out = np.array([response(x - cx, y - cy) @ forces for cx, cy in array.centres[:, :2]])
    return np.where(array.active, out, 0.0)


@lru_cache(maxsize=256)
def _solve_cells(cover: Cover, indenter: Indenter, load: float, count: int) -> FloatArray:
    """Solve a contact with a given number of cells across it.  All poses share the solution.

    Returns:
        Rows x, y [m] and force [N] of m cells in the frame of the indenter, shape (3, m).
    """
    from fem_reference.linear_response.surface_compliance import decay_length
    from fem_reference.small_strain_contact.frictionless import bound_contact, solve_contact

    size = float(np.hypot(*bound_contact(indenter, cover.thickness)))
    reach = max(_REACH * size, _DECAY * decay_length(cover))
    patch = solve_contact(_tabulate_surface(cover, reach), indenter, cells=count, load=load)
    return np.stack([patch.x, patch.y, patch.force])


@lru_cache(maxsize=64)
def _tabulate_surface(cover: Cover, reach: float) -> SurfaceCompliance:
    from fem_reference.linear_response.surface_compliance import surface_compliance

    return surface_compliance(cover, reach)


@lru_cache(maxsize=64)
def _tabulate_response(cover: Cover, size: tuple[float, float]) -> TexelResponse:
    from fem_reference.closed_form.layer import tabulate_texel_response

    return tabulate_texel_response(cover, size)


def _find_friction_effect(cover: Cover, array: TexelArray, case: Case, friction: float) -> FloatArray | None:
    """Compute the change of the image by one standard deviation of the friction, between zero and an upper bound.

    Friction needs finite elements.  A body of revolution is pressed itself.  Any other flat face is replaced by a
    cylinder of the same area and load, because the effect is small and similar.  Other bodies have no substitute.

    Returns:
        The change, shape (n,) [N]; None without a substitute, or if the solver fails.
    """
    from fem_reference import ConvergenceError
    from fem_reference.indentation.press import press

    body = case.indenter
    if not body.axisymmetric:
        if not body.is_flat:
            return None
        body = Cylinder(radius=math.sqrt(_measure_face(case) / math.pi))
    try:
        stuck, free = (
            press(linearise(cover), array, body, load=case.load, pose=case.pose, friction=each).texel_forces
            for each in (friction, 0.0)
        )
    except (ConvergenceError, ValueError):
        return None
    return (stuck - free) * _OF_WIDTH


def _measure_face(case: Case) -> float:
    """Measure the area of a flat face [m2] on a fine grid of its footprint."""
    half_x, half_y = case.indenter.footprint
    points = 400
    x, y = np.meshgrid(
        (np.arange(points) + 0.5) / points * 2 * half_x - half_x,
        (np.arange(points) + 0.5) / points * 2 * half_y - half_y,
    )
    return float(np.isfinite(case.indenter.gap(x, y)).mean() * 4 * half_x * half_y)


#: Grid convergence index over the standard uncertainty, for an error that is skewed to one side (ASME V&V 20-2009,
#: section 2-4.4) [-].
_COVERAGE = 1.15
#: Change of a texel force by the fast model's iteration tolerance, over the load [-].
ITERATION = 2e-4


_WORDS = {True: "yes", False: "no", None: "\u2013"}


@result_model
class ComparisonError(Result):
    """Comparison of fast model and reference in one quantity of one case, such as the largest texel force.

    Attributes:
        case: Name of the case.
        quantity: Name of the quantity with its unit.
        factor: Factor from SI units to the unit of the quantity [-].
        fast: Value of the fast model, S, in SI units.
        reference: Value of the reference, D, in SI units.
        u_num: Standard uncertainty of the numerical solutions, in SI units.
        u_input: Standard uncertainty due to the inputs, in SI units.
        u_data: Standard uncertainty of the data, in SI units.
    """

    case: Annotated[str, Column(heading="case and quantity", small="{0.quantity}")]
    quantity: str
    factor: float
    fast: Annotated[Number, Column(heading="S", digits=4, factor_field="factor")]
    reference: Annotated[Number, Column(heading="D", digits=4, factor_field="factor")]
    u_num: Annotated[Number, Column(heading="u_num", digits=2, factor_field="factor")]
    u_input: Annotated[Number, Column(heading="u_input", digits=2, factor_field="factor")]
    u_data: Annotated[Number, Column(heading="u_D", digits=2, factor_field="factor")]
    printed: ClassVar[Mapping[str, Column]] = {
        "error": Column(heading="E", digits=2, factor_field="factor"),
        "u_val": Column(heading="u_val", digits=2, factor_field="factor"),
        "least_error": Column(heading="E - 2 u_val", digits=2, factor_field="factor"),
        "largest_error": Column(heading="E + 2 u_val", digits=2, factor_field="factor"),
        "resolved_here": Column(heading="|E| > u_num: resolved here", words=_WORDS),
        "resolved": Column(heading="|E| > u_val: resolved on a real cover", words=_WORDS),
    }
    computed = (
        ("E", "error"),
        ("u_val", "u_val"),
        ("resolved_with_shared_inputs", "resolved_here"),
        ("resolved", "resolved"),
    )

    @property
    def error(self) -> float:
        """Comparison error E = S - D, the value of the fast model minus the value of the reference, in SI units."""
        return self.fast - self.reference

    @property
    def u_val(self) -> float:
        """Validation uncertainty: root of the sum of squares of the three standard uncertainties, in SI units."""
        return math.sqrt(self.u_num**2 + self.u_input**2 + self.u_data**2)

    @property
    def resolved_here(self) -> bool:
        """Whether the comparison of the two models, which share their inputs, resolves an error of the fast model."""
        return abs(self.error) > self.u_num

    @property
    def least_error(self) -> float:
        """Lower end of the interval of the model's error, two validation uncertainties below E, in SI units."""
        return self.error - 2 * self.u_val

    @property
    def largest_error(self) -> float:
        """Upper end of the interval of the model's error, in SI units."""
        return self.error + 2 * self.u_val

    @property
    def resolved(self) -> bool | None:
        """Whether the comparison error exceeds the validation uncertainty; None if the latter is unknown."""
        return None if math.isnan(self.u_val) else abs(self.error) > self.u_val


def compare_quantities(
    array: TexelArray, result: CaseResult, inputs: InputUncertainty, data: float
) -> list[ComparisonError]:
    """Compare the fast model with the reference of one case, quantity by quantity.

    Args:
        array: The array.
        result: The scored case.
        inputs: Effects of the uncertain inputs on the image of the case.
        data: Standard uncertainty of measured forces, over the force [-]; 0 if the reference is the data.
    """
    reference, fast = result.reference.texel_forces, result.predictions["fast"].texel_forces
    estimate = texel_error(result.reference.error_estimate) / _COVERAGE
    load, positions = result.case.load, array.centres[:, :2]
    sums = np.ones(array.count)
    peak = np.zeros(array.count)
    peak[np.argmax(reference)] = 1.0
    # The quantities are weighted sums of the texel forces.  Those of a centre of pressure are divided by the sum of the
    # forces.
    weights = {"largest texel [mN]": peak, "all texels [mN]": sums}
    # Values of fast model (S) and reference (D), u_num and u_input, by the name of the quantity.
    found: dict[str, tuple[float, float, float, float]] = {}
    for name, weight in weights.items():
        value = float(weight @ reference)
        u_num = math.hypot(estimate * value, ITERATION * load)
        found[name] = (float(weight @ fast), value, u_num, _add_squares(inputs.of(weight.dot)))
    if min(reference.sum(), fast.sum(), inputs.image.sum()) > 0:
        # The shares of all texels have the relative error of the largest one; the lever arm is the width of the image.
        width = max((value for value in second_moments(reference, positions) if not math.isnan(value)), default=0.0)
        u_num = math.hypot(estimate, ITERATION) * width
        ours, true, middle = (centre_of_pressure(each, positions) for each in (fast, reference, inputs.image))
        for axis, name in enumerate(("centre of pressure x [mm]", "centre of pressure y [mm]")):
            lever = (positions[:, axis] - middle[axis]) / float(inputs.image.sum())
            found[name] = (float(ours[axis]), float(true[axis]), u_num, _add_squares(inputs.of(lever.dot)))
    return [
        ComparisonError(
            case=result.case.name,
            quantity=name,
            factor=1e3,
            fast=fast_value,
            reference=value,
            u_num=u_num,
            u_input=u_input if inputs.known else math.nan,
            u_data=data * abs(value) if name in weights else 0.0,
        )
        for name, (fast_value, value, u_num, u_input) in found.items()
    ]


def _add_squares(contributions: Mapping[str, float]) -> float:
    return math.sqrt(sum(value**2 for value in contributions.values()))
