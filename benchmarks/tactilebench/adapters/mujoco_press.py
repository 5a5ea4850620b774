"""Press the cases in MuJoCo or MuJoCo Warp, and read their sensors.

    python benchmarks/tactilebench/adapters/mujoco_press.py --engine touch-grid
    python benchmarks/tactilebench/adapters/mujoco_press.py --engine tactile
    python benchmarks/tactilebench/adapters/mujoco_press.py --engine warp-touch --cases 30

The body's weight is the load; all contacts have MuJoCo's default stiffness and no friction.  `touch-grid` is the plugin
sensor on boxes, one on each cell of the array, whose site stands so far behind that its bins are the texels.  `tactile`
measures depths at the centres of texels on one plate, here scaled to the load.  `warp-touch` is a touch sensor on each
box, in MuJoCo Warp on the CPU, which compiles for minutes before the first case; needs `pip install mujoco-warp`.
"""

from __future__ import annotations

import sys

import mujoco
import numpy as np
from bodies import FloatArray, Part, find_bottom, find_reach, make_parser, make_parts, run

from tactilebench import Case

#: Gravity [m/s2], time step and time until rest [s], and time over which the forces are averaged [s].
GRAVITY, STEP, SETTLE, AVERAGE = 9.81, 1e-3, 0.4, 0.05
#: Distance of the site of touch_grid behind the texels [m]; width of a box over the pitch, because a contact point on
#: the border of two bins may count in either [-]; height of boxes [m].
BEHIND, NARROW, HEIGHT = 1.0, 0.999, 2e-3
KINDS = {
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "hull": mujoco.mjtGeom.mjGEOM_MESH,
}


def add_body(spec: mujoco.MjSpec, case: Case, *, fields: bool) -> None:
    """Add the body of a case on a slide joint along z, its lowest point on the plane z = 0."""
    given = case.bodies[0]
    parts = make_parts(given)
    height = -find_bottom(parts, given.rotation)
    body = spec.worldbody.add_body(name="body", pos=[*given.at[:2], height])
    body.add_joint(name="slide", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    body.mass, body.explicitinertial = given.load / GRAVITY, True
    body.inertia[:] = body.mass * 1e-4
    for number, part in enumerate(parts):
        add_part(spec, body, part, given.rotation, name=f"part{number}", field=fields)


def add_part(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, part: Part, rotation: FloatArray, *, name: str, field: bool
) -> None:
    """Add a part of a body, with a distance field if it is a hull and a sensor asks for one."""
    turned = np.zeros(4)
    mujoco.mju_mat2Quat(turned, (rotation @ part.rotation).ravel())
    geom = body.add_geom(name=name, type=KINDS[part.kind], pos=rotation @ part.position, quat=turned, condim=1)
    geom.size[: len(part.size)] = part.size
    if part.kind == "hull":
        mesh = spec.add_mesh(name=name, uservert=part.corners.ravel())
        mesh.needsdf, geom.meshname = field, name


def list_cells(case: Case) -> FloatArray:
    """Return the centres of cells that the body may touch, also beyond the edge of the array, shape (n, 2) [m]."""
    body = case.bodies[0]
    reach = find_reach(make_parts(body)) + 2 * max(case.pitch)
    first = case.centres[0, :2]
    axes = [
        origin + pitch * np.arange(np.floor((at - reach - origin) / pitch), np.ceil((at + reach - origin) / pitch) + 1)
        for origin, pitch, at in zip(first, case.pitch, body.at[:2], strict=True)
    ]
    return np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)


def make_spec(case: Case, engine: str) -> mujoco.MjSpec:
    """Make the model of a case: the array, its sensor and the body."""
    half = np.array(case.pitch) * (case.columns, case.rows) / 2
    if engine == "touch-grid":
        fov = " ".join(str(np.degrees(np.arctan2(each, BEHIND))) for each in half)
        more = f"""<extension><plugin plugin="mujoco.sensor.touch_grid"/></extension>
          <sensor><plugin plugin="mujoco.sensor.touch_grid" objtype="site" objname="eye">
          <config key="size" value="{case.columns} {case.rows}"/><config key="fov" value="{fov}"/>
          <config key="gamma" value="0"/><config key="nchannel" value="1"/></plugin></sensor>"""
    elif engine == "tactile":
        # A point below the plate makes the mesh a solid; it touches nothing.
        points = np.vstack([case.centres, [0, 0, -HEIGHT]])
        more = f"""<asset><mesh name="points" vertex="{" ".join(map(str, points.ravel()))}"/></asset>
          <sensor><tactile geom="points" mesh="points"/></sensor>"""
    else:
        more = "<sensor>" + "".join(f'<touch site="texel{k}"/>' for k in range(len(case.centres))) + "</sensor>"
    geoms = make_array(case, engine)
    spec = mujoco.MjSpec.from_string(f"""<mujoco><option timestep="{STEP}" gravity="0 0 -{GRAVITY}"/>{more}
      <worldbody><body name="pad"><site name="eye" pos="0 0 {-BEHIND}" quat="0 1 0 0"/>{geoms}</body></worldbody>
      </mujoco>""")
    add_body(spec, case, fields=engine == "tactile")
    return spec


def make_array(case: Case, engine: str) -> str:
    """Return the geoms of the array, whose upper faces lie in the plane z = 0, and the sites of touch sensors."""
    x, y = np.array(case.pitch) / 2
    if engine == "tactile":
        return f"""<geom type="box" size="1 1 {HEIGHT / 2}" pos="0 0 {-HEIGHT / 2}" condim="1"/>
          <geom name="points" type="mesh" mesh="points" contype="0" conaffinity="0" mass="0"/>"""
    box = f'type="box" size="{NARROW * x} {NARROW * y} {HEIGHT / 2}" condim="1"'
    cells = list_cells(case)
    if engine == "touch-grid":
        return "".join(f'<geom {box} pos="{u} {v} {-HEIGHT / 2}"/>' for u, v in cells)
    # A touch sensor also counts contacts of its neighbours on the same body, whose normals lean towards its site.
    texels = (
        f"""<body pos="{u} {v} {-HEIGHT / 2}"><geom {box}/>
          <site name="texel{k}" type="box" size="{x} {y} {HEIGHT}"/></body>"""
        for k, (u, v, _) in enumerate(case.centres)
    )
    beyond = cells[(np.abs(cells[:, None] - case.centres[:, :2]) > [x, y]).any(axis=2).all(axis=1)]
    return "".join([*texels, *(f'<geom {box} pos="{u} {v} {-HEIGHT / 2}"/>' for u, v in beyond)])


def press(case: Case, engine: str) -> FloatArray:
    """Return the forces on the texels of a case, shape (n,) [N]."""
    model = make_spec(case, engine).compile()
    data = mujoco.MjData(model)
    if engine == "warp-touch":
        return press_in_warp(model, data)
    mujoco.mj_step(model, data, round(SETTLE / STEP))
    readings = []
    for _ in range(round(AVERAGE / STEP)):
        mujoco.mj_step(model, data)
        readings.append(np.maximum(data.sensordata[: len(case.centres)], 0.0))
    values = np.mean(readings, axis=0)
    if engine == "touch-grid":
        return np.asarray(values.reshape(case.rows, case.columns)[::-1].ravel())  # its rows count downwards
    return np.asarray(values * case.load / max(values.sum(), 1e-12))


def press_in_warp(model: mujoco.MjModel, data: mujoco.MjData) -> FloatArray:
    """Return the readings of all touch sensors at rest, in MuJoCo Warp, shape (n,) [N]."""
    import mujoco_warp
    import warp

    with warp.ScopedDevice("cpu"):
        there, state = mujoco_warp.put_model(model), mujoco_warp.put_data(model, data, nconmax=512, njmax=512)
        for _ in range(round(SETTLE / STEP)):
            mujoco_warp.step(there, state)
        return np.array(state.sensordata.numpy()[0], dtype=np.float64)


def main() -> int:
    """Press the cases and score them."""
    names = {
        "touch-grid": "MuJoCo, plugin touch_grid on boxes",
        "tactile": "MuJoCo, sensor tactile on a plate, scaled to the load",
        "warp-touch": "MuJoCo Warp on the CPU, touch sensors on boxes",
    }
    parser = make_parser(__doc__)
    parser.add_argument("--engine", choices=names, default="touch-grid", help="sensor")
    options = parser.parse_args()
    package = "mujoco-warp" if options.engine == "warp-touch" else "mujoco"
    name = f"mujoco-{options.engine}"
    return run(options, name, names[options.engine], lambda case: press(case, options.engine), package=package)


if __name__ == "__main__":
    sys.exit(main())
