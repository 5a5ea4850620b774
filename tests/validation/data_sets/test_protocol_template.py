"""The template of a data-set file in the how-to on recordings, with made-up recordings by its protocol."""

import dataclasses
import re
import shlex
import shutil

import numpy as np
import pytest

from meshes import Box
from tests.support.laboratory import draw_gains, make_curve, press, uniform_method, write
from tests.support.pages import DOCS
from validation.calibration.calibrate import calibrate
from validation.calibration.model import Pose
from validation.cli.entry import app
from validation.data_sets.data_set import find_data_set
from validation.data_sets.images import observe, read_images
from validation.sensor_file import load

PAGE, TEMPLATE = (DOCS / "how-to" / f"record-a-data-set.{ending}" for ending in ("md", "toml"))
SENSOR = load("wts-0614-34")
SQUARE, ROUND = Box(size=(10e-3, 10e-3, 5e-3)), Box(size=(5.3e-3, 5.3e-3, 5e-3))
MASSES = (200, 300, 500, 800)
WARM = 0.01
PLACES = {
    name: (float(x) * 1e-3, float(y) * 1e-3)
    for name, x, y in re.findall(r"\| ([ABC][12]) \| (-?[\d.]+) \| (-?[\d.]+) ", PAGE.read_text())
}


def list_runs():
    """Folder, name and place of a stamp, its face, masses [g], number of repeats and temperature [degC]."""
    for place in PLACES:
        yield "day1/room", place, place, SQUARE, MASSES, 1, 23.0
        yield "day1/room", place, place, SQUARE, (500,), 2, 23.0
    yield "day1/room", "turned", "C1", SQUARE, MASSES, 1, 23.0
    for place in ("A2", "C1"):
        yield "day1/round", place, place, ROUND, (100, 200, 300), 1, 23.0
        yield "day1/warm", place, place, SQUARE, MASSES, 1, 33.0
        yield "day2/room", place, place, SQUARE, MASSES, 1, 22.0
    for repeat in (1, 2, 3):
        yield "day1/stays", "C1", "C1", SQUARE, (500,), repeat, 23.0
    for order in ("up", "down"):
        yield f"day1/{order}", "C1", "C1", SQUARE, (200, 500, 800), 1, 23.0


@pytest.fixture(scope="module")
def gains():
    return draw_gains(np.random.default_rng(3), count=SENSOR.array.count)


@pytest.fixture(scope="module")
def folder(tmp_path_factory, gains):
    folder = tmp_path_factory.mktemp("recordings")
    shutil.copy(TEMPLATE, folder)
    random, method = np.random.default_rng(4), uniform_method(SENSOR.array)
    curve = dataclasses.replace(make_curve(gains, warm=WARM), reference_temperature=23.0)
    for where, name, place, face, masses, repeat, degrees in list_runs():
        for mass in masses:
            options = {"indenter": face, "temperature": degrees, "scatter": 0.01, "seconds": 26.0, "rate": 2.0}
            made = press(method, curve, 9.81e-3 * mass, Pose(*PLACES[place]), random=random, **options)
            made.arrays[0].counts[made.times > 16] = 0  # lifted off after 15 s
            write(made, folder / where / f"{name}-{mass}g-{repeat}.csv")
    return folder


def test_the_page_counts_the_recordings_that_the_template_finds(folder):
    found = find_data_set(folder)
    assert found.problems == ()
    stated = re.findall(r"^\| `day\d.* \| (\d+) \| \d+ \| [^|]+ \|$", PAGE.read_text(), re.MULTILINE)
    assert len(found.files) == sum(map(int, stated)) == len(list(folder.glob("day*/*/*"))) == 60


@pytest.mark.slow
def test_each_split_scores_recordings_that_it_does_not_fit(folder):
    """Each split has the scores that its name promises: all are in the scored series, and none of them is fitted."""
    found = find_data_set(folder)
    images, problems = read_images(found, SENSOR.array)
    assert problems == []

    def choose(selections):
        chosen = [
            image
            for image in images
            if any(each.takes(image.file.series, image.file.path.name, image.load) for each in selections)
        ]
        return {image.file.name: image for image in chosen}

    sizes = {}
    for split in found.splits:
        fit, place, score = (choose(each) for each in (split.fit, split.place, split.score))
        assert not (fit.keys() | place.keys()) & score.keys()
        sizes[split.name] = (len(fit), len(place), len(score))
        if split.name == "heavier":
            assert max(image.load for image in fit.values()) < min(image.load for image in score.values())
        else:
            placed = {image.file.placement.name for image in place.values()}
            assert placed == {image.file.placement.name for image in score.values()}
    assert sizes == {
        "heavier": (20, 0, 5),
        "moved": (20, 2, 3),
        "another stamp": (25, 2, 4),
        "warmer": (25, 2, 6),
        "other session": (33, 2, 6),
    }


@pytest.mark.slow
def test_the_square_s_recordings_determine_level_places_and_temperature(folder, gains):
    images, _ = read_images(find_data_set(folder), SENSOR.array)
    images = [
        each for each in images if each.file.path.parent.name in {"room", "warm"} and each.file.placement.yaw == 0
    ]
    found = calibrate(observe(images), uniform_method(SENSOR.array))
    texels = found.texels
    assert np.abs(found.gains[texels] / (gains[texels] / gains[texels].mean()) - 1).max() < 0.05
    assert found.estimates["temperature"].low < WARM < found.estimates["temperature"].high
    for name, (x, y) in PLACES.items():
        pose = found.poses[name]
        assert (pose["x_m"][0], pose["y_m"][0]) == pytest.approx((x, y), abs=0.2e-3)


def test_commands_of_the_page_are_accepted():
    lines = re.findall(r"^softcover ([^#\n]*)", PAGE.read_text(), re.MULTILINE)
    assert [line.split()[0] for line in lines] == ["record", "replay", "calibrate"]
    for line in lines:
        command, bound, _ = app.parse_args(shlex.split(line), exit_on_error=False, print_error=False)
        assert command.__name__.startswith(line.split()[0])
        assert bound.arguments
