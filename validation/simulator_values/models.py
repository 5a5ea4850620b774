"""Contact laws of other simulators as models of a press: hydroelastic contact, springs with a kernel, fast model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from meshes import Cover, TexelArray
from meshes.array_types import BoolArray, FloatArray
from validation.errors import InputError
from validation.published.model import CODE, OWN, PENETRATION, POINTS, Model, Parameter, Values, foundation_stiffness
from validation.published.rules import PUBLISHED
from validation.published.scene import Forces, Scene, bin_on_texels, sink, sink_springs

if TYPE_CHECKING:
    from fastmodel import Parameters

#: Reach of the kernel of a cover beyond a texel, over the thickness [-].
_REACH = 6.0
#: Points along each side of a texel at which the response is averaged for the kernel [-].
_POINTS = 16
#: How force on the top of the cover comes to texels: by the exact response of the layers, or straight down.
SPREADS = ("exact spread", "no spread")
#: Name of the row of the fitted power law.
POWER = "power law, exact spread"
#: Number of points along each side of a texel for springs with a kernel [-].
POINTS_PER_TEXEL = 4
#: Largest excess of a texel over its pitch that is rounding [-].
_SAME = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """A contact law with values that are scored.

    Attributes:
        name: Name of the row, unique in its table.
        model: The law.
        values: Values of all parameters; None to fit them.
        like: Name of an earlier row whose values are taken; empty for own values.
        sink: Function that computes the depth of the indenter from scene and values [m]; None if the law has none.
    """

    name: str
    model: Model
    values: Values | None = None
    like: str = ""
    sink: Callable[..., float] | None = None


def tabulate_kernel(cover: Cover, array: TexelArray) -> FloatArray:
    """Compute the share of a uniform load on one texel that each texel around it receives, by rows and columns [-].

    Args:
        cover: The cover.
        array: The array, on a regular grid.

    Returns:
        Shares, an odd number of rows and of columns; their sum is below one by the force beyond.
    """
    from fem_reference.closed_form.layer import tabulate_texel_response

    response = tabulate_texel_response(cover, array.texel_size)
    reach = [int(np.ceil(_REACH * cover.thickness / pitch)) for pitch in array.pitch]
    inside = (np.arange(_POINTS) + 0.5) / _POINTS - 0.5
    along = [
        (np.arange(-n, n + 1)[:, None] * pitch + inside * pitch).ravel()
        for n, pitch in zip(reach, array.pitch, strict=True)
    ]
    x, y = np.meshgrid(*along)
    shares = response(x.ravel(), y.ravel()).reshape(2 * reach[1] + 1, _POINTS, 2 * reach[0] + 1, _POINTS)
    return np.asarray(shares.mean(axis=(1, 3)))


def press_hydroelastic(scene: Scene, *, modulus: float, exponent: float) -> tuple[FloatArray, FloatArray]:
    """Press a rigid indenter into a pad whose pressure depends on the depth alone, p = modulus (d / h)^exponent.

    Args:
        scene: The press; h is the thickness of its cover.
        modulus: Pressure at the depth h, the modulus of Elandt et al. 2019 for a layer of thickness h [Pa].
        exponent: Exponent of the law; 1 for Drake, and for Newton without a pressure function [-].

    Returns:
        Depth of each of the m cells inside the indenter [m] and force on it [N], shape (m,) each.
    """
    _, gaps, area = scene.map
    height = scene.cover.thickness
    stiffness = modulus * area / height**exponent
    if exponent == 1:
        depth = sink_springs(gaps, stiffness, scene.load)
    else:
        depth = sink(gaps, lambda depth: stiffness * depth**exponent, scene.load)
    return depth, stiffness * depth**exponent


def hydroelastic(cover: Cover, spread: str, *, power: bool = False) -> Model:
    """Return hydroelastic contact, with one of `SPREADS` behind it.

    Args:
        cover: The cover, for the start value of the fit.
        spread: How force on the top comes to texels, one of `SPREADS`.
        power: Whether the exponent of the pressure law is fitted; it is 1 otherwise.
    """

    def predict(scene: Scene, *, modulus: float, exponent: float) -> Forces:
        _, forces = press_hydroelastic(scene, modulus=modulus, exponent=exponent)
        if spread == SPREADS[0]:
            texels = scene.layer_shares @ forces
        else:
            kept = find_outside_gaps(scene.array, scene.map.points)
            texels = bin_on_texels(scene.array, scene.map.points[kept], forces[kept])
        return Forces(texels, scene.load - float(texels.sum()))

    return Model(
        name="hydroelastic", title="hydroelastic contact (Elandt 2019)", contact=PENETRATION, certainty=CODE,
        rule=f"pressure by depth, {spread}", predict=predict,
        parameters={
            "modulus": Parameter(unit="Pa", start=mean_modulus(cover), fitted=True),
            "exponent": Parameter(start=1.0, fitted=power),
        },
    )  # fmt: skip


def find_outside_gaps(array: TexelArray, points: FloatArray) -> BoolArray:
    """Find which points do not lie in a gap between texels, shape (m,).

    Args:
        array: The array, on a regular grid.
        points: Positions, shape (m, 2) [m].
    """
    steps = (points - array.centres[0, :2]) / array.pitch
    apart = np.abs(steps - np.floor(steps + 0.5))
    return np.asarray((apart <= (0.5 + _SAME) * np.divide(array.texel_size, array.pitch)).all(axis=1))


def mean_modulus(cover: Cover) -> float:
    """Return Young's modulus of the layers in series, h / sum(h_i / E_i) [Pa]."""
    return cover.thickness / sum(each.thickness / each.material.youngs_modulus for each in cover.layers)


def list_hydroelastic(cover: Cover, parameters: Parameters) -> list[Candidate]:  # noqa: ARG001
    """List hydroelastic contact with fitted values, with those of textbooks, and with a fitted power law.

    The textbook values are Young's modulus and the oedometric modulus E (1 - nu) / ((1 + nu) (1 - 2 nu)), which is
    undefined at a Poisson ratio of 0.5.  They are scored with and without the cover's spread behind the contact.
    """

    def depth(scene: Scene, **values: float) -> float:
        return float(press_hydroelastic(scene, **values)[0].max())

    stiffness = foundation_stiffness(cover)
    moduli = {"Young's modulus": mean_modulus(cover)}
    if stiffness is not None:
        moduli["oedometric modulus"] = stiffness * cover.thickness
    exact, none = (hydroelastic(cover, spread) for spread in SPREADS)
    first = f"fitted, {SPREADS[0]}"
    return [
        Candidate(name=first, model=exact, sink=depth),
        Candidate(name=f"fitted, {SPREADS[1]}", model=none, like=first, sink=depth),
        *(
            Candidate(name=f"{name}, {spread}", model=model, values={"modulus": value, "exponent": 1.0}, sink=depth)
            for name, value in moduli.items()
            for spread, model in zip(SPREADS, (exact, none), strict=True)
        ),
        Candidate(name=f"fitted without spread, {SPREADS[1]}", model=none, sink=depth),
        Candidate(name=POWER, model=hydroelastic(cover, SPREADS[0], power=True), sink=depth),
    ]


def refine(model: Model, cover: Cover, array: TexelArray, points: int) -> Model:
    """Return a model of one point per texel with more points, and with the cover's kernel between the points.

    The points lie on the whole top, also above gaps between texels.  Behind the kernel the forces at the points of a
    texel are added by `weigh_points`; what falls into gaps is outside.

    Args:
        model: The model.
        cover: The cover.
        array: The array, on a regular grid.
        points: Number of points along each side of a texel.
    """
    from scipy.signal import fftconvolve

    fine, weights = divide(array, points), weigh_points(array, points)
    kernel = tabulate_kernel(cover, fine)
    gaps: dict[Scene, FloatArray] = {}

    def predict(scene: Scene, **values: float) -> Forces:
        if scene not in gaps:
            gaps[scene] = scene.case.indenter.gap(*scene.case.pose.to_indenter(*fine.centres[:, :2].T))
        found, outside = model.predict(replace(scene, array=fine, texel_gaps=gaps[scene]), **values)
        spread = fftconvolve(found.reshape(fine.rows, fine.columns), kernel, mode="same")
        texels = np.einsum("iajb,ab->ij", spread.reshape(array.rows, points, array.columns, points), weights).ravel()
        return Forces(texels, outside + float(found.sum() - texels.sum()))

    return replace(
        model, predict=predict, rule=f"{model.rule}, {points} x {points} points per texel, kernel of the cover"
    )


def divide(array: TexelArray, points: int) -> TexelArray:
    """Divide the cell of each texel of a regular array, one pitch wide, into as many texels along each side."""
    size = (array.pitch[0] / points, array.pitch[1] / points)
    fine = TexelArray.grid(array.rows * points, array.columns * points, size)
    return replace(fine, centres=fine.centres + array.centres.mean(axis=0))


def weigh_points(array: TexelArray, points: int) -> FloatArray:
    """Compute which share of the cell of each point of `divide` lies on its texel, by row and column of the points [-].

    Without gaps between the texels every share is one.  With gaps the force of the outer points falls in part beside
    the texel; it is taken as uniform in the cell of a point.

    Args:
        array: The array, on a regular grid.
        points: Number of points along each side of a texel.

    Raises:
        InputError: If the texels overlap.
    """
    if any(size > (1 + _SAME) * pitch for size, pitch in zip(array.texel_size, array.pitch, strict=True)):
        raise InputError(
            f"--format: texels of {1e3 * array.texel_size[0]:.4g} x {1e3 * array.texel_size[1]:.4g} mm at a pitch of "
            f"{1e3 * array.pitch[0]:.4g} x {1e3 * array.pitch[1]:.4g} mm overlap, so that one point belongs to "
            "several; take drake or newton"
        )
    along = []
    for size, pitch in zip(array.texel_size, array.pitch, strict=True):
        cells = size / pitch * points
        inside = (cells + 1) / 2 - np.abs(np.arange(points) - (points - 1) / 2)
        along.append(np.clip(inside, 0.0, min(1.0, cells)))
    return np.asarray(np.outer(along[1], along[0]).round(9), dtype=np.float64)


def list_taxels(cover: Cover, parameters: Parameters) -> list[Candidate]:
    """List Genesis' springs with the cover's own kernel, with a fitted Gaussian, and as shipped.

    Genesis refuses an exponent below one; such values score as if no force were measured.
    """
    gaussian, array = PUBLISHED["genesis-taxel"], parameters.array

    def predict(scene: Scene, **values: float) -> Forces:
        if values["exponent"] < 1:
            return Forces(np.zeros(scene.array.count), scene.load)
        return gaussian.predict(scene, crosstalk=0.0, sigma=1.0, **values)

    springs = replace(
        gaussian, predict=predict, rule="k d^e at each point",
        parameters={name: replace(gaussian.parameters[name], fitted=True) for name in ("stiffness", "exponent")},
    )  # fmt: skip
    return [
        *(
            Candidate(name=f"fitted, {points} x {points} points per texel", model=refine(springs, cover, array, points))
            for points in (POINTS_PER_TEXEL, 1)
        ),
        Candidate(name="fitted, Gaussian", model=gaussian),
        Candidate(name="as shipped", model=gaussian, values=gaussian.find_shipped(cover)),
    ]


def list_penalty(cover: Cover, parameters: Parameters) -> list[Candidate]:
    """List the penalty force of TacSL and FlexiTac with a fitted stiffness, and with the cover's kernel behind it."""
    penalty, array = PUBLISHED["penalty"], parameters.array
    return [
        *(
            Candidate(name=f"fitted, {points} x {points} points per texel", model=refine(penalty, cover, array, points))
            for points in (POINTS_PER_TEXEL, 1)
        ),
        Candidate(name="fitted, no spread", model=penalty),
        Candidate(name="as shipped, no spread", model=penalty, values=penalty.find_shipped(cover)),
    ]


def list_fast(cover: Cover, parameters: Parameters) -> list[Candidate]:  # noqa: ARG001
    """List the fast model, whose forces a recording holds."""
    from fastmodel import indent

    def predict(scene: Scene) -> Forces:
        case = scene.case
        found = indent(parameters, case.indenter, load=case.load, at=case.pose.at, yaw=case.pose.yaw)
        return Forces(found.texel_forces, found.outside)

    fast = Model(
        name="fast", title="fast model of softcover", contact=POINTS, rule="fast model", certainty=OWN,
        predict=predict, parameters={},
    )  # fmt: skip
    return [Candidate(name="fast model", model=fast, values={})]
