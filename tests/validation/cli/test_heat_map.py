import io

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from rich.console import Console

from meshes.catalogue import ARRAYS
from validation.cli.heat_map import CELL, NEGATIVE, draw_force_images, draw_heat_map, draw_share_image, to_colours

SHARES = arrays.arrays(np.float64, st.tuples(st.integers(1, 6), st.integers(1, 6)), elements=st.floats(-1, 2))
COUNTS = arrays.arrays(np.int64, st.tuples(st.integers(1, 6), st.integers(1, 6)), elements=st.integers(0, 65535))


@given(low=st.floats(0, 1), high=st.floats(0, 1))
def test_colours_grow_brighter_with_the_value(low, high):
    low, high = sorted((low, high))
    dark, bright = to_colours(np.array([low, high])).astype(int)
    assert (bright >= dark).all()


@given(shares=SHARES)
def test_values_outside_the_scale_are_dark_blue_below_and_brightest_above(shares):
    colours = to_colours(shares)
    assert colours.shape == (*shares.shape, 3)
    assert (colours[shares < 0] == NEGATIVE).all()
    assert (colours[shares > 1] == to_colours(np.ones(1))[0]).all()


@given(counts=COUNTS)
def test_an_image_shows_every_number_with_row_0_at_the_bottom(counts):
    lines = draw_heat_map(counts, counts / 65535).plain.splitlines()
    assert [[int(word) for word in line.split()] for line in lines[::-1]] == [
        [int("".join(line)) for line in zip(*[iter(f"{''.join(f'{n:{CELL}d}' for n in row)}")] * CELL, strict=True)]
        for row in counts.tolist()
    ]


def test_masked_texels_stay_empty():
    array = ARRAYS["sdh2-distal"]
    drawn = draw_force_images(array, [("forces", np.ones(array.count))])
    lines = drawn.columns[0]._cells[1].plain.splitlines()
    assert lines[-1] == " " * CELL + f"{1000:{CELL}d}" * 4 + " " * CELL
    assert lines[0] == f"{1000:{CELL}d}" * 6


def test_images_stand_side_by_side_only_where_they_fit():
    array = ARRAYS["wts-0614-34"]
    images = [("first", np.zeros(84)), ("second", np.ones(84))]
    assert len(draw_force_images(array, images, width=63).columns) == 2
    assert len(draw_force_images(array, images, width=62).columns) == 1


def test_three_images_of_six_columns_fit_eighty_characters():
    array = ARRAYS["wts-0614-34"]
    images = [("finite elements", np.full(84, 0.447)), ("fast model", np.zeros(84)), ("difference", np.full(84, -0.01))]
    table = draw_force_images(array, images, width=80)
    assert len(table.columns) == 3
    console = Console(width=80, file=io.StringIO())
    console.print(table)
    lines = [line for line in console.file.getvalue().splitlines() if line.strip()]
    assert max(map(len, lines)) <= 80
    assert lines[-1].split() == ["447"] * 6 + ["0"] * 6 + ["-10"] * 6


def test_shares_are_cut_to_the_neighbourhood_of_the_largest():
    image = np.zeros((14, 6))
    image[7, 3], image[0, 0] = 0.5, 0.01
    lines = draw_share_image(image, most=2).plain.splitlines()
    assert [line.split() for line in lines] == [["0"] * 5, ["0"] * 5, ["0", "0", "50", "0", "0"], ["0"] * 5, ["0"] * 5]
