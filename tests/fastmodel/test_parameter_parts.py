"""What a folder of parameters keeps, part by part, and parts of a wrong kind."""

import dataclasses

import numpy as np
import pytest

from fastmodel import WTS_0614_34, Butterworth, Electronics, FastModelError, Gaussian, Parameters
from fastmodel.errors import ParametersError
from fastmodel.parameters import NPZ_NAME, TOML_NAME, load
from fastmodel.signal.creep import Creep
from fastmodel.signal.frame import Frame
from fastmodel.signal.point_spread import Tabulated
from fastmodel.validity import Validity
from meshes import TexelArray
from meshes.bounded_file import parse_toml
from tests.support.cover_data import cells, make_dome

ARRAY = TexelArray.grid(2, 3, (2e-3, 3e-3), texel_size=(1.5e-3, 2.5e-3), active=[1, 1, 0, 1, 1, 1], name="six")
SPREAD = Gaussian(sigma_x=0.6, sigma_y=0.9, ksize_x=3, ksize_y=5)
VALIDITY = Validity(
    ball_radius=2e-3,
    load_2_percent=0.5,
    load_5_percent=1.5,
    depth_2_percent=1e-4,
    depth_5_percent=2e-4,
    largest_load=4.0,
    strain="finite",
)
ELECTRONICS = Electronics(
    rate_hz=123.0,
    sensitivity=77.0,
    offset=-3.5,
    output_max=200,
    bits=8,
    noise=0.01,
    threshold=2.0,
    saturation_band=30.0,
    characteristic=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0),
    gains=(1.0, 0.9, 1.1, 1.0, 1.2, 0.8),
    seed=9,
    hysteresis_share=0.2,
    hysteresis_width=0.03,
    temperature_coefficient=0.001,
    temperature_excess=7.0,
    creep=0.05,
    high_pass_hz=0.2,
    calibrated="through the cover, tip 0.75 mm",
    tip_share=0.6,
)


def make(**changes):
    return Parameters(**{"array": ARRAY, "spread": SPREAD, "electronics": WTS_0614_34, **changes})


def keep(tmp_path, **changes):
    return load(make(**changes).save(tmp_path))


def test_every_number_of_the_electronics_is_kept(tmp_path):
    """None of them has its default value."""
    default = Electronics(rate_hz=1.0, sensitivity=1.0)
    assert all(getattr(ELECTRONICS, each.name) != getattr(default, each.name) for each in dataclasses.fields(default))
    assert keep(tmp_path, electronics=ELECTRONICS).electronics == ELECTRONICS


@pytest.mark.parametrize("validity", [None, VALIDITY])
@pytest.mark.parametrize("low_pass", [None, Butterworth(cutoff_hz=17.0, order=5)])
def test_filter_and_range_are_kept_or_left_out(tmp_path, low_pass, validity):
    found = keep(tmp_path, filter=low_pass, validity=validity)
    assert (found.filter, found.validity) == (low_pass, validity)
    assert (found.provenance, dict(found.tables), found.surface) == ({}, {}, None)
    values = parse_toml((tmp_path / TOML_NAME).read_text())
    assert ("filter" in values) == (low_pass is not None)
    assert (values["validity"] == "not stated") == (validity is None)
    assert values["cover"]["file"] == NPZ_NAME


@pytest.mark.parametrize("shift", [np.zeros(3), np.array([0, 0, 1e-3]), np.array([1e-9, 0, 0])])
@pytest.mark.parametrize("lean", [0.0, 0.1])
@pytest.mark.parametrize("margin", [None, (1e-3, 0.0)])
def test_the_layout_is_kept_as_numbers_where_it_is_no_grid(tmp_path, shift, lean, margin):
    array = dataclasses.replace(
        ARRAY,
        centres=ARRAY.centres + shift,
        normals=np.tile([np.sin(lean), 0, np.cos(lean)], (6, 1)),
        margin=margin,
    )
    found = keep(tmp_path, array=array).array
    for name, value in vars(array).items():
        np.testing.assert_array_equal(getattr(found, name), value)
    stored = parse_toml((tmp_path / TOML_NAME).read_text())["array"]
    assert ("centres" in stored) == ("normals" in stored) == bool(shift.any() or lean)
    assert ("margin" in stored) == (margin is not None)
    assert stored["active"] == [[1, 1, 0], [1, 1, 1]]
    whole = parse_toml(make(array=dataclasses.replace(ARRAY, active=np.ones(6, dtype=bool))).save(tmp_path).read_text())
    assert "active" not in whole["array"]


def test_the_operator_of_any_point_spread_is_kept(tmp_path):
    random = np.random.default_rng(0)
    table = Tabulated(matrix=random.uniform(0, 1, (6, 6)), source="measured")
    found = keep(tmp_path, spread=table).spread
    np.testing.assert_array_equal(found.matrix, np.where(ARRAY.active[:, None], table.matrix, 0))
    assert found.source == "measured"

    class Sharp:
        """Another model of the point spread."""

        def operator(self, array):
            return 0.5 * np.eye(array.count)

    found = keep(tmp_path, spread=Sharp()).spread
    assert isinstance(found, Tabulated)
    np.testing.assert_array_equal(found.matrix, 0.5 * np.eye(6))
    assert found.source == "Sharp"
    assert keep(tmp_path).spread == SPREAD


def test_tables_of_cells_and_of_the_user_are_kept(tmp_path):
    array = TexelArray.grid(2, 3, 3.4e-3)
    surface = dataclasses.replace(
        cells(array, per_texel=2, reach=3), table=np.random.default_rng(1).uniform(0, 1, (6, 4, 6)), source="made up"
    )
    found = keep(tmp_path, array=array, surface=surface, tables={"own": np.arange(4.0)})
    for each in dataclasses.fields(surface):
        np.testing.assert_array_equal(getattr(found.surface, each.name), getattr(surface, each.name))
    assert list(found.tables) == ["own"]
    np.testing.assert_array_equal(found.tables["own"], np.arange(4.0))


def test_a_cover_ends_at_the_texels_if_it_has_free_sides_and_no_margin_is_stated():
    array = TexelArray.grid(2, 3, 3.4e-3)
    plain = cells(array, per_texel=2, reach=3)
    ended, margin = dataclasses.replace(plain, table=np.zeros((6, 4, 6))), dataclasses.replace(array, margin=(0, 0))
    assert not make().ends_at_texels
    assert not make(array=array, surface=plain).ends_at_texels
    assert make(array=array, surface=ended).ends_at_texels
    assert not make(array=margin, surface=ended).ends_at_texels


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"array": "grid"}, "array must be a meshes.TexelArray"),
        ({"electronics": None}, "electronics must be a fastmodel.Electronics"),
        ({"filter": 40.0}, "filter must be a fastmodel.Butterworth or None"),
        ({"spread": Tabulated(matrix=np.eye(5))}, "6 texels"),
        ({"electronics": dataclasses.replace(WTS_0614_34, gains=(1.0,) * 5)}, "gains for 5 texels; the array has 6"),
        ({"surface": cells()}, "pitch"),
        ({"surface": make_dome()}, "4 texels; the array has 6"),
    ],
)
def test_parts_of_a_wrong_kind_or_size_are_refused(changes, message):
    with pytest.raises(FastModelError, match=message):
        make(**changes)


@pytest.mark.parametrize("sensor", [3, None, b"wts-0614-34"])
def test_a_sensor_is_named_by_text_or_path(sensor):
    with pytest.raises(FastModelError, match="the name of a sensor or the path of a parameters folder"):
        load(sensor)


def test_a_pair_whose_text_was_not_replaced_yet_is_read_from_the_copy(tmp_path):
    """The text names the tables that it belongs to; a copy of the old ones stays until both are new."""
    first = make(tables={"own": np.arange(3.0)}).save(tmp_path)
    text, packed = first.read_text(), (tmp_path / NPZ_NAME).read_bytes()
    digest = parse_toml(text)["cover"]["sha256"]
    make(tables={"own": np.arange(5.0)}).save(tmp_path)
    first.write_text(text)
    with pytest.raises(ParametersError, match="sha256 differs"):
        load(tmp_path)
    copy = tmp_path / f"cover.{digest[:16]}.npz"
    copy.write_bytes(packed)
    assert len(load(tmp_path).tables["own"]) == 3
    make(tables={"own": np.arange(5.0)}).save(tmp_path)
    assert not copy.exists()
    assert len(load(tmp_path).tables["own"]) == 5


FRAME = Frame(time=0.25, counts=np.arange(6), image=np.zeros((2, 3), np.uint8))
FILTER, TABLE = Butterworth(cutoff_hz=9.0), Tabulated(matrix=np.eye(6))


@pytest.mark.parametrize("part", [make(), SPREAD, TABLE, ELECTRONICS, FILTER, FRAME, Creep(0.1)], ids=type)
def test_parts_cannot_be_changed_and_their_values_are_given_by_name(part):
    names = [each.name for each in dataclasses.fields(part)]
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(part, names[0], getattr(part, names[0]))
    if len(names) > 1:
        with pytest.raises(TypeError, match="positional"):
            type(part)(*(getattr(part, name) for name in names))


@pytest.mark.parametrize("part", [make(), TABLE, FRAME], ids=type)
def test_parts_with_arrays_are_equal_to_themselves_only(part):
    assert part == part  # noqa: PLR0124 -- without a comparison of arrays
    assert part != dataclasses.replace(part)
    assert len({part, dataclasses.replace(part)}) == 2


def test_a_frame_of_a_real_sensor_has_counts_and_an_image_alone():
    given = ("time", "counts", "image", "tangential_source")
    assert {name: value for name, value in vars(FRAME).items() if name not in given} == dict.fromkeys(
        ("texel_forces", "texel_area", "net_force", "net_torque", "pressure_torque", "missed_torque", "tangential",
         "outside")
    )  # fmt: skip
    assert (FRAME.tangential_source, FRAME.pressures) == ("", None)
    assert not FRAME.counts.flags.writeable
    assert not FRAME.image.flags.writeable
