"""Warnings about a model in which the accuracy of a sensor is reduced, or part of the force is not measured.

Each warning is a sentence that names a fault and its remedy. `check_options` examines the options of the model, and
`check_surroundings` the geoms that share the force with the array or never touch it. `find_span` computes the heights
of a geom above the top of an array.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import mujoco
import numpy as np
from scipy.spatial import ConvexHull

from fastmodel.compiled import compile_kernel
from fastmodel.contact.bodies import Reasons, find_obstacles
from fastmodel.contact.interface import TexelContact
from fastmodel.parameters import Parameters
from fastmodel.pressure.gap import BodyShape, describe_solid
from fastmodel.pressure.gap_kernels import cross_lines
from fastmodel.signal.point_spread import Gaussian
from meshes import TexelArray
from meshes.array_types import BoolArray, FloatArray, IntArray

#: Thickness of plates and boxes below which soft bodies may pass through them [mm].  A rope and a cloth of 50 g that
#: fell 9 mm passed through 2 mm and stayed on 10 mm.
_THICK_FOR_FLEXES = 9.9
#: Tolerance for comparisons of rates; it allows for rounding [-].
_RATE_TOLERANCE = 1e-3
#: Smallest number of iterations of the solver, and of its line search, without a warning [-].  The force of a block
#: that slides over box texels is 11 % too large with 1 iteration and 3 % too small with 5 of both; from 10 on it equals
#: the weight.
_FEWEST_ITERATIONS = 10
#: Longest timestep without a warning [s].
_LONGEST_STEP = 5e-3
#: Largest difference between the shares of a force on one texel, by point spread and by calibration, without a warning
#: [-].
_CALIBRATION_TOLERANCE = 0.1
#: Depth below the top of the array beyond which geoms of the same body carry no force [m].  It was measured with a pad
#: beside the array, MuJoCo's default softness, and a force of 160 times the weight of the object: the pad carried 50 %
#: of the force if it was flush with the array, 16 % if it lay 0.5 mm below, and none from 1 mm on.
_CLEARANCE = 1e-3
#: Cosine of the angle between the normals of two arrays below which they face one another [-].
_FACING = -0.5
#: Largest number of geoms that a sentence names; further geoms are only counted [-].
_MOST_NAMES = 4
#: Height above or below the top of an array up to which a geom counts as flush with it [m].  Geoms that overlap the
#: array by less than this height do not count as pressing on it.
_FLUSH = 5e-6
#: Shortest distance between an array and all geoms of its body beyond which the array counts as far from the body [m].
_FAR = 0.02
#: Length by which an array may stick out beyond the geoms of its body without a warning, over the pitch [-].
_OVERHANG = 0.5
#: Advice if a quaternion with w taken last would mend the pose.
_W_LAST = "its quaternion looks like x, y, z, w, attach takes w first"
#: Share of points on an array with its own body ahead, and nothing of it behind, above which the array faces it [-].
_MOST_AHEAD = 0.5
#: Kinds of geoms that are no part of a finger: a ground, or a shape of which MuJoCo knows no hull.
_NO_FINGER = {mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD, mujoco.mjtGeom.mjGEOM_SDF}
#: Volume of a mesh's convex hull over that of the mesh above which the mesh counts as concave [-].
_CONCAVE = 1.1
#: Tolerance of comparisons with `_CLEARANCE`, over `_CLEARANCE`, for rounding [-].
_ROUNDING = 1e-6


class OptionWarning(UserWarning):
    """Warning about a finding of `Sensor.check`; the model is not changed."""


def find_geoms_of(model: mujoco.MjModel, name: str, suffix: str) -> IntArray:
    """Find the ids of the geoms of a sensor.

    Args:
        model: The compiled model.
        name: Name of the sensor in the model, without suffix.
        suffix: Suffix of names in the model.
    """
    names = [model.geom(geom).name for geom in range(model.ngeom)]
    for part in (r"(?:plate|texel)\d*", ".*"):  # The second pattern is for contact methods of other packages.
        own = re.compile(f"{re.escape(name)}/{part}{re.escape(suffix)}")
        found = [geom for geom, each in enumerate(names) if own.fullmatch(each)]
        if found:
            break
    return np.array(found, dtype=np.int64)


def list_options(model: mujoco.MjModel) -> tuple[float, ...]:
    """List the options of a model that a sensor depends on or warns about, for the detection of later changes.

    Args:
        model: The compiled model.
    """
    option = model.opt
    numbers = (option.timestep, option.cone, option.solver, option.impratio)
    return (*numbers, option.iterations, option.ls_iterations, option.disableflags, option.enableflags)


def check_calibration(parameters: Parameters) -> Iterator[str]:
    """Find whether a Gaussian point spread contradicts the calibration of the electronics; yield a sentence if so.

    Args:
        parameters: The array and its cover.
    """
    share, spread = parameters.electronics.tip_share, parameters.spread
    if share is None or not isinstance(spread, Gaussian):
        return
    kept = float(spread.kernel().max())
    excess = kept / share - 1
    if abs(excess) > _CALIBRATION_TOLERANCE:
        yield (
            f"forces on single texels are measured {100 * abs(excess):.0f} % too {'low' if excess < 0 else 'high'}: "
            f"of a force on one texel the Gaussian leaves {kept:.2f} there, the tip of the calibration {share:.2f}; "
            f"contact='cover' computes the cover instead, if the parameters hold its cells"
        )


def check_options(parameters: Parameters, model: mujoco.MjModel, every: int, geoms: IntArray) -> Iterator[str]:
    """Find options of the model or of the sensor that reduce accuracy; yield a sentence about each.

    Args:
        parameters: The array and its cover.
        model: The compiled model with the sensor.
        every: Number of physics steps between two samples of the contact forces [-].
        geoms: Ids of the geoms of the array.
    """
    option, rate = model.opt, parameters.electronics.rate_hz
    sampled = 1.0 / (every * option.timestep)
    if option.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL or option.solver != mujoco.mjtSolver.mjSOL_NEWTON:
        yield (
            "forces of sliding contacts are unsteady without Newton and elliptic cones; "
            "fastmodel.recommend_options(spec) sets them"
        )
    if option.impratio < 1:
        yield f"held objects creep with impratio {option.impratio:g}; fastmodel.recommend_options(spec) sets 10"
    if min(option.iterations, option.ls_iterations) < _FEWEST_ITERATIONS:
        yield (
            f"the solver may stop before contact forces balance the loads, after {option.iterations} iterations with "
            f"{option.ls_iterations} of the line search; MuJoCo's defaults, spec.option.iterations = 100 and "
            f"ls_iterations = 50, suffice"
        )
    if option.timestep > _LONGEST_STEP:
        yield (
            f"forces of sliding contacts are unsteady with a timestep of {option.timestep:g} s; "
            f"spec.option.timestep = 0.001 or 0.002 is better"
        )
    if parameters.filter is not None and parameters.filter.cutoff_hz > rate / 2:
        yield (
            f"cutoff_hz {parameters.filter.cutoff_hz:g} exceeds half the frame rate of {rate:g} Hz; frames cannot show "
            f"what the filter lets pass"
        )
    if rate > sampled * (1 + _RATE_TOLERANCE):
        yield (
            f"frames come at {sampled:g} Hz, not {rate:g} Hz: contact forces are sampled no more often; a shorter "
            f"timestep or a smaller `every` mends it"
        )
    yield from _check_flags(model, geoms)


def _check_flags(model: mujoco.MjModel, geoms: IntArray) -> Iterator[str]:
    """Find flags of the model that remove or change contact forces; yield a sentence about each of them."""
    off, on = mujoco.mjtDisableBit, mujoco.mjtEnableBit
    disabled, enabled = model.opt.disableflags, model.opt.enableflags
    if disabled & (off.mjDSBL_CONTACT | off.mjDSBL_CONSTRAINT):
        yield (
            "the array measures nothing, because contacts are switched off in this model; remove "
            '<flag contact="disable"/> or <flag constraint="disable"/>'
        )
    can_touch = find_obstacles(model, geoms) == ""
    if (
        disabled & (off.mjDSBL_MULTICCD | off.mjDSBL_NATIVECCD)
        and (model.geom_type[can_touch] == mujoco.mjtGeom.mjGEOM_MESH).any()
    ):
        yield (
            "flat faces of meshes touch the array in one point or in changing points with <flag "
            'multiccd="disable"/> or <flag nativeccd="disable"/>; remove them'
        )
    if enabled & on.mjENBL_OVERRIDE:
        yield (
            "the options o_margin, o_solref, o_solimp and o_friction replace those of the array and all other geoms; "
            'remove <flag override="enable"/>, unless this is meant'
        )
    thin = 2e3 * float(model.geom_size[geoms, 2].min())
    if model.nflex and thin < _THICK_FOR_FLEXES:
        yield (
            f"soft bodies (flexes) may pass through plates of {thin:.3g} mm: MuJoCo pushes a vertex below the middle "
            "of a plate out at its back; attach with a thicker one, for example "
            "contact=CoverContact(plate=Plate(height=0.01)), or BoxTexels(height=0.01)"
        )
    if enabled & on.mjENBL_SLEEP and _may_sleep(model, int(geoms[0])):
        yield (
            "objects that sleep have no contacts in MuJoCo: an array keeps its last reading while all that pressed on "
            "it sleep, but an object that sleeps beside one that is awake is not felt; remove "
            '<flag sleep="enable"/>, or set sleep="never" for the objects that touch the array'
        )


def _may_sleep(model: mujoco.MjModel, geom: int) -> bool:
    """Return whether objects that touch a geom may sleep; an object stays awake while it touches an awake tree."""
    awake = (mujoco.mjtSleepPolicy.mjSLEEP_NEVER, mujoco.mjtSleepPolicy.mjSLEEP_AUTO_NEVER)
    tree = model.body_treeid[model.geom_bodyid[geom]]
    trees = model.tree_sleep_policy if tree < 0 else model.tree_sleep_policy[tree : tree + 1]
    return not np.isin(trees, [int(policy) for policy in awake]).all()


def check_surroundings(
    model: mujoco.MjModel, geoms: IntArray, name: str, contact: TexelContact, array: TexelArray
) -> Iterator[str]:
    """Find geoms that carry part of the force on an array, and geoms that never touch it; yield a sentence about each.

    Args:
        model: The compiled model with the sensor.
        geoms: Ids of the geoms of the array.
        name: Name of the sensor in the model.
        contact: Contact method, which defines the top of the array.
        array: The texels.
    """
    data, obstacles = mujoco.MjData(model), find_obstacles(model, geoms)
    mujoco.mj_fwdPosition(model, data)
    top = contact.sample_top(model, data, geoms, array)
    yield from _check_flush_geoms(model, data, geoms, name, top)
    yield from _check_own_links(model, data, geoms, name)
    yield from _check_placement(model, data, geoms, array, top)
    colliding = _find_colliding(model) & ~np.isin(np.arange(model.ngeom), geoms)
    others = colliding & (model.geom_bodyid != model.geom_bodyid[geoms[0]])
    if others.any() and not (colliding & (obstacles == "")).any() and not model.nflex:
        reasons = "; ".join(
            f"{_list_geoms(model, others & (obstacles == why))}: {why}" for why in _sort(obstacles[others])
        )
        yield f"nothing in this model can touch array {name!r} ({reasons})"
        return
    tree = model.body_treeid[model.geom_bodyid]
    elsewhere = others & (tree != tree[geoms[0]])
    for why in _sort(obstacles[elsewhere]):
        yield f"array {name!r} never touches {_list_geoms(model, elsewhere & (obstacles == why))}: {why}"
    yield from _check_hulls(model, (obstacles == "") & (tree != tree[geoms[0]]))
    yield from _check_facing_arrays(model, data, geoms, name, obstacles)


def _check_flush_geoms(
    model: mujoco.MjModel, data: mujoco.MjData, geoms: IntArray, name: str, surface: tuple[FloatArray, FloatArray]
) -> Iterator[str]:
    """Find geoms that move with the array and reach its top; yield a sentence about each of them.

    Args:
        model: The compiled model.
        data: State of the simulation.
        geoms: Ids of the geoms of the array.
        name: Name of the sensor.
        surface: Points on the top of the array [m], and the normals at these points [-], in the world, shape (k, 3)
            each.
    """
    points, normals = surface
    rigid = _find_colliding(model) & np.isin(model.body_weldid[model.geom_bodyid], _find_welded(model, int(geoms[0])))
    rigid[geoms] = False
    for geom in rigid.nonzero()[0].tolist():
        low, high = find_span(model, data, geom, points, normals)
        shares = (high > -_CLEARANCE * (1 - _ROUNDING)) & (low < _CLEARANCE)
        if shares.any():
            top = float(high[shares].max())
            yield (
                f"{_describe_geom(model, geom)} lies {_describe_height(top)} the top of array {name!r} at "
                f"{100 * shares.mean():.0f} % of it, and carries part of the force; "
                f"{_advise_on_flush_geom(model, geom, int(geoms[0]))}move the array outwards by "
                f"{1e3 * (top + _CLEARANCE):.2f} mm"
            )


def _check_own_links(model: mujoco.MjModel, data: mujoco.MjData, geoms: IntArray, name: str) -> Iterator[str]:
    """Find links of the robot that press on the array in the model's initial pose; yield a sentence about them."""
    pairs, tree = data.contact.geom, model.body_treeid[model.geom_bodyid]
    own = np.isin(pairs, geoms)
    touching = (own[:, 0] != own[:, 1]) & (data.contact.dist < -_FLUSH) & (pairs >= 0).all(axis=1)
    others = np.where(own[:, 0], pairs[:, 1], pairs[:, 0])[touching]
    chosen = np.isin(np.arange(model.ngeom), others) & (tree == tree[geoms[0]]) & (tree >= 0)
    if chosen.any():
        carrier, link = (model.body(model.geom_bodyid[geom]).name for geom in (geoms[0], chosen.argmax()))
        yield (
            f"{_list_geoms(model, chosen)} presses on array {name!r} in the initial pose of the model; move the array, "
            f"or exclude the contact: spec.add_exclude(bodyname1={carrier!r}, bodyname2={link!r})"
        )


def _check_placement(
    model: mujoco.MjModel, data: mujoco.MjData, geoms: IntArray, array: TexelArray, top: tuple[FloatArray, FloatArray]
) -> Iterator[str]:
    """Find signs that an array is not where its body is, or faces the body; yield a sentence about each of them.

    The body consists of all geoms without a joint between them and the array, also those that collide with nothing.
    Nothing is found for an array of the world.

    Args:
        model: The compiled model.
        data: State of the simulation.
        geoms: Ids of the geoms of the array.
        array: The texels.
        top: Points on the top of the array [m], and the normals at these points [-], in the world, shape (k, 3) each.
    """
    body, weld = int(model.geom_bodyid[geoms[0]]), model.body_weldid[model.geom_bodyid]
    same = (weld == weld[geoms[0]]) if weld[geoms[0]] else (model.geom_bodyid == body)
    same[geoms] = False
    found = [geom for geom in same.nonzero()[0].tolist() if not _find_sensor(model, geom)]
    own = [geom for geom in found if int(model.geom_type[geom]) not in _NO_FINGER]
    if not own or not body:
        return
    (points, normals), name, carrier = top, _find_sensor(model, int(geoms[0])), f"body {model.body(body).name!r}"
    away = min(mujoco.mj_geomDistance(model, data, a, b, 1e3, None) for a in geoms.tolist() for b in own)
    if away > max(_FAR, float(np.linalg.norm(np.ptp(points, axis=0)))):
        advice = "its position looks like millimetres, attach takes metres" if away > 1 else "mend its position"
        yield f"array {name!r} lies {1e3 * away:.4g} mm from every geom of its {carrier}; {advice}"
        return
    exchanged = np.zeros(9)
    mujoco.mju_quat2Mat(exchanged, np.roll(model.geom_quat[geoms[0]], 1))
    # the last line goes through the middle, along the normal that the array would have with w taken last
    turned = data.xmat[body].reshape(3, 3) @ exchanged.reshape(3, 3)
    normals = np.vstack([normals, turned[:, 2]])
    points = np.vstack([points, points.mean(axis=0)])
    low, high = np.array([find_span(model, data, geom, points, normals) for geom in own]).transpose(1, 0, 2)
    ahead = ((low <= high) & (high > -low)).any(axis=0)
    behind = ((low <= high) & (high < -low)).any(axis=0)
    mended = array.planar and bool(behind[-1] and not ahead[-1])
    if (ahead & ~behind)[:-1].mean() > _MOST_AHEAD or (mended and not behind[:-1].any()):
        advice = _W_LAST if mended else "turn its z axis outwards"
        yield f"the front of array {name!r} does not point away from its {carrier}; {advice}"
    elif array.planar:
        yield from _check_overhang(model, data, geoms, own, array=array, turned=turned if mended else None)


def _check_overhang(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    geoms: IntArray,
    own: list[int],
    *,
    array: TexelArray,
    turned: FloatArray | None,
) -> Iterator[str]:
    """Find whether a planar array sticks out beyond geoms of its body; yield a sentence if so.

    `turned` is the rotation that the array would have with w taken last, shape (3, 3); None if that explains nothing.
    """
    axes = data.geom_xmat[geoms[0]].reshape(3, 3)[:, :2]

    def find_box(chosen: list[int], axes: FloatArray) -> FloatArray:
        """Find the lowest and highest coordinates of geoms along two axes, shape (2, 2) [m]."""
        turn = np.einsum("gij,ik->gjk", data.geom_xmat[chosen].reshape(-1, 3, 3), axes)
        centre = data.geom_xpos[chosen] @ axes + np.einsum("gj,gjk->gk", model.geom_aabb[chosen, :3], turn)
        reach = np.einsum("gj,gjk->gk", model.geom_aabb[chosen, 3:], np.abs(turn))
        return np.array([(centre - reach).min(axis=0), (centre + reach).max(axis=0)])

    def find_excess(half: FloatArray, axes: FloatArray = axes) -> FloatArray:
        """Find the length by which a rectangle of given half edges sticks out along two axes, shape (2,) [m]."""
        body, middle = find_box(own, axes), find_box(geoms.tolist(), axes).mean(axis=0)
        return np.asarray(np.maximum(body[0] - middle + half, middle + half - body[1]))

    pitch = np.array(array.pitch)
    plate = np.ptp(find_box(geoms.tolist(), axes), axis=0) / 2
    texels = np.minimum((np.ptp(array.centres[:, :2], axis=0) + pitch) / 2, plate)
    named = f"array {_find_sensor(model, int(geoms[0]))!r}"
    if (find_excess(texels) > _OVERHANG * pitch).any():
        advice = "mend its position, or its rows and columns"
        if turned is not None and (find_excess(texels, turned[:, :2]) <= _OVERHANG * pitch).all():
            advice = _W_LAST
        elif (find_excess(texels[::-1]) <= _OVERHANG * pitch).all():
            advice = "rows and columns look exchanged"
        excess = f"{1e3 * find_excess(texels).max():.1f} mm beyond the geoms of its body"
        yield f"texels of {named} stick out {excess}; {advice}"
    elif (find_excess(plate) > _OVERHANG * pitch).any():
        x, y = np.maximum(plate - texels - np.maximum(find_excess(plate), 0.0), 0.0).tolist()
        excess = f"{1e3 * find_excess(plate).max():.1f} mm beyond the geoms of its body, and collides there"
        margin = f"margin=({x:.2g}, {y:.2g}) [m] of TexelArray.grid"
        yield f"the plate of {named} reaches {excess}; state the width of the cover beyond the texels, such as {margin}"


def _check_hulls(model: mujoco.MjModel, chosen: BoolArray) -> Iterator[str]:
    """Find chosen geoms with a concave mesh, which MuJoCo replaces by its convex hull; yield a sentence about them."""
    filled = np.zeros(model.ngeom, dtype=bool)
    for geom in (chosen & (model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)).nonzero()[0].tolist():
        mesh = model.mesh(model.geom_dataid[geom])
        vertices = model.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]].astype(np.float64)
        a, b, c = vertices[model.mesh_face[mesh.faceadr[0] : mesh.faceadr[0] + mesh.facenum[0]].T]
        areas = np.cross(b - a, c - a)
        whole, volume = np.linalg.norm(areas, axis=1).sum(), abs(np.einsum("ij,ij->", a, areas)) / 6
        # the area vectors of an open surface, which encloses no volume, do not cancel
        if np.linalg.norm(areas.sum(axis=0)) < 1e-3 * whole and volume > 1e-6 * whole**1.5:
            filled[geom] = ConvexHull(vertices).volume > _CONCAVE * volume
    if filled.any():
        yield (
            f"MuJoCo fills the hollows of the mesh of {_list_geoms(model, filled)} and collides with its convex hull; "
            "divide it into convex parts, as fastmodel.add_geoms(body, meshes.read_stl(file)) does"
        )


def _find_welded(model: mujoco.MjModel, geom: int) -> list[int]:
    """Find the bodies that move with a geom, because no joint separates them or a <weld> constraint joins them.

    Bodies without a joint between them form a group, represented by its first body.  Constraints that are switched off
    when the simulation starts (`active="false"`) are ignored.
    """
    found, before = {int(model.body_weldid[model.geom_bodyid[geom]])}, 0
    welds = (model.eq_type == mujoco.mjtEq.mjEQ_WELD) & (model.eq_active0 != 0)
    bodies = np.column_stack([model.eq_obj1id, model.eq_obj2id])[welds]
    of_sites = model.eq_objtype[welds] == mujoco.mjtObj.mjOBJ_SITE
    bodies[of_sites] = model.site_bodyid[bodies[of_sites]]
    while len(found) > before:
        before = len(found)
        for pair in model.body_weldid[bodies].tolist():
            if found & set(pair):
                found |= set(pair)
    return sorted(found)


def _describe_height(height: float) -> str:
    """Describe the height of a geom over the top of an array [m]."""
    if abs(height) < _FLUSH:
        return "flush with"
    return f"{1e3 * abs(height):.2f} mm {'above' if height > 0 else 'below'}"


def _advise_on_flush_geom(model: mujoco.MjModel, geom: int, array: int) -> str:
    """State a remedy for a geom that carries part of the force on an array; `array` is one of the array's geoms."""
    if int(model.geom_type[geom]) in {mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD}:
        return ""  # The remedy is not to remove the geom, because a floor or ground is needed in other places.
    if _find_sensor(model, geom):
        return "move that array aside, or "
    if model.geom_bodyid[geom] != model.geom_bodyid[array]:
        return "set its contype and conaffinity to 0, or "
    name = model.geom(geom).name
    return f"give attach replaces={name!r}, or " if name else "give attach that geom of the spec as replaces=, or "


def _check_facing_arrays(
    model: mujoco.MjModel, data: mujoco.MjData, geoms: IntArray, name: str, obstacles: Reasons
) -> Iterator[str]:
    """Find arrays that face the array of a sensor but cannot touch it; yield a sentence about each of them."""
    normals, weld = data.geom_xmat[:, 2::3], model.body_weldid[model.geom_bodyid]
    against = (normals @ normals[geoms].T).min(axis=1) < _FACING
    found = against & (obstacles != "") & (weld != weld[geoms[0]])
    reasons = {_find_sensor(model, geom): obstacles[geom] for geom in found.nonzero()[0].tolist()}
    for other in sorted(set(reasons) - {""}):
        yield f"arrays {name!r} and {other!r} face one another but never touch: {reasons[other]}"


def _find_colliding(model: mujoco.MjModel) -> BoolArray:
    """Return which geoms of a model can collide with any other geom, by their masks or as an explicit pair."""
    found = (model.geom_contype | model.geom_conaffinity) != 0
    found[np.concatenate([model.pair_geom1, model.pair_geom2])] = True
    return np.asarray(found)


def _find_sensor(model: mujoco.MjModel, geom: int) -> str:
    """Return the name of the sensor that a geom belongs to, or "" if it belongs to none."""
    found = re.fullmatch(r"(.+)/(?:plate|texel)\d*(.*)", model.geom(geom).name)
    return "".join(found.groups()) if found else ""


def _sort(reasons: Reasons) -> list[str]:
    """Return the distinct texts of an array of reasons, without the empty text, in alphabetical order."""
    return sorted(set(reasons.tolist()) - {""})


def _list_geoms(model: mujoco.MjModel, chosen: BoolArray) -> str:
    """List the names of the chosen geoms of a model, or of their bodies if the geoms have no names, as one text."""
    names = list(dict.fromkeys(_describe_geom(model, geom) for geom in chosen.nonzero()[0].tolist()))
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return ", ".join(names[:_MOST_NAMES]) + more


def _describe_geom(model: mujoco.MjModel, geom: int) -> str:
    """Describe a geom by its name and the name of its body, or by the body alone if the geom has no name."""
    name, body = model.geom(geom).name, model.body(model.geom_bodyid[geom]).name
    return f"geom {name!r} of body {body!r}" if name else f"a geom without a name (id {geom}) of body {body!r}"


def find_span(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, points: FloatArray, normals: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Find the interval in which a line through each of n points lies within a geom.

    A mesh counts as its convex hull, as in MuJoCo's collisions.  A height field fills the whole space below its
    surface.

    Args:
        model: The compiled model.
        data: A state with the poses of geoms.
        geom: Id of the geom.
        points: The points in the world, shape (n, 3) [m].
        normals: Directions of the lines in the world, of unit length, shape (n, 3) [-].

    Returns:
        Distances along the line from the point to the lower and upper end of the interval, each of shape (n,) [m];
        inf and -inf for a line that misses the geom.
    """
    kind, position = int(model.geom_type[geom]), data.geom_xpos[geom]
    if kind not in {mujoco.mjtGeom.mjGEOM_HFIELD, mujoco.mjtGeom.mjGEOM_SDF}:
        shape, rotation = BodyShape.of([describe_solid(model, geom)]), data.geom_xmat[geom].reshape(1, 3, 3)
        low, high = compile_kernel(cross_lines)(shape.arrays, rotation, position[None], points, normals)
        return low[0], high[0]
    reach = mujoco.mj_rayHfield if kind == mujoco.mjtGeom.mjGEOM_HFIELD else mujoco.mj_rayMesh
    low, high = np.full(len(points), np.inf), np.full(len(points), -np.inf)
    for k, (point, normal) in enumerate(zip(points, normals, strict=True)):
        far = float(np.linalg.norm(point - position)) + 2 * float(model.geom_rbound[geom])
        down = reach(model, data, geom, point + far * normal, -normal)
        if down >= 0:
            low[k], high[k] = 0.0, far - down
    return low, high
