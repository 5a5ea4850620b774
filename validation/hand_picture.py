"""The hand's run as files: a recording of all arrays and a picture of four moments."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
import numpy.typing as npt

from validation.hand import PICTURE_SIZE, PLACES, Hand
from validation.recordings.labels import Setup, plain_array
from validation.recordings.mcap_writer import Clocks, RecordingWriter
from validation.recordings.recording import RecordedArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

FloatArray = npt.NDArray[np.float64]

#: What is looked at, and when [s].
MOMENTS = (("at rest", 0.2), ("closing", 1.0), ("grasped", 1.7), ("turned over", 3.9))
#: Where the camera stands.
_LOOK_AT, _DISTANCE, _AZIMUTH, _ELEVATION = (1.0, 0.93, 0.165), 0.32, 60.0, -45.0
_COLOURS = ("#2b6cb0", "#3a9d6e", "#dd8a34", "#8a5fb0")
#: Room around the arrays in the map of the hand [m].
_ROOM = 0.012


@dataclass(frozen=True, kw_only=True, eq=False)
class Moment:
    """One moment of the run.

    Attributes:
        title: What it shows.
        time: When [s].
        forces: Texel forces of each array in the order of `PLACES`, each of shape (rows, columns) [N].
        picture: The scene, shape (height, width, 3); None where nothing can be rendered.
    """

    title: str
    time: float
    forces: tuple[FloatArray, ...]
    picture: npt.NDArray[np.uint8] | None


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """What came of one run.

    Attributes:
        times: Of the frames, shape (frames,) [s].
        carried: Force on each array and its margin at each frame, shape (frames, arrays) [N].
        moments: What is drawn.
        seconds: Wall time of physics and sensors [s].
        processor_seconds: The processor time in it; less where other programs run as well [s].
    """

    times: FloatArray
    carried: FloatArray
    moments: tuple[Moment, ...]
    seconds: float
    processor_seconds: float

    @property
    def real_time_factor(self) -> float:
        """Simulated time over wall time [-]."""
        return float(self.times[-1] / self.seconds)


def record(hand: Hand, path: Path, *, note: str) -> Run:
    """Run the hand, write every frame of every array, and keep what is drawn.

    Args:
        hand: At its start.
        path: The MCAP file; it must not exist.
        note: What to write into it.

    Raises:
        StorageError: If the file cannot be written.
    """
    camera = _Camera(hand)
    times, carried, aside = [], [], np.zeros(2)
    moments: list[Moment] = []
    begun = time.time_ns()
    with RecordingWriter(path, arrays=_arrays(hand), setup=Setup(note=note, source="simulation"), start=begun) as file:
        start = _clocks()
        for moment in hand.run():
            paused = _clocks()
            clocks = Clocks(begun + round(1e9 * moment))
            for index, sensor in enumerate(hand.sensors.values()):
                frame = sensor.frame()
                file.add_frame(index, clocks, frame.counts, texel_forces=frame.texel_forces)
            times.append(moment)
            carried.append([sensor.carried() for sensor in hand.sensors.values()])
            if len(moments) < len(MOMENTS) and moment >= MOMENTS[len(moments)][1]:
                moments.append(_look(hand, MOMENTS[len(moments)][0], moment, camera))
            aside += _clocks() - paused
        seconds, processor_seconds = (_clocks() - start - aside).tolist()
    camera.close()
    return Run(
        times=np.array(times),
        carried=np.array(carried),
        moments=tuple(moments),
        seconds=seconds,
        processor_seconds=processor_seconds,
    )


def _clocks() -> FloatArray:
    """Wall clock and this thread's processor time [s]."""
    return np.array([time.perf_counter(), time.thread_time()])


def draw(hand: Hand, run: Run, path: Path) -> None:
    """Draw four moments, the arrays laid out as on the open hand seen from the palm's side, and the forces over time.

    Args:
        hand: The scene.
        run: What came of it.
        path: The picture's file.
    """
    from matplotlib.figure import Figure

    rendered = all(moment.picture is not None for moment in run.moments)
    figure = Figure(figsize=(11, 9 if rendered else 7), layout="constrained")
    (above,), (below,) = figure.subfigures(2, 1, squeeze=False, height_ratios=(2.8 if rendered else 1.8, 1.0))
    heights = (1.0, 1.7) if rendered else (1.0,)
    axes = above.subplots(len(heights), len(run.moments), squeeze=False, height_ratios=heights)
    peak = max(float(image.max()) for moment in run.moments for image in moment.forces)
    for column, moment in enumerate(run.moments):
        if rendered:
            axes[0, column].imshow(moment.picture)
            axes[0, column].axis("off")
        axes[0, column].set_title(f"{moment.title}, {moment.time:.1f} s")
        drawn = _draw_arrays(axes[-1, column], hand, moment, peak)
    above.colorbar(drawn, ax=axes[-1, :], label="force on the texel [N]", shrink=0.9)
    _draw_forces(below, run)
    figure.savefig(path, dpi=100)


def _draw_arrays(axis: Axes, hand: Hand, moment: Moment, peak: float) -> Any:  # noqa: ANN401 -- matplotlib's image
    from matplotlib.colors import PowerNorm

    corners = []
    norm = PowerNorm(0.5, vmin=0.0, vmax=peak)
    for place, image in zip(PLACES, moment.forces, strict=True):
        x, y = hand.on_open_hand(place)
        pitch = hand.sensors[place.body].parameters.array.pitch
        half = (place.columns * pitch[0] / 2, place.rows * pitch[1] / 2)
        extent = (x - half[0], x + half[0], y - half[1], y + half[1])
        # A nearly incompressible cover pulls a little beside a touch; that is drawn as nothing.
        drawn = axis.imshow(np.maximum(image, 0.0), origin="lower", extent=extent, cmap="inferno", norm=norm)
        corners.append(extent)
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    axis.set_xlim(low[0] - _ROOM, high[1] + _ROOM)
    axis.set_ylim(low[2] - _ROOM, high[3] + _ROOM)
    axis.set_facecolor("#e4e7ec")
    axis.set_xticks([])
    axis.set_yticks([])
    return drawn


def _draw_forces(figure: SubFigure, run: Run) -> None:
    axis = figure.subplots()
    for index, place in enumerate(PLACES):
        palm = place.body == "palm"
        axis.plot(
            run.times,
            run.carried[:, index],
            color="black" if palm else _COLOURS[index % len(_COLOURS)],
            linestyle="--" if place.body.endswith("middle") else "-",
            label=place.body,
        )
    for _, moment in MOMENTS:
        axis.axvline(moment, color="#9aa0ab", linewidth=0.8, linestyle=":")
    axis.set_xlabel("time [s]")
    axis.set_ylabel("force on the array [N]")
    axis.set_xlim(0, run.times[-1])
    axis.set_ylim(bottom=0)
    axis.legend(ncols=3, fontsize="small", frameon=False, loc="upper right")


def _look(hand: Hand, title: str, moment: float, camera: _Camera) -> Moment:
    frames = [sensor.frame() for sensor in hand.sensors.values()]
    arrays = [sensor.parameters.array for sensor in hand.sensors.values()]
    return Moment(
        title=title,
        time=moment,
        forces=tuple(
            np.asarray(array.image(np.asarray(frame.texel_forces)), dtype=np.float64)
            for array, frame in zip(arrays, frames, strict=True)
        ),
        picture=camera.picture(),
    )


class _Camera:
    """Pictures of the scene, where MuJoCo finds a way to render them."""

    def __init__(self, hand: Hand) -> None:
        self._data = hand.data
        self._renderer: Any = None
        try:
            self._renderer = mujoco.Renderer(hand.model, *PICTURE_SIZE)
        except Exception:  # noqa: BLE001 -- what a machine without OpenGL raises depends on what is missing
            return
        self._view = mujoco.MjvCamera()
        self._view.lookat[:] = _LOOK_AT
        self._view.distance, self._view.azimuth, self._view.elevation = _DISTANCE, _AZIMUTH, _ELEVATION

    def picture(self) -> npt.NDArray[np.uint8] | None:
        if self._renderer is None:
            return None
        self._renderer.update_scene(self._data, self._view)
        return np.asarray(self._renderer.render(), dtype=np.uint8)

    def close(self) -> None:
        if self._renderer is not None:
            self._renderer.close()


def _arrays(hand: Hand) -> Sequence[RecordedArray]:
    """The arrays as a recording describes them."""
    described = []
    for place in PLACES:
        parameters = hand.sensors[place.body].parameters
        empty = np.empty((0, parameters.array.count), dtype=np.int32)
        array = plain_array(
            place.rows,
            place.columns,
            empty,
            pitch=parameters.array.pitch,
            full_scale=parameters.electronics.output_max,
            name=place.body,
        )
        described.append(dataclasses.replace(array, centre=place.position))
    return described
