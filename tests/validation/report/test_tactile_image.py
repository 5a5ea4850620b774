"""Tactile images as SVG."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshes.catalogue import ARRAYS
from validation.cli.heat_map import draw_force_images
from validation.render.image import Scale, choose_ink, measure_luminance, tactile_image


def test_row_0_is_at_the_bottom():
    array = ARRAYS["wts-0614-34"]
    values = np.zeros(84)
    values[0] = 1.0
    svg = tactile_image(array, values, Scale(peak=1.0))
    y = {title: float(y) for y, title in re.findall(r'y="([\d.]+)"[^>]*><title>(\[\d+, \d+\])', svg)}
    assert y["[0, 0]"] == max(y.values())
    assert y["[13, 0]"] == min(y.values())
    terminal = draw_force_images(array, [("x", values)]).columns[0]._cells[1].plain.splitlines()
    assert terminal[13].split()[0] == "1000"
    assert terminal[0].split()[0] == "0"


def test_masked_texels_are_told_apart():
    array = ARRAYS["sdh2-distal"]
    assert tactile_image(array, np.zeros(78), Scale(peak=1.0)).count("no texel") == 10


def test_outline_lies_where_the_texels_are():
    array = ARRAYS["wts-0614-34"]
    outline = array.centres[[0, 5, 83], :2]
    svg = tactile_image(array, np.zeros(84), Scale(peak=1.0), outline=outline)
    squares = np.array(re.findall(r'<rect x="([\d.]+)" y="([\d.]+)" width="([\d.]+)"', svg), dtype=float)
    points = [each.split(",") for each in re.search(r'points="([^"]+)"', svg)[1].split()]
    np.testing.assert_allclose(np.array(points, dtype=float), squares[[0, 5, 83], :2] + squares[0, 2] / 2, atol=0.06)


@pytest.mark.parametrize(("value", "expected"), [(0.0, "#ffffff"), (1.0, "#97142a"), (-1.0, "#0b4f8a"), (9, "#97142a")])
def test_colours_of_differences(value, expected):
    assert Scale(peak=1.0, difference=True).colour(value) == expected


@given(st.floats(1e-6, 1e6), st.floats(-1, 1), st.booleans())
def test_a_colour_depends_on_the_share_of_the_peak_alone(peak, share, difference):
    scale = Scale(peak=peak, difference=difference)
    assert re.fullmatch("#[0-9a-f]{6}", scale.colour(share * peak))
    one = Scale(peak=1.0, difference=difference).colour(share)
    apart = [abs(int(scale.colour(share * peak)[k : k + 2], 16) - int(one[k : k + 2], 16)) for k in (1, 3, 5)]
    assert max(apart) <= 1


@pytest.mark.parametrize(
    ("colour", "luminance"),  # by WCAG 2: the definition below 0.04045, and contrasts to white of tables
    [("#000000", 0), ("#0a0a0a", 10 / 255 / 12.92), ("#ffffff", 1), ("#777777", 1.05 / 4.478 - 0.05),
     ("#ff0000", 0.2126), ("#00ff00", 0.7152), ("#0000ff", 0.0722)],
)  # fmt: skip
def test_the_ink_has_the_larger_contrast_to_its_ground(colour, luminance):
    assert measure_luminance(colour) == pytest.approx(luminance, rel=1e-3)
    black, white = (luminance + 0.05) / 0.05, 1.05 / (luminance + 0.05)
    assert choose_ink(colour) == ("black" if black > white else "white")
