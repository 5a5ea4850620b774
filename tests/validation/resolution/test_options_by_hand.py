"""Options of the verbs `limits`, `locate` and `design`, in SI units and at their borders; nothing is computed."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import validation
from validation.errors import InputError
from validation.resolution.verb import design, limits, locate, read_limits

NAME = "wts-0614-34"
#: Its texels lie 3.4 mm apart.
WTS = validation.load(NAME)


@pytest.fixture
def asked(monkeypatch):
    """What the computations were given, and what was drawn or written."""
    asked = []

    def stand_in(place, found=None):
        def compute(*given, **options):
            asked.append((place.rsplit(".", 1)[1], given, options))
            return found

        monkeypatch.setattr(place, compute)

    located = SimpleNamespace(write=lambda path: asked.append(("write", path)))
    stand_in("validation.resolution.limits.find_limits", "limits")
    stand_in("validation.resolution.locate.locate_frames", located)
    stand_in("validation.resolution.design.find_designs", "designs")
    for name in ("picture.draw_map", "picture.draw_touches", "design_page.write_designs"):
        stand_in(f"validation.resolution.{name}")
    return asked


def test_quantities_of_limits_are_read_in_si_units(asked, tmp_path):
    found = limits(
        NAME, load="250 mN", noise="3 mN", two="6 mm", radius="1.5 mm", thicknesses="1mm:6mm:3", prior="between",
        progress=print,
    )  # fmt: skip
    assert found == "limits"
    ((_, given, options),) = asked
    assert given == (WTS,)
    assert options == {
        "load": pytest.approx(0.25), "noise": pytest.approx(3e-3), "separation": pytest.approx(6e-3),
        "radius": pytest.approx(1.5e-3), "thicknesses": (1e-3, 3.5e-3, 6e-3), "prior": "between", "over_array": False,
        "progress": print,
    }  # fmt: skip
    asked.clear()
    target = tmp_path / "map.svg"
    limits(NAME, picture=target)
    (_, _, options), drawn = asked
    assert options == {
        "load": 1.0, "noise": None, "separation": None, "radius": 0.0, "thicknesses": (), "prior": "around",
        "over_array": True, "progress": None,
    }  # fmt: skip
    assert drawn[:2] == ("draw_map", ("limits", WTS.array, target))


def test_a_curve_has_eleven_thicknesses_unless_a_count_is_given():
    assert read_limits(WTS, thicknesses="1mm:6mm")["thicknesses"] == tuple(
        round(1e-3 + 5e-4 * k, 12) for k in range(11)
    )
    assert read_limits(WTS, thicknesses="0.01mm:100mm:2")["thicknesses"] == (1e-5, 0.1)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"load": "10.1 kN"}, "--load: "), ({"load": "0 N"}, "--load: "), ({"noise": "-1 mN"}, "--noise: "),
        ({"noise": "10001 N"}, "--noise: "), ({"two": "68.1 mm"}, "--two: "), ({"two": "0 mm"}, "--two: "),
        ({"radius": "68.1 mm"}, "--radius: "), ({"radius": "-1 mm"}, "--radius: "),
        ({"thicknesses": "1mm"}, "--thicknesses: '1mm' is not FROM:TO or FROM:TO:COUNT; write for example 1mm:6mm"),
        ({"thicknesses": "1mm:2mm:3:4"}, "--thicknesses: '1mm:2mm:3:4' is not FROM:TO"),
        ({"thicknesses": "1mm:2mm:x"}, "--thicknesses: '1mm:2mm:x' is not FROM:TO"),
        ({"thicknesses": "2mm:2mm"}, "--thicknesses: '2mm:2mm' must rise, within 0.01mm:100mm, in two steps or more"),
        ({"thicknesses": "2mm:3mm:1"}, "--thicknesses: '2mm:3mm:1' must rise"),
        ({"thicknesses": "0.0099mm:3mm"}, "--thicknesses: '0.0099mm' must lie within 0.01mm:100mm"),
        ({"thicknesses": "1mm:101mm"}, "--thicknesses: '101mm' must lie within 0.01mm:100mm"),
    ],
)  # fmt: skip
def test_limits_beyond_the_borders_are_refused(options, words):
    with pytest.raises(InputError) as error:
        read_limits(WTS, **options)
    assert str(error.value).startswith(words)


def test_limits_at_the_borders_are_read_and_all_faults_are_named():
    far = read_limits(WTS, load="10 kN", radius="68 mm", two="68 mm", noise="10 kN")
    assert (far["load"], far["radius"], far["separation"], far["noise"]) == pytest.approx((1e4, 68e-3, 68e-3, 1e4))
    with pytest.raises(InputError) as error:
        read_limits(WTS, load="x", noise="x", two="x")
    assert [each.split(":")[0] for each in error.value.faults] == ["--load", "--noise", "--two"]


@pytest.mark.parametrize(
    "verb", [lambda **given: limits(NAME, **given), lambda **given: locate(NAME, [0] * 84, **given)]
)
def test_pictures_are_png_or_svg_and_replace_no_file(asked, tmp_path, verb):
    with pytest.raises(InputError, match=r"map.pdf is neither .png nor .svg; write for example --picture map.png"):
        verb(picture=tmp_path / "map.pdf")
    (tmp_path / "map.png").write_text("")
    with pytest.raises(InputError, match="--picture: "):
        verb(picture=str(tmp_path / "map.png"))
    assert asked == []


def test_frames_and_options_of_locate(asked, tmp_path):
    frames = np.arange(84.0) / 100
    locate(
        NAME, frames, touches=4, radius="1mm:2.5mm", noise="2 mN", forces=True, out=tmp_path / "t.csv",
        picture=tmp_path / "p.png", progress=print,
    )  # fmt: skip
    (_, (sensor, read), options), written, drawn = asked
    assert sensor == WTS
    assert options == {
        "count": 4, "noise": pytest.approx(2e-3), "radii": (pytest.approx(1e-3), pytest.approx(2.5e-3)),
        "progress": print,
    }  # fmt: skip
    assert written == ("write", Path(tmp_path / "t.csv"))
    assert drawn[0] == "draw_touches"
    assert drawn[1][1:] == (WTS.array, read, tmp_path / "p.png")
    asked.clear()
    locate(NAME, [0] * 84, touches=1, radius="0 mm")
    ((_, _, options),) = asked
    assert options == {"count": 1, "noise": None, "radii": (0.0, 0.0), "progress": None}
    asked.clear()
    locate(NAME, [0] * 84, radius="68 mm")
    locate(NAME, [0] * 84)
    assert [options["radii"] for _, _, options in asked] == [(0.068, 0.068), None]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"touches": 0}, "--touches: accepted: 1..4, not 0"), ({"touches": 5}, "--touches: accepted: 1..4, not 5"),
        ({"radius": "2mm:1mm"}, "--radius: '2mm:1mm' must not fall; write for example 0mm:2mm"),
        ({"radius": "0mm:68.1mm"}, "--radius: "), ({"noise": "0 N"}, "--noise: "),
    ],
)  # fmt: skip
def test_locate_refuses_what_is_beyond_its_borders(asked, options, words):
    with pytest.raises(InputError) as error:
        locate(NAME, [0] * 84, **options)
    assert str(error.value).startswith(words)
    assert asked == []


def test_options_of_designs_are_read_in_si_units(asked):
    found = design(
        NAME, thickness="1mm:2mm:3", hardness="30A:50A:5", tolerance=2.5, pitch="2mm:3mm:2", load="2 N",
        noise="4 mN", radius="0.5 mm", progress=print,
    )  # fmt: skip
    assert found == "designs"
    ((_, given, options),) = asked
    assert given == (WTS,)
    assert options == {
        "cover": WTS.cover, "load": 2.0, "noise": pytest.approx(4e-3), "radius": pytest.approx(5e-4), "ball": None,
        "thicknesses": (1e-3, 1.5e-3, 2e-3), "pitches": (2e-3, 3e-3), "hardnesses": (30.0, 35.0, 40.0, 45.0, 50.0),
        "scale": options["scale"], "tolerance": 2.5, "progress": print,
    }  # fmt: skip
    assert options["scale"]
    asked.clear()
    design(NAME, ball="6 mm", thickness="2mm")
    ((_, _, options),) = asked
    assert (options["radius"], options["ball"], options["thicknesses"]) == (None, pytest.approx(6e-3), (2e-3,))
    assert (options["pitches"], options["hardnesses"], options["scale"]) == ((WTS.array.pitch[0],), (), "")
    assert (options["tolerance"], options["noise"], options["load"]) == (None, None, 1.0)
    asked.clear()
    design(NAME, hardness="40A")
    assert (asked[0][2]["tolerance"], asked[0][2]["hardnesses"], asked[0][2]["radius"]) == (5.0, (40.0,), 0.0)
    assert len(asked[0][2]["thicknesses"]) == 11


def test_a_page_of_designs_is_written_into_its_folder(asked, tmp_path):
    design(NAME, thickness="2mm", out=tmp_path / "out")
    assert [each[0] for each in asked] == ["find_designs", "write_designs"]
    assert asked[1][1][0] == "designs"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"radius": "1mm", "ball": "5mm"}, "--radius, --ball: the radius of the touch follows from the ball"),
        ({"tolerance": 3.0}, "--tolerance: is that of --hardness, and not negative; 3 is given"),
        ({"tolerance": -0.5, "hardness": "40A"}, "--tolerance: is that of --hardness, and not negative; -0.5 is given"),
        ({"tolerance": float("inf"), "hardness": "40A"}, "--tolerance: "),
        ({"hardness": "40A:30D"}, "--hardness: "),
        ({"hardness": "75.1A"}, "--hardness: '75.1A' with its tolerance of 5 leaves 20..80 Shore A"),
        ({"ball": "68.1mm"}, "--ball: "), ({"load": "10.1 kN"}, "--load: "), ({"pitch": "0.001mm"}, "--pitch: "),
        ({"thickness": "1mm:2mm:5001"},
         "--thickness, --hardness, --pitch: 5001 x 1 x 1 = 5001 designs would take about 4 min; at most 5000 are"),
        ({"thickness": "1mm:2mm:100", "pitch": "2mm:3mm:51"}, "--thickness, --hardness, --pitch: 100 x 1 x 51 = 5100"),
    ],
)  # fmt: skip
def test_designs_beyond_the_borders_are_refused(asked, options, words):
    with pytest.raises(InputError) as error:
        design(NAME, **options)
    assert str(error.value).startswith(words)
    assert asked == []


def test_five_thousand_designs_and_tolerances_up_to_the_ends_of_the_scale_are_accepted(asked):
    design(NAME, thickness="1mm:2mm:100", pitch="2mm:3mm:50")
    design(NAME, hardness="40A", tolerance=0.0)
    assert len(asked[0][2]["thicknesses"]) * len(asked[0][2]["pitches"]) == 5000
    assert asked[1][2]["tolerance"] == 0.0
    design(NAME, hardness="25A:75A:2", radius="68 mm")
    assert (asked[2][2]["hardnesses"], asked[2][2]["radius"]) == ((25.0, 75.0), 0.068)
