"""Bad input of every command: exit status 2, one line that names the place and what is accepted, and no file."""

import pytest

import fastmodel
from tests.support.words import split_command, split_table

#: Words of commands and what the line says.  BALL stands for an indenter with a load, WTS for the built-in sensor.
REFUSED = """
derive no.toml | no.toml: no such file or built-in sensor
derive wts-0614-3 | did you mean 'wts-0614-34'
derive WTS --material dragonskn-30 | did you mean 'dragon-skin-30'
derive WTS --thickness 2 | --thickness: '2' has no unit
derive WTS --thickness=-2mm | --thickness: must be positive
derive WTS --thickness=5km | --thickness: must be at most 1 m, not '5km'
derive | SENSOR is missing
derive WTS --thicknes 2mm | --thicknes
press WTS --indneter sphere:radius=5mm --load 1N | unknown option --indneter; did you mean '--indenter'?
press WTS --load 1N --indenter | --indenter has no value
derive WTS --layer 2:thickness=1mm | --layer: the cover has no layer 2
derive . | .: is a folder; name a file
mesh . | .: is a folder; name a file
regress . | .: `softcover derive --out` did not write this folder
press . BALL --model fast | .: `softcover derive --out` did not write this folder
init . | .: is a folder; name a file, for example sensor.toml
init . --force | .: is a folder; name a file
regress WTS --baseline . | .: is a folder; name a file
press WTS --indenter shpere:radius=5mm --load 1N | did you mean 'sphere'
press WTS --indenter sphere:raduis=5mm --load 1N | did you mean 'radius'
press WTS --indenter sphere --load 1N | sphere needs radius
press WTS --indenter sphere:radius=-5mm --load 1N | positive
press WTS --indenter box:size=1mmx2mm --load 1N | is not 3 values
press WTS BALL --method boxs | 'boxes'
press WTS --indenter sphere:radius=5mm | give one of them
press WTS --indenter sphere:radius=5mm --load 5 | --load: '5' has no unit
press WTS --indenter sphere:radius=5mm --load 0N | --load: must be positive
press WTS --indenter sphere:radius=5mm --depth 3mm | --depth: at a depth of 3 mm
press WTS BALL --at=1m,0m | is not on the array
press WTS BALL --yaw=45 | --yaw: '45' has no unit
press WTS BALL --model=fen | did you mean 'fem'
press WTS BALL --layer 1:E=1MPa | mean 'youngs_modulus'
press WTS BALL --model fast --friction 0.4 | --friction: the fast model has none
press WTS BALL --friction sticky | --friction: 'sticky' is not zero, a positive number or no-slip
press WTS BALL --model fast --accuracy 1% | the fast model has none
press WTS BALL --model fast --out x | write --model fem
press WTS BALL --model fem --curve 3 | --out
press WTS BALL --model fem --curve 0 --out x | 1..1000
press WTS BALL --model fem --method boxes | --method: --model names the finite elements alone
press WTS BALL --curve 3 --out x --method boxes | --method: --curve is computed by finite elements alone
press WTS BALL --direction=0,0,-1 | --direction
press fingertip BALL --tilt=85deg,0deg | --tilt
press flat-pad BALL --model fem --friction=0.4 --strain=finite | --friction: on curved covers friction
press fingertip BALL --friction=no-slip --model=fast | --friction: the fast model has none
press fingertip --indenter sphere:radius=5mm | --load, --depth
validate fingertip --recordings none | recordings of curved covers are not scored; leave them out
export phalanx --format sdf | curved cover
datasheet flat-pad | curved cover
view fingertip BALL | curved cover
emulate port --show fingertip | softcover derive fingertip --out FOLDER
export WTS --format usd | unknown format 'usd'; did you mean 'sdf'? accepted: mjcf, gazebo
export WTS --mass 20g | --mass: mjcf holds massless boxes
export WTS --format sdf --mass 20mm | is not a unit of mass
export WTS --format urdf --mass=-1g | --mass: must be positive
export WTS --format gazebo --method boxes | --method: the Gazebo plugin block has one method of its own
export sdh2-distal --format gazebo --thickness 1mm | no texel may be masked
datasheet WTS --out sheet.pdf | sheet.pdf is neither .md nor .html
validate WTS --recordings nowhere | nowhere: no such folder
validate WTS --measured gelsight | did you mean 'gelsight-mini'
validate WTS --measured gelsight-mini --quick | leave out all options but --json
limits WTS --load 0N | --load: must be positive
limits WTS --load 3 | --load: '3' has no unit
limits WTS --noise=-5mN | --noise: must be positive
limits WTS --noise 5mm | is not a unit of force
limits WTS --two 5m | --two: must be at most
limits WTS --radius=-1mm | --radius: must not be negative
limits WTS --thicknesses 6mm:1mm | --thicknesses: '6mm:1mm' must rise
limits WTS --thicknesses 3mm | is not FROM:TO
limits fingertip --thicknesses 1mm:2mm | --thicknesses: the curve is computed for flat covers
limits WTS --picture map.pdf | map.pdf is neither .png nor .svg
design WTS --thickness 5mm:1mm | --thickness: '5mm:1mm' must rise
design WTS --thickness 1:5mm | --thickness: '1' has no unit
design WTS --thickness=-1mm:5mm | --thickness: '-1mm' must lie within 0.01mm:100mm
design WTS --thickness 1mm:5mm:0 | in two steps or more
design WTS --thickness 1mm:2mm:3:4 | is not FROM:TO or FROM:TO:COUNT
design WTS --pitch 2:5mm | --pitch: '2' has no unit
design WTS --hardness 10A:40A | --hardness: the relations hold for 20..80 Shore A
design WTS --hardness 22A:40A | with its tolerance of 5
design WTS --hardness 30A:60 | has no scale
design WTS --hardness 30A:60shore-00 | mixes two scales
design WTS --tolerance 5 | --tolerance: is that of --hardness
design WTS --radius 1mm --ball 5mm | give one of them
design WTS --thickness 1mm:5mm:1000 --pitch 2mm:5mm:1000 --out page | = 1000000 designs
design WTS --load 0N | --load: must be positive
design no.toml | no.toml: no such file or built-in sensor
design fingertip | curved cover need finite elements; describe them in a file for softcover sweep
materials dragonskn-30 | did you mean 'dragon-skin-30'
materials --hardness 90 | --hardness: the relations hold for 20..80 Shore A
materials --hardness soft | --hardness: 'soft' is not a hardness
materials rtv615 --hardness 30 | leave out the name
materials --out curve.csv | name it
materials rtv615 --out curve.pdf | curve.pdf is none of .csv, .svg and .png
emulate --array 0 | --array: is for recordings; leave it out with --show blob
emulate --load 2N | --indenter, --load: press on the fast model of a sensor; leave them out with --show blob
emulate --rate nan | --rate: 'nan' is not a finite number
emulate --rate 1_0 | --rate: '1_0' is not a finite number
emulate --seconds 1e999 | --seconds: '1e999' is not a finite time; write for example '10s'
emulate --seed 1_0 | --seed: '1_0' is not a whole number
emulate --fault lose=0.1 --fault lose=0.2 | --fault: lose is given twice; give each fault once
emulate --fault lose=2 | --fault: the rate of lose must lie in 0..1, not 2.0
emulate --fault sabotage=1 | known faults: flip-bit
emulate --fault lose=often | such as lose=0.01; accepted: flip-bit
emulate --fault lose | 'lose' is no fault and how often
emulate --pause 2 | for example 2s:3s
emulate --seconds 2mm | 'mm' in '2mm' is not a unit of time
emulate --show blub | did you mean 'blob'
record x --indenter pyramid | unknown indenter
record x --load heavy | --load
record x --load -5N | --load
record x --seconds -1 | --seconds: accepted: 0 or more, not -1
record x --seconds 1 --interval-ms 2000 | --interval-ms: no frame would come within --seconds 1; give a shorter
record x --gain 300 | --gain: accepted: 0..255, not 300
replay /etc/hostname | not a recording; accepted
replay nothing.mcap | no such file
import nothing.bag | no such file
import a.csv --force-delay 1 | name that with --force
import a.csv --out a.txt | a.txt does not end in .mcap
regress WTS --update --junit a.xml | give one of the two
regress WTS --seed=-1 | --seed: accepted: 0 or more
regress WTS --update --baseline . | is a folder; name a file
regress WTS --junit . | is a folder; name a file
regress | SENSOR is missing
store prune --older-than 30 | --older-than: '30' has no unit
store prune --older-than yesterday | 'yesterday' is not a time; write for example '30 days'
store prune --older-than=-3d | --older-than: accepted: 0 days or more, not '-3d'
store prune --older-than 3mm | --older-than: 'mm' in '3mm' is not a unit of time
store prune --keep-latest=-1 | --keep-latest: accepted: 0 or more
store prune --all --keep-latest 3 | --all: removes every entry
store --json lst | unknown action 'lst'; did you mean 'list'
calibrate x.mcap --sensor WTS --window 9:6 | the earlier time first
calibrate x.mcap --sensor WTS --out new.toml | wts-0614-34 is built in and has no file to copy
dervie WTS | did you mean 'derive'
demo extra | unexpected 'extra'; see: softcover demo --help
derive WTS --thickness nanmm | --thickness: 'nanmm' is not a length
derive WTS --thickness 1e400mm | --thickness: '1e400mm' is too large
derive WTS --layer 0:thickness=1mm | --layer: the cover has no layer 0, only layer 1
derive WTS --layer thickness=1mm | is not a layer's number, a colon and KEY=VALUE
derive WTS --layer 1:thickness | --layer 1: thickness has no value
derive WTS --layer 1:poisson_ratio=0.6 | --layer 1: poisson_ratio: must lie in 0..0.5
derive WTS --layer 1:hardness=500 | --layer 1: hardness: '500' has no scale
derive WTS --format pdf | Choose from: "png", "svg"
press WTS BALL --depth 1mm | --load, --depth: give one of them
press WTS --indenter sphere:radius=1km --load 1N | accepted: 0.02..1000 mm
press WTS --indenter cone:angle=200deg,radius=4mm --load 1N | between 0 and 180 degrees, not 200
press WTS --indenter prism:points=0,0/1mm,0 --load 1N | three corners or more, not 2
press WTS --indenter mesh:path=none.stl --load 1N | none.stl: No such file or directory; give the path
press WTS --indenter sphere:radius=5mm --load 1e9N | accepted: 1e-06..1e+06 N
press WTS BALL --at=nowhere | --at: unknown place 'nowhere'; accepted: centre
press WTS BALL --at=1mm,2mm,3mm | --at: '1mm,2mm,3mm' is not 2 values
press WTS BALL --tilt=20deg,0deg | --tilt: a tilt may have at most 10 degrees
press WTS BALL --strain finite | --strain: layers follow their materials
press WTS BALL --accuracy 5 | --accuracy: '5' is not a share between 0 and 1
press WTS BALL --friction=-1 | --friction: '-1' is not zero
mesh WTS | has a flat cover, which needs no mesh file
view WTS BALL --display tv | --display: unknown place 'tv'; accepted: auto
validate WTS --budget -5min | --budget: '-5min' is not a positive time
validate WTS --budget 5min --quick | give one of the two
validate WTS --only-recordings | name the recordings
validate WTS --data-set none | none: no such data-set file
regress WTS --baseline none.json | none.json: no such file; write one with --update
record x --out touch.txt | --out: touch.txt does not end in .mcap and is no folder; write touch.mcap
emulate --rate=-5 | --rate: must be positive, not -5
--json press | --json: unknown option; the options of a command follow its name
"""


@pytest.mark.parametrize(("command", "said"), split_table(REFUSED))
def test_bad_input_is_one_line_and_status_2(softcover, tmp_path, command, said):
    status, out, err = softcover(*split_command(command))
    assert (status, out) == (2, "")
    assert said in err
    assert all(line.startswith(("softcover: ", "[")) for line in err.splitlines())  # a slow machine tells its progress
    assert list(tmp_path.iterdir()) == []


#: Files with faults, for the commands below.
FILES = {
    "empty.toml": "",
    "ok.csv": "# rows = 1\ntime,a,b\n0,1,2\n1,3,2\n",
    "none.csv": "time,a\n",
    "nan.csv": "# rows = 1\ntime,a,b\n0,nan,1\n",
    "shape.csv": "# rows = 3\n# columns = 1\ntime,a,b\n0,1,2\n",
    "pipes.csv": "time|a|b\n0|1|2\n",
    "base.json": "nothing",
    "empty.stl": "",
}
#: Words of commands on these files, and what the line says.
REFUSED_FILES = """
derive ok.csv | ok.csv: not a TOML file that is accepted
derive WTS --out ok.csv | is a file; name a folder
press WTS --indenter mesh:path=empty.stl --load 1N | empty.stl is not a whole STL file
validate WTS --campaign empty.toml | empty.toml: is empty; write [[case]] or [required]
validate WTS --recordings ok.csv | ok.csv: no such folder; expected a folder with recordings
regress WTS --baseline base.json | base.json: not a JSON file that is accepted
replay empty.stl | empty.stl
replay none.csv | none.csv: no frames; expected at least one line of numbers
replay nan.csv | nan.csv, line 3: all numbers must be finite
replay shape.csv | 2 texels are not 3 rows x 1 columns; write for example `# rows = 2`
replay pipes.csv | pipes.csv, line 1: 1 columns between commas, 'time|a|b'
replay ok.csv --array 3 | --array
replay ok.csv --rows 7 | 2 texels are not 7 rows
replay ok.csv --csv ok.csv | --csv: ok.csv exists; name a new file
import ok.csv --axis w | one column per texel (a, b, ...) and axis = w; leave the axis out
import ok.csv --force nan.csv | nan.csv, line 3
import ok.csv --load 5 | --load: '5' has no unit
calibrate ok.csv --sensor WTS | ok.csv: its labels name no tool; give --indenter
calibrate ok.csv --sensor ok.csv | ok.csv: not a TOML file
init empty.toml | empty.toml: exists already; name another file, or replace it with --force
emulate --show none.toml | no pattern, sensor, recording or folder 'none.toml'; accepted: blob
"""


@pytest.mark.parametrize(("command", "said"), split_table(REFUSED_FILES))
def test_bad_files_are_one_line_and_status_2(softcover, tmp_path, command, said):
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    status, out, err = softcover(*split_command(command))
    assert (status, out) == (2, "")
    assert said in err
    assert len(err.splitlines()) == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(FILES)


@pytest.mark.parametrize("number", ["2.0", "many"])
@pytest.mark.parametrize(
    "command",
    [
        "press WTS BALL --out x --curve",
        "calibrate x.mcap --sensor WTS --tip=1mm --texel",
        "regress WTS --seed",
        "import x.csv --rows",
        "store prune --keep-latest",
    ],
)
def test_what_is_counted_is_never_rounded(softcover, command, number):
    words = split_command(command)
    status, _, err = softcover(*words, number)
    assert status == 2
    assert err.startswith(f"softcover: Invalid value for {words[-1]}: {number!r} is not a whole number")


@pytest.mark.parametrize(
    ("command", "places"),
    [
        (
            # How a pose is written depends on the cover, which is not known here.
            "press no.toml --indenter spher:x=1 --load 3 --at=1mm,2mm,3mm --direction=0,0,-1 --model fen",
            ["--model", "no.toml", "--indenter", "--load"],
        ),
        (
            "press fingertip BALL --at=tip --direction=up --yaw=3 --tilt=1deg --strain=large",
            ["--at", "--direction", "--yaw", "--tilt", "--strain"],
        ),
        (
            "view wts-0614-3 --indenter shpere --load 0N --method boxs --seconds=-1",
            ["wts-0614-3", "--indenter", "--load", "--seconds", "--method"],
        ),
        ("export wts-0614-3 --format gazebo --method boxes", ["--method", "wts-0614-3"]),
    ],
)
def test_the_faults_of_all_options_are_told_at_once_before_any_work(softcover, monkeypatch, command, places):
    monkeypatch.setattr("validation.places.make_meshes", None)
    status, out, err = softcover(*split_command(command))
    assert (status, out) == (2, "")
    assert [line.split(": ")[1] for line in err.splitlines()] == places


@pytest.mark.parametrize("options", ["--load 2N", "--depth 0.1mm --model fast"])
def test_the_finite_elements_need_more_than_a_derived_folder(softcover, without_reference, options):
    fastmodel.load("wts-0614-34").save("derived")
    status, _, err = softcover(*split_command(f"press derived --indenter sphere:radius=5mm {options}"))
    assert status == 2
    assert "no description of the cover" in err
