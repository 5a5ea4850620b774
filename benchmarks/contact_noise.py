"""Measures the noise of MuJoCo's contact force on an array, at rest, in a slide and at a landing; draws its spectra.

    python benchmarks/contact_noise.py [--out docs/_static/contact-noise.png]

A free ball or block of 100 g presses on an array of 14 x 6 texels.  Forces on texels before the point spread are read
at each step of 1 ms, without electronics, so that all that varies is the engine.  Spectra are one-sided power spectral
densities by Welch's method.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from matplotlib.lines import Line2D
from scipy.signal import butter, sosfilt, welch

import fastmodel
from fastmodel import BoxTexels, CoverContact, Parameters, TexelContact, recommend_options
from meshes.array_types import FloatArray
from meshes.constants import STANDARD_GRAVITY
from validation.render.figure import open_figure

#: Step of the simulation [s]; time before and of a recording [s]; mass [kg].
STEP, WAIT, LENGTH, MASS = 1e-3, 2.0, 4.0, 0.1
#: Order and cut-off of the filters by name: that of the table, and one of the 2015 report [-, Hz].
FILTERS = {"order 2, 40 Hz": (2, 40.0), "order 5, 8 Hz": (5, 8.0)}
SHOWN = "order 2, 40 Hz"
#: Geoms of the bodies: type and size [m].
BODIES = {"ball": (mujoco.mjtGeom.mjGEOM_SPHERE, [5e-3, 0, 0]), "block": (mujoco.mjtGeom.mjGEOM_BOX, [7.5e-3] * 3)}
#: Contact methods, and whether the recommended solver options are set.
METHODS: dict[str, tuple[Callable[[], TexelContact], bool]] = {
    "boxes, MuJoCo's options": (BoxTexels, False),
    "boxes, recommended": (BoxTexels, True),
    "cover, MuJoCo's options": (CoverContact, False),
    "cover, recommended": (CoverContact, True),
}
#: Speed of the slide [m/s], height of the fall [m].
SPEED, HEIGHT = 20e-3, 3e-3


class Recording(NamedTuple):
    """Forces of one simulation.

    Attributes:
        total: Force on the array at each step, shape (k,) [N].
        texels: Force on each of n texels, shape (k, n) [N].
    """

    total: FloatArray
    texels: FloatArray

    def filtered(self, name: str) -> Recording:
        """Return the forces after a filter of `FILTERS` that starts from zero."""
        order, cut = FILTERS[name]
        sections = butter(order, cut, fs=1 / STEP, output="sos")
        return Recording(*(np.asarray(sosfilt(sections, each, axis=0)) for each in self))


def record(
    parameters: Parameters, method: str, body: str, *, height: float = 0.0, speed: float = 0.0, seconds: float
) -> Recording:
    """Simulate a body on the array.

    Args:
        parameters: Parameters of the sensor.
        method: Name of the contact method and options in `METHODS`.
        body: Name of the body in `BODIES`.
        height: Height of its lowest point at the start [m].
        speed: Speed along x that a stiff actuator holds; 0 for a free body [m/s].
        seconds: Length of the simulation [s].
    """
    make, recommended = METHODS[method]
    spec, contact = mujoco.MjSpec(), make()
    if recommended:
        recommend_options(spec)
    spec.option.timestep = STEP
    spec.option.gravity[:] = [0, 0, -STANDARD_GRAVITY]
    contact.attach(spec.worldbody.add_frame(), parameters.array, "array")
    kind, size = BODIES[body]
    moved = spec.worldbody.add_body(name="body", pos=[0.7e-3 - 8e-3 * (speed > 0), 1.1e-3, size[0] + height])
    if speed:
        for axis in ((1, 0, 0), (0, 0, 1)):
            moved.add_joint(name=f"slide{axis}", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        drive = spec.add_actuator(target=f"slide{(1, 0, 0)}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        drive.set_to_velocity(kv=100.0)
    else:
        moved.add_freejoint()
    moved.add_geom(type=kind, size=size, mass=MASS)
    model = spec.compile()
    data, reader = mujoco.MjData(model), contact.bind(model, parameters.array, "array", surface=parameters.surface)
    totals, texels = [], []
    for step in range(round(seconds / STEP)):
        data.ctrl[:] = speed * (step * STEP > 0.5)  # it comes to rest before
        mujoco.mj_step(model, data)
        reading = reader.read(data)
        totals.append(reading.carried)
        texels.append(reading.contact_forces)
    return Recording(np.array(totals), np.array(texels))


def measure(forces: FloatArray, first: int) -> float:
    """Return the standard deviation from a sample on, the largest over columns if there are any, over the load [-]."""
    return float(np.max(forces[first:].std(axis=0)) / (MASS * STANDARD_GRAVITY))


def main() -> None:
    """Print the table and draw the spectra."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path)
    out, parameters = parser.parse_args().out, fastmodel.load("wts-0614-34")
    rested: dict[str, Recording] = {}
    landed: dict[str, Recording] = {}
    print("% of the load; filtered by order 2, 40 Hz")
    print("                               at rest                    slide, 20 mm/s    landing, 3 mm")
    print("method and options      body   sum      texel    filtered sum      filtered largest  filtered")
    for method in METHODS:
        for body in BODIES:
            rest = record(parameters, method, body, seconds=WAIT + LENGTH)
            slide = record(parameters, method, body, speed=SPEED, seconds=1.4)
            land = record(parameters, method, body, height=HEIGHT, seconds=0.4)
            rested[f"{body}, {method}"], landed[f"{body}, {method}"] = rest, land
            first, moving = round(WAIT / STEP), round(0.7 / STEP)
            numbers = [measure(each, first) for each in (rest.total, rest.texels, rest.filtered(SHOWN).texels)]
            numbers += [measure(each.total, moving) for each in (slide, slide.filtered(SHOWN))]
            numbers += [each.total.max() / (MASS * STANDARD_GRAVITY) for each in (land, land.filtered(SHOWN))]
            print(f"{method:24}{body:7}{''.join(f'{100 * each:<9.2g}' for each in numbers)}".rstrip())
    if out is not None:
        draw(rested, landed, out)


def draw(rested: dict[str, Recording], landed: dict[str, Recording], out: Path) -> None:
    """Draw spectra at rest and at a landing, and the force over time of the landing, before and after filters."""
    names = {"block, boxes, MuJoCo's options": "#cc79a7", "block, cover, recommended": "#d55e00"}
    with open_figure(out, height=2.8) as figure:
        rest, land, time = figure.subplots(1, 3)
        for axes, recordings, first in ((rest, rested, round(WAIT / STEP)), (land, landed, 0)):
            for name, colour in names.items():
                for line, each in (("-", recordings[name]), ("--", recordings[name].filtered(SHOWN))):
                    column = each.texels[first:, recordings[name].texels[first:].std(axis=0).argmax()]
                    frequency, density = welch(column, 1 / STEP, nperseg=min(len(column), 1024))
                    decibels = 10 * np.log10(np.maximum(density[1:], 1e-20))
                    axes.semilogx(frequency[1:], decibels, line, color=colour, linewidth=0.8)
            axes.xaxis.set_major_formatter("{x:g}")
            axes.set(xlabel="frequency [Hz]", ylabel="noisiest texel [dB of 1 N\u00b2/Hz]", ylim=(-205, -30))
        rest.set_title("at rest")
        land.set_title("landing from 3 mm")
        raw = landed["block, cover, recommended"]
        times = 1e3 * STEP * np.arange(len(raw.total))
        time.plot(times, raw.total, color="black", label="no filter")
        for name in FILTERS:
            time.plot(times, raw.filtered(name).total, label=name)
        time.set(xlabel="time [ms]", ylabel="force on the array [N]", title="landing, cover", xlim=(0, 300))
        time.legend()
        lines = [Line2D([], [], color=colour) for colour in names.values()]
        lines += [Line2D([], [], color="grey", linestyle=line) for line in ("-", "--")]
        figure.legend(lines, [*names, "no filter", f"after {SHOWN}"], loc="outside lower center", ncols=4)


if __name__ == "__main__":
    main()
