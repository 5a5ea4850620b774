import numpy as np

from validation.cli.curve_text import draw_curve


def dots(character):
    return (ord(character) - 0x2800).bit_count()


def test_a_rising_line_goes_from_the_lower_left_to_the_upper_right_corner():
    x = np.linspace(-50.0, 100.0, 301)
    *drawing, axis = draw_curve(x, 3 * x, width=20, height=5)
    bodies = [line.split("|")[1].ljust(20, chr(0x2800)) for line in drawing]
    assert dots(bodies[0][-1]) > 0
    assert dots(bodies[-1][0]) > 0
    assert dots(bodies[0][0]) == dots(bodies[-1][-1]) == 0
    assert axis.split() == ["-50", "100"]
    assert drawing[0].split("|")[0].strip() == "300"
    assert drawing[-1].split("|")[0].strip() == "-150"


def test_every_column_of_dots_holds_the_curve():
    x = np.linspace(0, 1, 50)
    *drawing, _ = draw_curve(x, np.sin(20 * x), width=30, height=6)
    bodies = [line.split("|")[1].ljust(30, chr(0x2800)) for line in drawing]
    assert all(sum(dots(body[k]) for body in bodies) >= 2 for k in range(30))


def test_a_constant_is_one_line():
    *drawing, _ = draw_curve(np.array([0.0, 1.0]), np.array([2.0, 2.0]), width=10, height=3)
    assert sum(set(line.split("|")[1]) > set() for line in drawing) == 1
