import math

import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from meshes import Prism, read_stl
from validation.errors import InputError
from validation.text.indenter import SHAPES, read_depth, read_indenter, read_load, read_position, read_yaw


@pytest.mark.parametrize("shape", sorted(SHAPES.keys() - {"mesh"}))
def test_every_shape_has_an_example_that_is_accepted(shape):
    make, example = SHAPES[shape]
    assert isinstance(read_indenter(example), make)


def test_corners_of_a_prism():
    triangle = Prism(points=((0.0, 0.0), (10e-3, 0.0), (0.0, 6e-3)))
    assert read_indenter("prism:points=0,0/10mm,0/0,6mm") == triangle
    assert read_indenter(" prism: points = 0mm , 0mm / 1cm , 0mm / 0mm , 6mm") == triangle


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("prism", "prism needs points; write for example prism:points="),
        ("prism:points=0,0/10mm/0,6mm", "prism.points: corner 2, '10mm', is not 2 values"),
        ("prism:points=0,0/10,0/0,6mm", "'10' has no unit"),
        ("prism:points=0,0/nan,0/0,6mm", "'nan' is not a length"),
        ("prism:points=0,0/10mm,0", "three corners or more, not 2; write for example"),
        ("prism:points=0,0/9mm,9mm/9mm,0/0,9mm", "sides 1 and 3 of the polygon meet"),
        ("prism:holes=0,0/1mm,0/0,1mm,points=0,0/9mm,0/0,9mm", "prism has no parameter 'holes'"),
        ("mesh", "mesh needs path; write for example mesh:path=part.stl,unit=mm"),
        ("mesh:path=", "mesh.path: names no file"),
        ("mesh:path=gone.stl", "gone.stl: No such file or directory"),
        ("mesh:path=gone.stl,unit=kg", "'kg' in '1 kg' is not a unit of length"),
        ("mesh:path=gone.stl,axis=1mm", "mesh.axis: '1mm' is not 2 values"),
        ("sphere:radius=5mm,radius=6mm", "sphere.radius is given twice"),
        ("sphere:radius=1km", "2e+06 mm is not a possible width; accepted: 0.02..1000 mm"),
        ("box:size=1nmx1nmx1mm", "1e-06 mm is not a possible width"),
    ],
)
def test_faults_of_shapes_are_one_line(text, part):
    with pytest.raises(InputError) as caught:
        read_indenter(text)
    assert len(caught.value.faults) == 1
    assert part in caught.value.faults[0]
    assert caught.value.faults[0].startswith("--indenter: ")


@pytest.fixture
def part(tmp_path):
    path = tmp_path / "a, b.stl"
    trimesh.creation.icosphere(2, 5.0).apply_translation([3, 4, 5]).export(path)
    return path


def test_a_body_from_a_file(part):
    assert read_indenter(f"mesh:path={part}") == read_stl(part)
    assert read_indenter(f"mesh:path={part},unit=inch") == read_stl(part, unit=25.4e-3)
    assert read_indenter(f"mesh:unit=0.5mm,axis=1mm,2mm,path={part}") == read_stl(part, unit=5e-4, axis=(1e-3, 2e-3))


def test_all_faults_of_one_indenter_at_once():
    with pytest.raises(InputError) as caught:
        read_indenter("box:sise=1mm,size=3mm")
    assert len(caught.value.faults) == 2
    assert "did you mean 'size'" in caught.value.faults[0]
    assert "write for example '2mmx2mmx2mm'" in caught.value.faults[1]


MILLIMETRES = st.floats(0.1, 400)


@given(MILLIMETRES, MILLIMETRES, MILLIMETRES)
def test_any_box_comes_back_from_its_text(x, y, z):
    assert read_indenter(f"box:size={x!r}mmx{y!r}mmx{z!r}mm").size == pytest.approx((1e-3 * x, 1e-3 * y, 1e-3 * z))


@settings(deadline=None)
@given(
    st.sampled_from([*SHAPES, "", "ball"]),
    st.text(alphabet="radiusezwhconpgl=,:.x/-0123456789m ", max_size=25) | st.text(max_size=12),
)
def test_any_text_is_an_indenter_or_bad_input(shape, rest):
    faults = ()
    try:
        assert min(read_indenter(f"{shape}:{rest}").footprint) > 0
    except InputError as error:
        faults = error.faults
    assert all(fault.startswith("--indenter: ") for fault in faults)


@given(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-360, 360))
def test_any_pose_comes_back_from_its_text(x, y, yaw):
    assert read_position(f"{x!r}mm,{y!r}mm") == pytest.approx((1e-3 * x, 1e-3 * y))
    assert read_yaw(f"{yaw!r}deg") == pytest.approx(math.radians(yaw))


@pytest.mark.parametrize(
    ("read", "text", "message"),
    [
        (read_load, "1e308 N", "1e+308 N is not possible on a tactile array; accepted: 1e-06..1e+06 N"),
        (read_load, "1e-12 N", "1e-12 N is not possible on a tactile array; accepted: 1e-06..1e+06 N"),
        (read_depth, "1e-30 mm", "1e-33 m is not possible on a tactile array; accepted: 1e-09..1 m"),
        (read_depth, "2 km", "2000 m is not possible on a tactile array; accepted: 1e-09..1 m"),
        (read_yaw, "1e308deg", "'1e308deg' is more than one turn; accepted: -360deg..360deg"),
    ],
)
def test_numbers_in_which_the_solvers_lose_all_digits_are_refused(read, text, message):
    with pytest.raises(InputError) as caught:
        read(text)
    assert message in str(caught.value)
    assert read_yaw("-360deg") == pytest.approx(-2 * math.pi)
