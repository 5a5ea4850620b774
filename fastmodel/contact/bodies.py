"""The bodies of a model that can touch an array, and the shapes of their geoms.

Geoms without a joint between them move together and count as one body.  Bodies that a `<weld>` constraint joins stay
separate, because the constraint is soft and MuJoCo gives each of them a force of its own.  A height field, a signed
distance field or a flex has no convex shape; its contact points stand for it, or the depth of a flex's surface, see
`fastmodel.pressure.flexes`.
"""

from __future__ import annotations

import mujoco
import numpy as np

from fastmodel.contact.geoms import find_obstacles
from fastmodel.errors import LifeCycleError
from fastmodel.pressure.gap import describe_solid, find_vertices, is_solid
from fastmodel.pressure.gap_sampling import BodyShape
from meshes.array_types import FloatArray, IntArray


class Bodies:
    """The bodies of a model as an array sees them.

    Attributes:
        of_geom: Id of the body that each geom moves with; -1 for a geom whose shape is not a convex solid; the last
            entry, which MuJoCo's geom id -1 selects, stands for flexes, shape (geoms + 1,).
    """

    def __init__(self, model: mujoco.MjModel, own: IntArray, name: str, edge: float = 0.0) -> None:
        """Sort the geoms of a model by body.

        Args:
            model: The compiled model.
            own: Ids of the geoms of the array.
            name: Name of the sensor, for error messages.
            edge: Distance by which solids with sharp edges are enlarged [m].
        """
        self._model, self._own, self._name, self._edge = model, own, name, edge
        self._size = model.geom_size[own].copy()
        self.of_geom = np.empty(0, dtype=np.int64)
        self._sizes = self._state = b""
        self._shapes: dict[int, tuple[IntArray, BodyShape]] = {}
        self._vertices: dict[int, FloatArray] = {}
        self.follow_changes()

    def check_size(self) -> None:
        """Check that the array's own geoms have the size with which they were attached.

        Raises:
            LifeCycleError: If their size has changed.
        """
        sizes = self._model.geom_size.tobytes()
        if sizes == self._sizes:
            return
        if not np.array_equal(self._model.geom_size[self._own], self._size):
            raise LifeCycleError(
                f"the geoms of sensor {self._name!r} have another size than when they were attached; the array's size "
                f"belongs to its parameters: attach it anew"
            )
        self._sizes = sizes

    def follow_changes(self) -> None:
        """Discard what is known of geoms if their shapes, or what they may touch, have changed since the last call.

        Raises:
            LifeCycleError: If the size of the array's own geoms has changed.
        """
        self.check_size()
        model = self._model
        shapes = (model.geom_type, model.geom_dataid)
        rules = (
            model.geom_contype,
            model.geom_conaffinity,
            model.exclude_signature,
            model.pair_geom1,
            model.pair_geom2,
        )
        state = b"".join([self._sizes, *(each.tobytes() for each in (*shapes, *rules))])
        if state == self._state:
            return
        self._state = state
        self._shapes.clear()
        solid = np.array([is_solid(model, geom) for geom in range(model.ngeom)], dtype=bool)
        weld = model.body_weldid[model.geom_bodyid]
        self.of_geom = np.append(np.where(solid, weld, -1), -1).astype(np.int64)

    def follow_meshes(self) -> None:
        """Discard the shapes of bodies if the vertices of a mesh have changed since its shape was computed."""
        for geom, vertices in self._vertices.items():
            if not np.array_equal(find_vertices(self._model, geom), vertices):
                self._shapes.clear()

    def find_shapes(self) -> None:
        """Describe the shapes of all bodies that can touch the array, so that none is described at its first touch."""
        for body in np.unique(self.of_geom[:-1][find_obstacles(self._model, self._own) == ""]).tolist():
            if body >= 0:
                self.find_shape(body)

    def find_shape(self, body: int) -> tuple[IntArray, BodyShape]:
        """Find the ids of the geoms of a body that can collide with the array, and describe their shapes."""
        if body not in self._shapes:
            touches = find_obstacles(self._model, self._own) == ""
            geoms = (touches & (self.of_geom[:-1] == body)).nonzero()[0]
            for geom in geoms[self._model.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_MESH].tolist():
                self._vertices[geom] = find_vertices(self._model, geom)
            solids = tuple(describe_solid(self._model, int(geom), self._edge) for geom in geoms)
            self._shapes[body] = geoms, BodyShape(solids=solids, edge=self._edge)
        return self._shapes[body]
