import numpy as np

from meshes.catalogue import ARRAYS
from validation.cli.heat_map import CELL, draw_force_images, draw_share_image


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


def test_shares_are_cut_to_the_neighbourhood_of_the_largest():
    image = np.zeros((14, 6))
    image[7, 3], image[0, 0] = 0.5, 0.01
    lines = draw_share_image(image, most=2).plain.splitlines()
    assert [line.split() for line in lines] == [["0"] * 5, ["0"] * 5, ["0", "0", "50", "0", "0"], ["0"] * 5, ["0"] * 5]
