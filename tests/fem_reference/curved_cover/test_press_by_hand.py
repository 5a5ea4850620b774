"""Results of presses of solid covers, computed by hand from contacts that are given instead of solved."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from fem_reference.curved_cover import press as module
from fem_reference.curved_cover.facet_surface import FacetSurface
from fem_reference.curved_cover.local_contact import CellContact
from fem_reference.curved_cover.press import measure_balance, press_finite, press_rubbing, press_small
from fem_reference.curved_cover.responses import GridResponse, TexelResponses, find_top
from fem_reference.indentation.result import PressProblem
from meshes import Box, Layer, Sphere, TexelArray
from meshes.pose import Pose
from meshes.solids import flat_pad
from tests.support.rubber import make_rubber

PAD = flat_pad(size=(6e-3, 6e-3), rows=1, pitch=6e-3)
MESHES = tuple(PAD.mesh(6e-3, layers=layers) for layers in (2, 3, 4))
LAYERS = (Layer(thickness=2e-3, material=make_rubber(0.0, "linear-elastic")),)
TEXELS = TexelArray.grid(1, 3, 2e-3)
ABOVE = Pose.facing([0, 0, 9e-3], [0, 0, -1])
#: Forces on three texels over the load, on each mesh.
SHARES = np.array([[0.40, 0.35, 0.15], [0.46, 0.33, 0.12], [0.5, 0.3, 0.1]])


def spread(mesh, force):
    """Forces on the nodes of the top of a mesh that act as a uniform pressure on its upper side."""
    top = find_top(mesh)
    upper = FacetSurface.part_of(mesh.nodes, mesh.top[mesh.nodes[mesh.top][:, :, 2].min(axis=1) > 1.99e-3])
    out = np.zeros_like(top.nodes)
    out[np.searchsorted(top.index, upper.index)] = upper.integrate_pressure(np.full((1, len(upper.nodes)), 1 / 36e-6))[
        0
    ]
    return force * out


def touch(mesh, load, depth, *, area=5e-6, size=1.0, felt=1.0, lower=0.0, **changes):
    """A contact of a load at a depth; its nodal forces sum up to `felt` times the load, it ends `lower` higher."""
    plain = {"is_cut": False, "at_border": 0.0} | changes
    points, forces = np.array([[1e-3, 2e-3, 2e-3]]), np.array([[0, 0, -load]])
    return CellContact(
        points=points, forces=forces, nodal=spread(mesh, felt * load), load=load, travel=1e-3 - lower,
        touch=1e-3 - depth, area=area, size=size, **plain,
    )  # fmt: skip


@pytest.fixture
def give(monkeypatch):
    """Give contacts, and those with friction, for each mesh, and responses of texels that do not ask for the place."""

    def answer(contacts, rough, rubs=(), shares=SHARES, active=(True, True, True)):
        texels = dataclasses.replace(TEXELS, active=np.array(active))
        meshes = MESHES[-len(contacts) :]
        by_count = {len(mesh.cells): number for number, mesh in enumerate(meshes)}

        def respond(given, array, layers, **_):
            grids = []
            for mesh in given:
                each = shares[-len(contacts) :][by_count[len(mesh.cells)]]
                influence = each[:, None, None] * np.ones((len(find_top(mesh).nodes), 1)) * [0, 0, -1.0]
                grids.append(GridResponse(mesh=mesh, top=find_top(mesh), influence=influence))
            return TexelResponses(texels=array, layers=layers, grids=tuple(grids))

        class Given:
            def __init__(self, number):
                self.number = number

            @classmethod
            def begin(cls, solid, *_, cells, **__):
                asked.append(cells)
                return cls(by_count[len(solid.mesh.cells)])

            def solve(self, cells=None):
                return contacts[self.number] if cells is None else rough

            def rub(self, friction, grids):
                asked.append((friction, grids))
                return rubs[self.number]

        asked = []
        monkeypatch.setattr(module, "texel_responses", respond)
        monkeypatch.setattr(module, "CellPress", Given)
        return meshes, texels, asked

    return answer


def ask(texels, control="load", **options):
    return PressProblem(
        array=texels, indenter=Sphere(radius=3e-3), pose=ABOVE, targets=(2.0,), control=control, **options
    )


def three(**changes):
    """Contacts on three meshes: depths converge with the order log2(3), areas with the order 2."""
    return [
        touch(mesh, 2.0, depth, area=area, size=size, **changes)
        for mesh, depth, area, size in zip(
            MESHES, (100e-6, 130e-6, 140e-6), (8e-6, 6e-6, 5.5e-6), (4.0, 2.0, 1.0), strict=True
        )
    ]


ROUGH = touch(MESHES[-1], 1.98, 138e-6, felt=0.99, lower=2e-6)
#: Errors of three meshes: 1.25 times the last change, over 3 - 1 for depths; texels have at least the order 1.5.
DEPTH, PEAK = 1.25 * 10 / 2 / 140, 1.25 * 0.08 / (2**1.5 - 1)


@pytest.mark.usefixtures("full_cells")
def test_a_press_under_a_load_is_extrapolated_to_small_cells_and_states_its_errors(give):
    """Contacts on 144 and 96 cells differ by 1 % of the load and 2 um: twice that is added, and half of it unsure."""
    meshes, texels, asked = give(three(), ROUGH)
    found = press_small(meshes, LAYERS, ask(texels), 2.0)
    assert asked == [64, 96, 144]
    assert found.total_force == pytest.approx(2.04)
    assert found.depth == pytest.approx(144e-6)
    np.testing.assert_allclose(found.texel_forces, 2.04 * SHARES[-1])
    np.testing.assert_allclose(found.contact_forces, [[0, 0, -2.04]])
    np.testing.assert_allclose(found.force, [0, 0, -2.04], atol=1e-12)
    np.testing.assert_allclose(found.base_force, [0, 0, -2.04], atol=1e-9)
    np.testing.assert_allclose(found.unmeasured, [0, 0, -2.04 * 0.1], atol=1e-9)
    assert found.contact_area == 5.5e-6
    assert found.energy == pytest.approx(2.04**2 * 2e-3 / (2 * 1e6 * 36e-6))  # that of a bar
    assert found.balance == pytest.approx(0, abs=1e-9)
    assert found.error_estimate == pytest.approx(
        {
            "peak_texel": PEAK + 0.005 / 0.5,
            "depth": DEPTH + 4 / 140 / 2,
            "total_force": 0,
            "contact_area": DEPTH,  # more than that of the areas, 1.25 / 3 * 0.5 / 5.5
            "texel_sum": PEAK / 4,  # more than 0.5 %
            "misplaced_force": PEAK * 1.125 / 2 + 0.0045,
        }
    )
    each = PEAK * np.array([1, 0.75, 0.5]) + 0.02 * SHARES[-1]
    np.testing.assert_allclose(found.texel_errors, np.maximum(each, each.sum() / 0.9 * SHARES[-1]))
    assert found.assumptions["friction"] == "none"
    assert len(found.warnings) == 1
    assert "peak texel 6%, depth 6%" in found.warnings[0]


@pytest.mark.usefixtures("full_cells")
def test_a_press_to_a_depth_states_the_error_of_the_load(give):
    contacts = [dataclasses.replace(each, load=load) for each, load in zip(three(), (2.4, 2.1, 2.0), strict=True)]
    meshes, texels, _ = give(contacts, ROUGH, active=(True, True, False))
    found = press_small(meshes, LAYERS, ask(texels, "depth"), 140e-6)
    assert found.error_estimate["depth"] == 0
    assert found.error_estimate["total_force"] == pytest.approx(1.25 * 0.1 / 2 / 2 + 0.02 / 2)
    assert found.error_estimate["contact_area"] == pytest.approx(DEPTH)
    assert found.texel_forces[2] == found.texel_errors[2] == 0
    np.testing.assert_allclose(found.unmeasured, [0, 0, -2.04 * 0.2], atol=1e-9)


@pytest.mark.usefixtures("full_cells")
@pytest.mark.parametrize(("border", "depth", "peak"), [(0.1, 2 * DEPTH, 2 * PEAK), (0.9, 0.225, 0.225)])
def test_a_contact_at_a_border_is_twice_as_unsure(give, border, depth, peak):
    meshes, texels, _ = give(three(at_border=border), ROUGH)
    errors = press_small(meshes, LAYERS, ask(texels), 2.0).error_estimate
    assert errors["depth"] == pytest.approx(depth + 4 / 140 / 2)
    assert errors["peak_texel"] == pytest.approx(peak + 0.01)


@pytest.mark.usefixtures("full_cells")
def test_meshes_of_one_size_count_as_different_by_two_fifths(give):
    """Sizes of 1.96, 1.4 and 1: two depths give the order 1, and equal values the smallest errors that are stated."""
    contacts = [dataclasses.replace(each, size=1.0, area=5e-6) for each in three()]
    meshes, texels, _ = give(contacts[1:], contacts[-1], shares=SHARES[[2, 2]])
    errors = press_small(meshes, LAYERS, ask(texels), 2.0).error_estimate
    assert errors["depth"] == pytest.approx(1.25 * 10 / 0.4 / 140)
    assert errors["peak_texel"] == 3e-3
    assert errors["texel_sum"] == 5e-3
    assert errors["misplaced_force"] == pytest.approx(3e-3 * 0.5)
    same = [dataclasses.replace(each, travel=contacts[-1].travel, touch=contacts[-1].touch) for each in contacts]
    meshes, texels, asked = give(same[1:], same[-1], shares=SHARES[[2, 2]])
    errors = press_small(meshes, LAYERS, ask(texels), 2.0).error_estimate
    assert (errors["depth"], errors["contact_area"]) == (3e-3, 7e-3)
    assert asked == [96, 144]


@pytest.mark.usefixtures("full_cells")
@pytest.mark.parametrize(("depth", "large"), [(0.29e-3, False), (0.31e-3, True)])
def test_one_mesh_has_no_error_and_a_press_of_fifteen_percent_a_warning(give, depth, large):
    contact = touch(MESHES[-1], 2.0, depth, is_cut=large)
    meshes, texels, _ = give([contact], contact)
    found = press_small(meshes, LAYERS, ask(texels), 2.0)
    assert np.isnan([value for name, value in found.error_estimate.items() if name != "total_force"]).all()
    assert np.isnan(found.texel_errors).all()
    assert len(found.warnings) == 2 * large
    if large:
        assert "the depth is 15.5 % of the thickness" in found.warnings[0]
        assert "wraps around the cover" in found.warnings[1]


@pytest.mark.usefixtures("full_cells")
@pytest.mark.parametrize(("smooth", "share"), [(False, 0.25), (True, 0.05)])
def test_half_or_a_tenth_of_the_error_of_the_shape_counts_and_half_of_that_for_texels(give, smooth, share):
    """The shape is known to 0.05 mm, at a depth of 0.1 mm."""
    settings = {"geometry_error": 50e-6, "smooth": smooth}
    contacts = [touch(each, 2.0, 100e-6) for each in MESHES[1:]]
    meshes, texels, _ = give(contacts, contacts[-1], shares=SHARES[[2, 2]])
    rough = tuple(dataclasses.replace(each, settings=settings) for each in meshes)
    plain, found = (press_small(each, LAYERS, ask(texels), 2.0) for each in (meshes, rough))
    names = {"depth": share, "peak_texel": share / 2, "misplaced_force": share / 2}
    for name, error in plain.error_estimate.items():
        assert found.error_estimate[name] == pytest.approx(error + names.get(name, 0.0))
    np.testing.assert_allclose(found.texel_errors - plain.texel_errors, share / 2 * 2.0 * SHARES[-1])
    assert any("the shape of the cover" in each for each in found.warnings) == (not smooth)


@pytest.mark.usefixtures("full_cells")
@pytest.mark.parametrize("control", ["load", "depth"])
def test_friction_changes_what_it_changes_on_the_same_cells(give, control):
    """It makes contacts 10 and 20 % stiffer and wider, 15 and 16 % on fewer cells; texels feel 2, 4 and 3 % more."""

    def pair(mesh, stiffer, wider, felt):
        smooth = touch(mesh, 1.6, 120e-6, area=4e-6)
        return smooth, touch(mesh, 1.6 * stiffer, 120e-6, area=4e-6 * wider, felt=1 + felt)

    last = MESHES[-1]
    rubs = [[pair(MESHES[1], 1.1, 1.1, 0.02)], [pair(last, 1.2, 1.2, 0.04), pair(last, 1.15, 1.16, 0.03)]]
    meshes, texels, asked = give(three()[1:], three()[-1], rubs, shares=SHARES[[2, 2]])
    smooth = press_small(meshes, LAYERS, ask(texels, control), 2.0)
    found = press_rubbing(meshes, LAYERS, ask(texels, control, friction=0.3), 2.0)
    assert asked[-4:] == [64, (0.3, ((64, 16),)), 64, (0.3, ((64, 16), (48, 8)))]
    by_load = control == "load"
    load, depth = (2.0, 140e-6 / 1.2) if by_load else (2.4, 140e-6)
    assert (found.total_force, found.depth) == pytest.approx((load, depth))
    np.testing.assert_allclose(found.texel_forces, 1.04 * load * SHARES[-1])
    np.testing.assert_allclose(found.force, [0, 0, -1.04 * load], atol=1e-9)
    np.testing.assert_allclose(found.contact_forces, [[0, 0, -load]])
    np.testing.assert_allclose(found.unmeasured, [0, 0, -1.04 * load * 0.1], atol=1e-9)
    assert found.contact_area == pytest.approx(5.5e-6 * 1.2)
    assert found.energy is None
    assert found.assumptions["friction"] == "Coulomb, coefficient 0.3"
    added = {
        "peak_texel": (1.5 * 0.02 + 0.01) / 1.04,
        "misplaced_force": (1.5 * 0.02 + 0.01) * 0.9 / 2,
        "texel_sum": (1.5 * 0.02 + 0.01) / 1.04,
        "depth" if by_load else "total_force": 1.5 * 0.1 + 0.05,
        "contact_area": 1.5 * 0.1 + 0.04,
    }
    known = smooth.error_estimate
    assert found.error_estimate == pytest.approx({name: known[name] + added.get(name, 0.0) for name in known})
    each = (smooth.texel_errors / 2.0 + 0.04 * SHARES[-1]) * load
    np.testing.assert_allclose(found.texel_errors, np.maximum(each, each.sum() / 0.9 * SHARES[-1]))


def stress(length, width):
    """Nominal stress along and across a neo-Hookean bar without lateral contraction at small strain [MPa]."""
    volume, square = length * width**2, length**2 + 2 * width**2
    shear, pressure = 0.5 * volume ** (-2 / 3), (volume - 1) / 3
    along = shear * (length - square / (3 * length)) + pressure * width**2
    return along, shear * (width - square / (3 * width)) + pressure * length * width


def test_a_pad_under_a_plate_stiffens_at_finite_strain_as_a_bar_does_in_any_frame(give):
    """Between bars with free and with held sides: the base holds the pad, the plate does not."""
    turn, shift = Rotation.from_rotvec([-np.pi / 2, 0, 0]).as_matrix(), np.array([1e-3, 4e-3, -2e-3])
    contact = touch(MESHES[0], 1.5, 0.4e-3)
    whole = dataclasses.replace(MESHES[0], nodes=MESHES[0].nodes @ turn.T + shift)
    texels = dataclasses.replace(
        PAD.texels, centres=PAD.texels.centres @ turn.T + shift, normals=PAD.texels.normals @ turn.T
    )

    class Given:
        @classmethod
        def begin(cls, *_, **__):
            return cls()

        def solve(self, _=None):
            return dataclasses.replace(contact, nodal=contact.nodal @ turn.T)

    told: list[str] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "CellPress", Given)
        problem = PressProblem(
            array=texels, indenter=Box(size=(9e-3, 9e-3, 5e-3)), control="depth", targets=(0.4e-3,), strain="finite",
            progress=told.append,
            pose=Pose.facing(shift + np.array([0, 5e-3, 0]), [0, -1, 0]),
        )  # fmt: skip
        layers = (Layer(thickness=2e-3, material=make_rubber(0.0)),)
        found = press_finite((whole,), layers, problem, 0.4e-3)
    named = [each.split(":")[0] for each in told if ": " in each]
    assert [*dict.fromkeys(named)] == ["small strain, mesh 1", "finite strain, mesh 1"]
    assert any(each.startswith("contact on 44 cells across, ") for each in told)
    free = -stress(0.8, brentq(lambda width: stress(0.8, width)[1], 0.9, 1.1))[0] / 0.2
    held = -stress(0.8, 1.0)[0] / 0.2
    assert 1.1 < free < found.total_force / 1.5 < held < 1.25
    down = found.total_force * np.array([0, -1.0, 0])
    np.testing.assert_allclose(found.force, down, atol=1e-6)
    np.testing.assert_allclose(found.base_force, down, atol=1e-6)
    np.testing.assert_allclose(found.contact_forces.sum(axis=0), down, atol=1e-3 * found.total_force)
    for moment in (found.moment, found.base_moment):
        np.testing.assert_allclose(moment, np.cross(shift, down), atol=1e-8)
    np.testing.assert_allclose(found.contact_points[:, 1], shift[1] + 2e-3)
    assert np.abs(found.contact_points - shift)[:, ::2].max() < 3e-3
    upper = whole.nodes[:, 1] > shift[1] + 1.99e-3
    np.testing.assert_allclose(found.displacement[upper, 1], -0.4e-3, atol=2e-6)
    assert found.depth == pytest.approx(0.4e-3)
    assert found.texel_forces == pytest.approx([found.texel_forces.sum()])
    assert found.assumptions["strain"].startswith("finite strain, rubber; corrected for the mesh")


def test_the_balance_is_taken_along_the_force():
    force = np.array([0.0, 3.0, -4.0])
    assert measure_balance(force, 1.1 * force + [7.0, 0, 0]) == pytest.approx(0.1)
    assert measure_balance(force, force + np.array([0, 4.0, 3.0])) == pytest.approx(0)
