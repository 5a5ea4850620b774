"""Models, references and classes of cases on a half space and on made-up solutions, by hand."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from fastmodel.contact.points import press_points
from fastmodel.fitting.gaussian import SurfaceGaussian
from fem_reference.errors import PiercedError, UnsupportedError
from fem_reference.result_store import NotStoredError
from fem_reference.small_strain_contact.several_indenters import SeveralIndentations
from meshes import Box, Pose, Sphere
from tests.support.cover_data import WTS, dome_parameters, make_dome, parameters
from tests.support.rubber import make_cover
from validation.campaign.bench import LayeredBench, prepare_bench
from validation.campaign.campaign_file import Inputs
from validation.campaign.case import Case
from validation.campaign.plan import measure_pace
from validation.campaign.reference_press import find_stored_reference, name_unsupported, press_reference
from validation.campaign.results import CaseResult, Reference
from validation.campaign.solid_bench import CURVED_MODELS, SolidBench, measure_obliquity
from validation.derivation.solid import SolidDerivation
from validation.errors import InputError

DOME = make_dome(thickness=8e-3)
GAUSSIAN = SurfaceGaussian(sigma=(1.1e-3, 1.7e-3), residual=0.0)
TILTED = Pose(point=(0.7e-3, 0.4e-3, 10e-3), direction=(math.sin(0.2), 0.0, -math.cos(0.2)), yaw=0.3)
DOME_CASE = Case(name="ball", indenter=Sphere(radius=12e-3), shape="sphere:radius=12mm", load=0.4, pose=TILTED)


@pytest.fixture
def solid(small_pad):
    """The dome of a half space, with the cover of a small pad for what needs its material."""
    sensor = dataclasses.replace(small_pad, friction=0.3)
    grids = tuple(SimpleNamespace(mesh=mesh) for mesh in ("coarse", "fine"))
    derivation = SimpleNamespace(sensor=sensor, gaussian=GAUSSIAN, responses=SimpleNamespace(grids=grids))
    return SolidBench(cover=sensor.cover, parameters=dome_parameters(DOME), friction=0.3, derivation=derivation)


def test_a_round_cover_is_scored_by_five_models(solid):
    found = solid.compute_models(DOME_CASE)
    assert list(found.models) == list(CURVED_MODELS)
    assert {outside for _, outside in found.models.values()} == {0.0}
    forces = {name: each for name, (each, _) in found.models.items()}
    press, array = press_points(DOME, DOME_CASE.indenter, TILTED, load=0.4), solid.parameters.array
    assert forces["fast"] == pytest.approx(press.texel_forces)
    spread = GAUSSIAN.spread(array, press.pressure.place, press.pressure.normal)
    assert forces["gaussian"] == pytest.approx(press.pressure.forces @ spread)
    assert forces["zeros"] == pytest.approx(np.zeros(4))
    # A rigid ball meets the points whose distance along the motion is least, within a hundredth of the thickness.
    towards = np.array(TILTED.direction)
    to_axis = DOME.points - TILTED.position
    aside = np.linalg.norm(to_axis - np.outer(to_axis @ towards, towards), axis=1)
    way = to_axis @ towards - np.sqrt(144e-6 - aside**2)
    first = way <= way.min() + 80e-6
    assert 1 < first.sum() < 20
    share = 0.4 / (-DOME.normals[first] @ towards).sum()
    onto = GAUSSIAN.spread(array, DOME.points[first], DOME.normals[first]).sum(axis=0)
    assert forces["rigid"] == pytest.approx(share * onto)
    near = np.argmin([np.linalg.norm(DOME.points[first] - each, axis=1) for each in array.centres], axis=0)
    assert forces["no-spread"] == pytest.approx(share * np.bincount(near, minlength=4))
    active = np.bincount(near, minlength=4) == 0
    off = dataclasses.replace(
        solid, parameters=dataclasses.replace(solid.parameters, array=dataclasses.replace(array, active=active))
    )
    assert off.compute_models(DOME_CASE).models["no-spread"][0].sum() == 0


def test_uncertain_inputs_of_a_round_cover_are_propagated_by_their_two_changes(solid):
    """A cover of modulus c E under the load F has c times the forces of one of modulus E under F / c."""
    box = dataclasses.replace(DOME_CASE, indenter=Box(size=(3e-3, 2e-3, 4e-3)))
    inputs = Inputs(modulus=0.2, position=1.5e-4, yaw=0.07)
    found = solid.propagate(box, inputs)
    assert found.uncertainties == {
        "modulus [relative]": 0.2, "position x [m]": 1.5e-4, "position y [m]": 1.5e-4, "yaw [rad]": 0.07,
    }  # fmt: skip

    def press(load=0.4, at=(0.0, 0.0, 0.0), turn=0.0):
        pose = dataclasses.replace(TILTED, point=tuple((TILTED.position + at).tolist()), yaw=TILTED.yaw + turn)
        return press_points(DOME, box.indenter, pose, load=load).texel_forces

    along, across, _ = TILTED.rotation.T
    assert abs(along @ TILTED.towards) < 1e-9
    high, low = (math.exp(each) * press(load=0.4 / math.exp(each)) for each in (0.2, -0.2))
    expected = {
        "modulus [relative]": high - low, "position x [m]": press(at=1.5e-4 * along) - press(at=-1.5e-4 * along),
        "position y [m]": press(at=1.5e-4 * across) - press(at=-1.5e-4 * across),
        "yaw [rad]": press(turn=0.07) - press(turn=-0.07),
    }  # fmt: skip
    for name, each in expected.items():
        assert found.effects[name] == pytest.approx(each / 2, abs=1e-12), name
    assert (found.load, found.image) == (0.4, pytest.approx(press()))
    assert found.note == "thickness, Poisson ratio and friction are not propagated on solid covers"
    assert list(solid.propagate(box, dataclasses.replace(inputs, modulus=0.0, yaw=0.0)).effects) == [
        "position x [m]", "position y [m]",
    ]  # fmt: skip


def make_result(case, *, depth=1e-4, mesh=None, outside=0.0):
    reference = Reference(
        texel_forces=np.ones(4), total_force=case.load, depth=depth, contact_area=3e-6, error_estimate={},
        assumptions={}, warnings=(), found=SimpleNamespace(mesh=mesh), outside=outside,
    )  # fmt: skip
    return CaseResult(case=case, reference=reference, warnings=(), predictions={})


@pytest.mark.parametrize(
    ("degrees", "word"), [(0.0, "along the normal"), (9.99, "along the normal"), (10.01, "oblique")]
)
@pytest.mark.parametrize(
    ("depth", "deep"), [(0.08, "up to 8 % of the thickness"), (0.0801, "above 8 % of the thickness")]
)
def test_classes_of_a_case_on_a_solid_cover(solid, degrees, word, depth, deep):
    turn = math.radians(degrees)
    pose = dataclasses.replace(TILTED, direction=(0.0, -math.sin(turn), -math.cos(turn)))
    result = make_result(
        dataclasses.replace(DOME_CASE, pose=pose), depth=depth * solid.cover.thickness, mesh=solid.cover.meshes()[0]
    )
    assert solid.classify(result) == {"shape": "sphere", "direction": word, "depth": deep}
    assert measure_obliquity(result) == pytest.approx(turn, abs=1e-7)
    assert solid.measure(result) == pytest.approx({
        "load_N": 0.4, "depth_over_thickness": depth, "contact_area_m2": 3e-6, "obliquity_rad": turn,
    }, abs=1e-7)  # fmt: skip


def test_a_solid_cover_is_verified_on_a_shell_and_on_a_finer_mesh(solid, monkeypatch):
    asked = []
    for name in ("check_shell", "check_finer_mesh"):
        monkeypatch.setattr(f"validation.campaign.solid_bench.{name}", lambda *given: asked.append(given) or [])
    results = [make_result(DOME_CASE)]
    shell, finer = solid.verify(results)
    assert (shell.name, finer.name) == ("verification of the elements on a shell", "verification on a finer mesh")
    assert (shell.seconds, finer.seconds) == (0.0, pytest.approx(180.0 * measure_pace()))
    shell.check()
    finer.check()
    assert asked[0] == (solid.cover.layers[0].material, solid.cover.thickness)
    assert asked[1] == (solid.cover, solid.parameters.array, ("coarse", "fine"), results, 0.3)


def test_a_cover_without_its_points_has_no_fast_model(solid):
    bare = dataclasses.replace(solid, parameters=parameters(surface=None))
    with pytest.raises(InputError, match=r"^built-in flat-pad: the meshes of this cover are too fine"):
        bare.require_fast_model()


def test_a_bench_of_given_parameters_keeps_sensor_and_friction(small_pad):
    sensor, told = dataclasses.replace(small_pad, friction=0.3), []
    derivation = SolidDerivation(sensor=sensor, responses=None, seconds=0.0)
    given = dome_parameters(DOME)
    bench = prepare_bench(derivation, (), told.append, parameters=given)
    assert (bench.cover, bench.parameters, bench.friction, bench.derivation) == (sensor.cover, given, 0.3, derivation)
    assert told == ["fast model, compliance of the surface"]
    cover = make_cover(0.49)
    layered = prepare_bench(
        SimpleNamespace(sensor=SimpleNamespace(layered_cover=cover, friction=0.2)), (), parameters=parameters()
    )
    assert isinstance(layered, LayeredBench)
    assert (layered.cover, layered.friction, layered.comparison) == (cover, 0.2, None)


LINEAR = make_cover(0.45, "linear-elastic")
FIRST = Case.read("a", "box:size=6mmx6mmx8mm", "1 N", at="0mm,-12mm")
SECOND = Case.read("b", "sphere:radius=3mm", "0.5 N", at="1mm,12mm", yaw="10deg")
BOTH = dataclasses.replace(FIRST, load=1.5, others=(SECOND,))


def make_scene(case, factor):
    boxes = SimpleNamespace(
        contact_forces=np.full(84, factor), texel_forces=np.arange(84.0) * factor, outside=0.1 * factor
    )
    return SimpleNamespace(boxes=boxes), {"cone": (np.full(84, 2 * factor), 0.3 * factor)}


def test_forces_of_bodies_add_up_where_models_see_one_at_a_time(monkeypatch):
    asked = []
    active = WTS.active.copy()
    active[5] = False
    given = parameters(array=dataclasses.replace(WTS, active=active))

    def press(_parameters, placements, *, contact):
        asked.append(([(each.load, each.at, each.yaw) for each in placements], contact))
        value = {"default": 3.0, "foundation": 4.0}[contact]
        return SimpleNamespace(texel_forces=np.full(84, value), outside=0.1 * value, warnings=(contact,))

    monkeypatch.setattr("fastmodel.indent_together", press)
    comparison = SimpleNamespace(
        predict=lambda _cover, _parameters, case: make_scene(case, {1.0: 0.01, 0.5: 0.002}[case.load])
    )
    found = LayeredBench(cover=LINEAR, parameters=given, comparison=comparison).compute_models(BOTH)
    assert asked[0] == ([(1.0, (0.0, -12e-3), 0.0), (0.5, (1e-3, 12e-3), pytest.approx(math.radians(10)))], "default")
    assert asked[1][1] == "foundation"
    values = {name: (forces[7], outside) for name, (forces, outside) in found.models.items()}
    assert values["fast"] == (3.0, pytest.approx(0.3))
    assert values["foundation"] == (4.0, pytest.approx(0.4))
    assert values["boxes"] == pytest.approx((7 * 0.012, 0.0012))
    assert values["no-spread"] == pytest.approx((0.012, 1.5 - 83 * 0.012))
    assert found.models["no-spread"][0][5] == 0
    assert values["zeros"] == (0.0, 0.0)
    assert found.published["cone"] == (pytest.approx(np.full(84, 0.024)), pytest.approx(0.0036))
    assert found.warnings == ("default",)


def test_a_cover_with_sides_is_verified_and_propagated_as_a_wide_one(monkeypatch):
    asked = []
    monkeypatch.setattr(
        "validation.credibility.verification.verify_code", lambda cover, array: asked.append(cover) or [array]
    )
    Found = dataclasses.make_dataclass("Found", ["note"])
    monkeypatch.setattr(
        "validation.credibility.uncertainty.propagate_inputs",
        lambda cover, _array, _case, _inputs: asked.append(cover) or Found("a note"),
    )
    for size, note in (((40e-3, 30e-3), "a note; on a wide cover of these layers"), (None, "a note")):
        bench = LayeredBench(cover=make_cover(0.45, size=size), parameters=parameters())
        (check,) = bench.verify(())
        assert (check.name, check.check(), check.seconds) == ("code verification", [WTS], 0.0)
        assert bench.propagate(FIRST, Inputs()).note == note
        assert [cover.size for cover in asked] == [None, None]
        asked.clear()


def make_together(**changes):
    forces = np.zeros(84)
    forces[[3, 70]] = 0.9, 0.4
    values = {
        "texel_forces": forces, "texel_errors": 0.1 * forces, "outside": 0.17, "outside_error": 0.02,
        "depths": np.array([0.3e-3, 0.7e-3]), "slopes": np.zeros((2, 2)),
        "contact": np.array([[1e-3, -12e-3, 0.6], [-2e-3, -11e-3, 0.4], [1.5e-3, 12e-3, 0.5]]), "contact_area": 4e-5,
        "error_estimate": {"misplaced": 0.01, "peak_texel": 0.02, "depth": 0.03, "contact_area": 0.07},
    }  # fmt: skip
    return SeveralIndentations(**(values | changes))


@pytest.fixture
def together(monkeypatch, tmp_path):
    """Several bodies are not solved: the result is what the test puts into the list."""
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path))
    results, asked = [make_together()], []

    def press(_cover, _array, bodies):
        asked.extend((each.load, each.at, each.yaw) for each in bodies)
        return results[-1]

    monkeypatch.setattr("fem_reference.small_strain_contact.several_indenters.press_together", press)
    return results, asked


def test_the_reference_of_several_bodies_has_their_common_force_and_moment(together):
    found = press_reference(LINEAR, WTS, BOTH)
    assert together[1] == [(1.0, (0.0, -12e-3), 0.0), (0.5, (1e-3, 12e-3), pytest.approx(math.radians(10)))]
    assert found.force.tolist() == found.base_force.tolist() == [0.0, 0.0, -1.5]
    # r x F with F along -z: (-y f, x f, 0)
    assert found.moment == pytest.approx((12e-3 * 0.6 + 11e-3 * 0.4 - 12e-3 * 0.5, 0.6e-3 - 0.8e-3 + 0.75e-3, 0.0))
    assert found.unmeasured == pytest.approx((0.0, 0.0, 1.3 - 1.5))
    assert found.balance == pytest.approx((1.3 + 0.17) / 1.5 - 1)
    assert (found.total_force, found.depth, found.contact_area) == (1.5, 0.7e-3, 4e-5)
    assert found.contact_points[:, 2] == pytest.approx(np.full(3, 2e-3))
    assert found.contact_forces == pytest.approx(np.array([[0, 0, -0.6], [0, 0, -0.4], [0, 0, -0.5]]))
    assert found.error_estimate == {"total_force": 0.0, "depth": 0.03, "peak_texel": 0.02, "contact_area": 0.07}
    assert found.warnings == ("large estimated error: contact area 7%",)
    assert (found.outside, found.outside_error) == (0.17, 0.02)
    assert found.texel_errors[70] == pytest.approx(0.04)
    assert found.assumptions["range"].startswith("indented to 35% of the thickness")
    assert 0 <= found.seconds < 5


@pytest.mark.parametrize(
    ("depths", "error", "words"),
    [
        ((0.3e-3, 2e-3), PiercedError, r"^the body of 0.5 N at \(1, 12\) mm, 10° would pierce .*2 mm deep, .* 2 mm\)"),
        ((2.1e-3, 3e-3), PiercedError, r"^the body of 1 N at \(0, -12\) mm, 0° would pierce .*2.1 mm deep"),
        ((-0.2e-3, 3e-3), ValueError, r"^the body of 1 N at \(0, -12\) mm, 0° is lifted by 0.2 mm"),
        ((0.3e-3, 0.0), ValueError, r"^the body of 0.5 N .* is lifted"),
    ],
)
def test_the_shallowest_body_that_is_lifted_or_pierces_is_named(together, depths, error, words):
    together[0].append(make_together(depths=np.array(depths)))
    with pytest.raises(error, match=words):
        press_reference(LINEAR, WTS, BOTH)


@pytest.mark.parametrize(
    ("cover", "friction"),
    [(make_cover(0.45), 0.0), (make_cover(0.45, "linear-elastic", size=(40e-3, 30e-3)), 0.0), (LINEAR, 0.1)],
)
def test_several_bodies_need_a_wide_linear_cover_without_friction(cover, friction):
    with pytest.raises(ValueError, match="without friction; split them"):
        press_reference(cover, WTS, BOTH, friction=friction)


def test_a_load_of_a_path_is_taken_from_the_whole_path(monkeypatch):
    asked = []

    def press(cover, array, indenter, **options):
        asked.append(options | {"given": (cover, array, indenter)})
        return [f"{load} N" for load in options["loads"]]

    monkeypatch.setattr("fem_reference.indentation.press.press_path", press)
    case = dataclasses.replace(FIRST, load=2.0, path=(1.0, 2.0, 3.0))
    assert press_reference(LINEAR, WTS, case, friction=0.4, progress=print) == "2.0 N"
    assert press_reference(LINEAR, WTS, FIRST) == "1.0 N"
    first, second = asked
    assert first == {
        "given": (LINEAR, WTS, case.indenter), "loads": (1.0, 2.0, 3.0), "pose": case.pose, "friction": 0.4,
        "superposed": True, "as_far": False, "progress": print,
    }  # fmt: skip
    assert (second["loads"], second["friction"], second["progress"]) == ((1.0,), 0.0, None)


@pytest.mark.parametrize(
    ("argument", "others", "error", "words"),
    [
        ("friction", None, InputError, "--friction: not here"), ("friction", "--", InputError, "--friction: not here"),
        ("strain", "--", InputError, "--strain: not here"), ("strain", None, UnsupportedError, "not here"),
    ],
)  # fmt: skip
def test_what_a_solver_does_not_support_is_named_as_the_option(argument, others, error, words):
    with pytest.raises(error) as raised, name_unsupported("--friction", others):
        raise UnsupportedError("not here", argument)
    assert str(raised.value) == words


@pytest.mark.parametrize("error", [ValueError("no"), NotStoredError("no")])
def test_a_reference_that_is_refused_or_missing_is_not_stored(monkeypatch, error):
    def press(*_given, **options):
        assert options["friction"] == 0.7
        raise error

    monkeypatch.setattr("fem_reference.indentation.press.press_path", press)
    assert find_stored_reference(LINEAR, WTS, FIRST, friction=0.7) is None
    error = UnsupportedError("not here", "friction")
    with pytest.raises(InputError, match=r"^contact.friction: not here"):
        find_stored_reference(LINEAR, WTS, FIRST, friction=0.7)
