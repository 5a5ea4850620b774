"""Options of an export, and the element for Gazebo, by tables."""

import dataclasses
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fastmodel import Butterworth, Electronics, Gaussian, Parameters, load
from fastmodel.adapters.gazebo import write_block
from fastmodel.adapters.rigid_models import RigidBox, compute_angles, compute_inertia, write_sdf, write_urdf
from meshes import TexelArray
from validation.errors import InputError
from validation.simulator_models import FORMATS, check_gazebo, make_mjcf, read_options, write_model


@pytest.mark.parametrize(
    ("form", "method", "mass", "kilograms"),
    [
        ("mjcf", "default", None, None), ("mjcf", "boxes", None, None), ("gazebo", "default", None, None),
        ("urdf", "cover", "20 g", 0.02), ("sdf", "foundation", "0.3 kg", 0.3), ("sdf", "default", None, None),
    ],
)  # fmt: skip
def test_a_mass_is_read_in_its_unit(form, method, mass, kilograms):
    assert read_options(form, method, mass) == (kilograms if mass is None else pytest.approx(kilograms), None)


@pytest.mark.parametrize(
    ("load", "newtons"), [("1N:5N", (1.0, 5.0)), ("200 mN:0.03 kN", (0.2, 30.0)), ("0.5N:2000mN", (0.5, 2.0))]
)
def test_a_range_of_loads_is_read_in_its_units(load, newtons):
    mass, loads = read_options("drake", "default", None, load)
    assert mass is None
    assert loads == pytest.approx(newtons)


@pytest.mark.parametrize(
    ("form", "load", "word"),
    [
        ("mjcf", "1N:5N", "--load: mjcf holds no scored value"), ("drake", "5N", "--load: '5N' is no range from:to"),
        ("newton", "5N:1N", "--load: must be positive, the smaller load first"),
        ("genesis", "0N:1N", "--load: must be positive"), ("drake", "1mm:5N", "--load"), ("isaac", "1N:", "--load"),
    ],
)  # fmt: skip
def test_a_wrong_range_of_loads_is_refused(form, load, word):
    with pytest.raises(InputError) as caught:
        read_options(form, "default", None, load)
    assert caught.value.faults[0].startswith(word)


@pytest.mark.parametrize(
    ("form", "method", "mass", "words"),
    [
        ("obj", "default", None, ["--format"]), ("mjcf", "magic", None, ["--method"]),
        ("gazebo", "boxes", None, ["--method: the Gazebo plugin block has one method of its own"]),
        ("mjcf", "default", "20 g", ["--mass: mjcf holds massless boxes"]),
        ("gazebo", "default", "20 g", ["--mass: gazebo holds massless boxes"]),
        ("urdf", "default", "0 g", ["--mass: must be positive"]), ("sdf", "default", "-1 g", ["--mass"]),
        ("obj", "magic", "-1 g", ["--format", "--method", "--mass"]),
    ],
)  # fmt: skip
def test_each_wrong_option_has_a_line(form, method, mass, words):
    with pytest.raises(InputError) as caught:
        read_options(form, method, mass)
    assert len(caught.value.faults) == len(words)
    for line, word in zip(caught.value.faults, words, strict=True):
        assert line.startswith(word)


def test_the_element_for_gazebo_holds_forces_and_counts_worked_out_by_hand():
    """Counts 200 F / 0.8 - 10 - 30 leave zero at 0.16 N and reach 1000 at 4.16 N of the force on a texel."""
    electronics = Electronics(
        rate_hz=77.0, sensitivity=200.0, offset=-10.0, threshold=30.0, output_max=1000, tip_share=0.8,
        calibrated="through the cover, tip 2 mm",
    )  # fmt: skip
    given = Parameters(
        array=TexelArray.grid(4, 7, (2e-3, 5e-3)), electronics=electronics, filter=Butterworth(cutoff_hz=12.0, order=2),
        spread=Gaussian(sigma_x=0.6, sigma_y=0.9, ksize_x=5, ksize_y=7),
    )  # fmt: skip
    expected = {
        "rows": 4, "columns": 7, "rangeMin": 0.16, "rangeMax": 4.16, "satMin": 0, "satMax": 1000, "tactile_rate": 77,
        "liniaritySensibility": 250, "liniarityOfset": -40, "cutFrequency": 12, "orderFilter": 2, "sigmax": 0.6,
        "sigmay": 0.9, "ksizex": 5, "ksizey": 7,
    }  # fmt: skip
    root = ET.fromstring(write_block(given))  # noqa: S314 -- ours
    assert {name: float(root.findtext(name)) for name in expected} == pytest.approx(expected)
    assert root.get("calibrated") is None
    above = dataclasses.replace(given, electronics=dataclasses.replace(electronics, offset=50.0), filter=None)
    root = ET.fromstring(write_block(above))  # noqa: S314 -- ours
    found = [float(root.findtext(name)) for name in ("rangeMin", "rangeMax", "cutFrequency", "orderFilter")]
    assert found == pytest.approx([0, 980 / 250, 0, 0])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"electronics": {"high_pass_hz": 1.0}}, "no high-pass may be given"),
        ({"electronics": {"characteristic": (0.0, 1.0, 0.0, 0.0, 0.0, 0.0)}}, "must be a straight line"),
        ({"array": TexelArray.grid(14, 6, 3.4e-3, active=np.arange(84) != 3)}, "no texel may be masked"),
    ],
)
def test_a_sensor_that_gazebo_cannot_hold_is_refused_before_anything_is_derived(changes, words):
    given = load("wts-0614-34")
    electronics = dataclasses.replace(given.electronics, **changes.get("electronics", {}))
    array = changes.get("array", given.array)
    check_gazebo(given)
    with pytest.raises(InputError, match=words):
        check_gazebo(dataclasses.replace(given, electronics=electronics, array=array, surface=None, tables={}))


def make_box(name="a", position=(0.0, 0.0, 0.0), angles=(0.0, 0.0, 0.0), size=(1.0, 1.0, 1.0)):
    turn = Rotation.from_euler("xyz", angles, degrees=True)
    return RigidBox(
        name=name, position=np.array(position), orientation=turn, size=np.array(size), colour=np.array([1, 0, 0, 1.0])
    )


@pytest.mark.parametrize(
    ("boxes", "mass", "centre", "inertia"),
    [
        # one box of 2 x 3 x 6 m: m / 12 (b^2 + c^2)
        ([make_box(position=(1, 2, 3), size=(2, 3, 6))], 12.0, (1, 2, 3), np.diag([45, 40, 13])),
        # a quarter turn about x exchanges y and z
        ([make_box(angles=(90, 0, 0), size=(2, 3, 6))], 12.0, (0, 0, 0), np.diag([45, 13, 40])),
        # an eighth turn about z: half of the difference of 40 and 45 appears as product of inertia
        ([make_box(angles=(0, 0, 45), size=(2, 3, 6))], 12.0, (0, 0, 0), [[42.5, 2.5, 0], [2.5, 42.5, 0], [0, 0, 13]]),
        # a dumbbell of masses 1 and 3 at (0, 0, 0) and (4, 0, 0): reduced mass 3/4 times 16 across its axis
        ([make_box(size=(1, 1, 1)), make_box("b", position=(4, 0, 0), size=(1, 1, 3))], 4.0, (3, 0, 0),
         np.diag([1 / 6 + 30 / 12, 1 / 6 + 30 / 12 + 12, 1 / 6 + 0.5 + 12])),
        # two unit masses at +-(1, 2, 0): the product of inertia is -2 x y
        ([make_box(position=(1, 2, 0)), make_box("b", position=(-1, -2, 0))], 2.0, (0, 0, 0),
         [[1 / 3 + 8, -4, 0], [-4, 1 / 3 + 2, 0], [0, 0, 1 / 3 + 10]]),
    ],
)  # fmt: skip
def test_the_inertia_of_boxes_is_that_of_textbooks(boxes, mass, centre, inertia):
    found = compute_inertia(boxes, mass)
    np.testing.assert_allclose(found[0], centre, atol=1e-12)
    np.testing.assert_allclose(found[1], inertia, atol=1e-12)


@pytest.mark.parametrize("angles", [(20, 0, 0), (0, 30, 0), (0, 0, -40), (20, 30, -40), (-170, 60, 10)])
def test_the_angles_of_a_box_are_roll_pitch_and_yaw_in_both_formats(angles):
    """R = Rz(yaw) Ry(pitch) Rx(roll), as both formats define it."""
    roll, pitch, yaw = np.radians(angles)
    x = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]])
    y = np.array([[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]])
    z = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    matrix = z @ y @ x
    box = dataclasses.replace(
        make_box(position=(0.1, 0.2, 0.3), size=(0.4, 0.5, 0.6)), orientation=Rotation.from_matrix(matrix)
    )
    np.testing.assert_allclose(compute_angles(box), [roll, pitch, yaw], atol=1e-12)
    urdf, sdf = ET.fromstring(write_urdf([box], name="a")), ET.fromstring(write_sdf([box], name="a", rate_hz=9.5))  # noqa: S314
    expected = [0.1, 0.2, 0.3, roll, pitch, yaw]
    for kind in ("collision", "visual"):
        origin = urdf.find(f"link/{kind}/origin")
        words = f"{origin.get('xyz')} {origin.get('rpy')}".split()
        np.testing.assert_allclose([float(word) for word in words], expected, rtol=1e-9)
        assert urdf.find(f"link/{kind}/geometry/box").get("size") == "0.4 0.5 0.6"
        words = sdf.findtext(f"model/link/{kind}/pose").split()
        np.testing.assert_allclose([float(word) for word in words], expected, rtol=1e-9)
        assert sdf.findtext(f"model/link/{kind}/geometry/box/size") == "0.4 0.5 0.6"
    assert sdf.findtext("model/link/sensor/update_rate") == "9.5"
    assert urdf.find("link/inertial") is None
    assert sdf.find("model/link/inertial") is None


@pytest.mark.parametrize(
    ("form", "method"), [("mjcf", "default"), ("sdf", "boxes"), ("urdf", "cover"), ("gazebo", "default")]
)
def test_a_model_is_written_beside_its_parameters(form, method, tmp_path):
    given = load("wts-0614-34")
    path = tmp_path / f"pad{FORMATS[form]}"
    used = write_model(given, path, form=form, method=method, mass=0.05 if form in {"sdf", "urdf"} else None)
    assert used == {"gazebo": None, "mjcf": "cover"}.get(form, method)
    assert {each.name for each in tmp_path.iterdir()} == {path.name, "parameters.toml", "cover.npz"}
    root = ET.fromstring(path.read_text())  # noqa: S314 -- ours
    assert root.tag == {"mjcf": "mujoco", "sdf": "sdf", "urdf": "robot", "gazebo": "plugin"}[form]
    if form == "sdf":
        assert root.findtext("model/link/inertial/mass") == "0.05"
        assert root.findtext("model/link/sensor/update_rate") == "271"
        assert len(root.findall("model/link/collision")) == 84
    if form == "urdf":
        assert (root.find("link/inertial/mass").get("value"), len(root.findall("link/collision"))) == ("0.05", 1)
        assert root.get("name") == root.find("link").get("name") == "pad"
    if form == "mjcf":
        model = mujoco.MjModel.from_xml_path(str(path))
        assert model.body("pad").id == 1
        # the plate extends one pitch of 3.4 mm beyond 6 x 14 texels on each side
        np.testing.assert_allclose(2 * model.geom_size[0, :2], [8 * 3.4e-3, 16 * 3.4e-3], rtol=1e-5)


@pytest.mark.parametrize(("method", "count"), [("boxes", 84), ("foundation", 1), ("cover", 1)])
def test_an_mjcf_model_has_the_boxes_of_its_method(method, count):
    text = make_mjcf(load("wts-0614-34"), name="my-pad", method=method)
    model = mujoco.MjModel.from_xml_string(text)
    assert (model.ngeom, model.body("my-pad").id) == (count, 1)
    assert ET.fromstring(text).get("model") == "my-pad"  # noqa: S314 -- ours
    assert all(model.geom(k).name.startswith("my-pad") for k in range(count))
