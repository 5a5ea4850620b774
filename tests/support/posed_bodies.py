"""Bodies over an array as the gap sampling takes them."""

import mujoco
import numpy as np

import fastmodel
from fastmodel.pressure.cell_grid import CellGrid
from fastmodel.pressure.gap import BodyShape, PosedBody, describe_solid
from meshes.catalogue import ARRAYS

GRID = CellGrid.over(ARRAYS["wts-0614-34"], 4, 1)


def pose_body(indenter, at=(0.7e-3, -1.1e-3), yaw=0.0, edge=0.0):
    """An indenter's solids on the array."""
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(pos=[*at, 0], quat=[np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)])
    fastmodel.add_geoms(spec, body, indenter)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return PosedBody(
        shape=BodyShape.of([describe_solid(model, geom, edge) for geom in range(model.ngeom)], edge),
        rotation=data.geom_xmat.reshape(-1, 3, 3).copy(),
        position=data.geom_xpos.copy(),
    )
