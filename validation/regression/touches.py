"""The experiment on touches: limits of the built-in sensor, located and planned touches, and a design."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import fastmodel
from meshes import Cover, Layer, Material, TexelArray
from validation.calibration.next_touches import Covers, Errors, Plan
from validation.regression.reading import Readings, Subject, read
from validation.resolution.channel import Channel, make_channel
from validation.resolution.design import find_designs
from validation.resolution.limits import Study, find_place_error
from validation.resolution.locate import Locator
from validation.resolution.touches import find_touches
from validation.sensor_file import BUILT_IN

#: Built-in sensor, index of the touched texel, noise [N] and load [N], and place of the touch around the texel [m].
_SENSOR, _TEXEL, _NOISE, _LOAD, _PLACE = "wts-0614-34", 38, 5e-3, 1.8, (1.2e-3, -1.0e-3)


def measure_touches(subject: Subject) -> Readings:  # noqa: ARG001 -- the experiment is fixed
    """Compute limits with noise alone and of counts, and locate a touch whose radius is known."""
    sensor = BUILT_IN[_SENSOR]
    touches = find_touches(sensor.cover, sensor)
    counted, _ = make_channel(fastmodel.load(_SENSOR).electronics, _NOISE, sensor.array.active)
    place = np.array([_PLACE])
    exact, where = _LOAD * touches.forces(_TEXEL, place), touches.origins[_TEXEL, :2] + place[0]
    bounds, errors, least, told, widths = {}, {}, {}, {}, {}
    for name, channel in (("noise alone", Channel(noise=_NOISE)), ("counts", counted)):
        study = Study(touches=touches, channel=channel, texel=_TEXEL, load=_LOAD)
        if channel.electronics is None:  # the bound of counts is infinite where few texels are lit
            bounds = {name: np.sqrt(np.diagonal(study.bound(place, 3)[0][0])[:2]).tolist()}
        errors[name] = find_place_error(study, 4)
        least[name] = channel.find_least_force(study.respond(place)[0])
        locator = Locator(touches=touches, channel=channel, centres=sensor.array.centres, radii=(0.0, 0.0))
        (touch,) = locator.find(channel.read(exact, np.zeros_like(exact)), 1).touches
        told[name] = [touch.x.value - where[0], touch.y.value - where[1]]
        widths[name] = [each.high - each.low for each in (touch.x, touch.y)]
    return {
        "bound of x and y": read(bounds, "mm", "1 % of each"),
        "error of place": read(errors, "mm", "5 % of each"),
        "least force": read(least, "mN", "1 % of each"),
        "located touch from the true one": read(told, "mm", 0.02),
        "interval of x and y": read(widths, "mm", "10 % of each"),
        **_measure_plans(counted),
    }


def _measure_plans(channel: Channel) -> Readings:
    """Compute what planned touches settle on a small array, and the numbers of one design under a ball."""
    sensor = BUILT_IN[_SENSOR]
    small = replace(sensor, array=TexelArray.grid(3, 3, sensor.array.pitch, texel_size=sensor.array.texel_size))
    errors = Errors(place=1e-4, shift=2e-4, force=0.01)
    plan = Plan(Covers(small), channel, errors, load=_LOAD, radius=1e-3, wanted=("gains", "thickness", "poisson"))
    after = plan.add(plan.prior, plan.roots[plan.choose(plan.prior, 12)])
    settled = {each.name: each.after for each in plan.expect(plan.prior, after) if each.name != "shift"}
    rubber = Material(name="rubber", model="linear-elastic", parameters={"youngs_modulus": 1e6}, poisson_ratio=0.49)
    cover = Cover(layers=(Layer(thickness=2e-3, material=rubber),))
    (found,) = find_designs(
        sensor, cover, load=_LOAD, thicknesses=(3e-3,), pitches=(2.5e-3,), noise=_NOISE, radius=None
    ).designs
    numbers = {name: value for name, value in found.numbers.items() if value is not None and name != "error_m"}
    return {
        "interval of planned gains and cover": read(settled, "1", "3 % of each"),
        "numbers of a design": read(numbers, "SI", "1 % of each"),
    }
