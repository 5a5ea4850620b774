"""The picture of the example `shadow_hand.py`: four moments of the run, and the force on each array over time."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import mujoco
import numpy as np
import numpy.typing as npt
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure
    from matplotlib.image import AxesImage
    from shadow_hand import Hand, Mount, Run

#: Titles of the moments that are drawn, and their times [s].
MOMENTS = (("at rest", 0.2), ("closing", 1.0), ("grasped", 1.7), ("turned over", 3.9))
#: Camera: the point that it looks at [m], its distance from there [m], azimuth and elevation [degrees].
LOOK_AT, DISTANCE, AZIMUTH, ELEVATION = (1.0, 0.93, 0.165), 0.32, 60.0, -45.0
#: Colours of the four fingers; the palm is black.
COLOURS = ("#2b6cb0", "#3a9d6e", "#dd8a34", "#8a5fb0")
#: Space around the arrays in the map of the hand [m].
MARGIN = 0.012


@dataclass(frozen=True, kw_only=True, eq=False)
class Moment:
    """The state at one time.

    Attributes:
        title: What happens then.
        time: The time [s].
        forces: Texel forces of each array by the name of its link, each of shape (rows, columns) [N].
        picture: The rendered scene, shape (height, width, 3); None if MuJoCo cannot render on this machine.
    """

    title: str
    time: float
    forces: dict[str, npt.NDArray[np.float64]]
    picture: npt.NDArray[np.uint8] | None


class Camera:
    """Renders the scene.  Without OpenGL it returns no pictures."""

    def __init__(self, hand: Hand) -> None:
        self._data = hand.data
        size = hand.model.vis.global_
        try:
            self._renderer: mujoco.Renderer | None = mujoco.Renderer(hand.model, size.offheight, size.offwidth)
        except Exception:  # noqa: BLE001 -- the exception depends on which part of OpenGL is missing
            self._renderer = None
            return
        self._view = mujoco.MjvCamera()
        self._view.lookat[:] = LOOK_AT
        self._view.distance, self._view.azimuth, self._view.elevation = DISTANCE, AZIMUTH, ELEVATION

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Render the scene as it is now."""
        if self._renderer is None:
            return None
        self._renderer.update_scene(self._data, self._view)
        return np.asarray(self._renderer.render(), dtype=np.uint8)

    def close(self) -> None:
        """Release the renderer."""
        if self._renderer is not None:
            self._renderer.close()


def capture_moment(hand: Hand, title: str, time: float, camera: Camera) -> Moment:
    """Keep the texel forces and a picture of the scene as it is now."""
    forces = {
        link: sensor.parameters.array.image(np.asarray(sensor.frame().texel_forces))
        for link, sensor in hand.sensors.items()
    }
    return Moment(title=title, time=time, forces=forces, picture=camera.render())


def draw(hand: Hand, run: Run, path: Path) -> None:
    """Draw the scene and the arrays at each moment, and below them the forces over time."""
    rendered = all(moment.picture is not None for moment in run.moments)
    figure = Figure(figsize=(11, 9 if rendered else 7), layout="constrained")
    (above,), (below,) = figure.subfigures(2, 1, squeeze=False, height_ratios=(2.8 if rendered else 1.8, 1.0))
    heights = (1.0, 1.7) if rendered else (1.0,)
    axes = above.subplots(len(heights), len(run.moments), squeeze=False, height_ratios=heights)
    norm = PowerNorm(0.5, vmin=0.0, vmax=max(image.max() for moment in run.moments for image in moment.forces.values()))
    for column, moment in enumerate(run.moments):
        if rendered:
            axes[0, column].imshow(moment.picture)
            axes[0, column].axis("off")
        axes[0, column].set_title(f"{moment.title}, {moment.time:.1f} s")
        drawn = draw_arrays(axes[-1, column], hand, moment, norm)
    above.colorbar(drawn, ax=axes[-1, :], label="force on the texel [N]", shrink=0.9)
    draw_forces(below, hand, run)
    figure.savefig(path, dpi=100)


def draw_arrays(axis: Axes, hand: Hand, moment: Moment, norm: PowerNorm) -> AxesImage:
    """Draw the tactile image of each array where it lies on the open hand, seen from the palm's side."""
    from shadow_hand import MOUNTS

    extents = []
    for mount in MOUNTS:
        array = hand.sensors[mount.link].parameters.array
        x, y = locate_on_open_hand(hand, mount)
        half = (mount.columns * array.pitch[0] / 2, mount.rows * array.pitch[1] / 2)
        extents.append((x - half[0], x + half[0], y - half[1], y + half[1]))
        # A nearly incompressible cover pulls slightly beside a contact.  Draw these small negative forces as zero.
        image = np.maximum(moment.forces[mount.link], 0.0)
        drawn = axis.imshow(image, origin="lower", extent=extents[-1], cmap="inferno", norm=norm)
    low, high = np.min(extents, axis=0), np.max(extents, axis=0)
    axis.set_xlim(low[0] - MARGIN, high[1] + MARGIN)
    axis.set_ylim(low[2] - MARGIN, high[3] + MARGIN)
    axis.set_facecolor("#e4e7ec")
    axis.set_xticks([])
    axis.set_yticks([])
    return drawn


def locate_on_open_hand(hand: Hand, mount: Mount) -> tuple[float, float]:
    """Find the centre of an array on the open hand, from the palm's origin: across and along the hand [m]."""
    from shadow_hand import PREFIX

    body, palm = hand.model.body(PREFIX + mount.link).id, hand.model.body(PREFIX + "palm").id
    position = np.array(mount.position)
    while body != palm:
        position = position + hand.model.body_pos[body]
        body = hand.model.body_parentid[body]
    return float(position[0]), float(position[2])


def draw_forces(figure: SubFigure, hand: Hand, run: Run) -> None:
    """Draw the force on each array over time."""
    axis = figure.subplots()
    for index, link in enumerate(hand.sensors):
        colour = "black" if link == "palm" else COLOURS[index % len(COLOURS)]
        axis.plot(run.times, run.forces[:, index], "--" if link.endswith("middle") else "-", color=colour, label=link)
    for _, time in MOMENTS:
        axis.axvline(time, color="#9aa0ab", linewidth=0.8, linestyle=":")
    axis.set_xlabel("time [s]")
    axis.set_ylabel("force on the array [N]")
    axis.set_xlim(0, run.times[-1])
    axis.set_ylim(bottom=0)
    axis.legend(ncols=3, fontsize="small", frameon=False, loc="upper right")
