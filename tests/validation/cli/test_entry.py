import contextlib
import io
import json
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from validation.cli.entry import _COMMANDS, app, main

DOCUMENTED_KEYS = Path(__file__).parents[3] / "docs" / "json.md"
PAGES = [[name] for name in _COMMANDS] + [["store", action] for action in ("list", "verify", "prune")]


#: Options of texts that may begin with a minus sign; that of a number may always.
SIGNED = {"--load", "--depth", "--at", "--direction", "--yaw", "--tilt", "--friction", "--thickness", "--mass"}


@pytest.mark.parametrize("page", PAGES, ids=" ".join)
def test_help_has_examples_and_explains_every_option_and_a_quantity_may_begin_with_a_minus_sign(softcover, page):
    status, out, _ = softcover(*page, "--help")
    assert status == 0
    assert f"softcover {' '.join(page)}" in out.split("Examples of use")[1]
    command = app
    for word in page:
        command = command[word]
    for argument in command.assemble_argument_collection(parse_docstring=True) if command.default_command else ():
        name, parameter = argument.names[0], argument.parameter
        if name == "*":  # a group of options
            continue
        assert parameter.help, name
        assert parameter.help[0].isupper() or parameter.help[0] == "`", name
        assert parameter.help.endswith("."), name
        assert bool(parameter.allow_leading_hyphen) == (name in SIGNED), name


@pytest.mark.parametrize(
    "words",
    [
        ("press", "wts-0614-34", "--indenter", "sphere:radius=5mm", "--load=1N", "--out", "x", "--curve"),
        ("calibrate", "x.mcap", "--sensor", "wts-0614-34", "--tip=1mm", "--texel"),
        ("regress", "wts-0614-34", "--seed"),
        ("import", "x.csv", "--rows"),
        ("store", "prune", "--keep-latest"),
    ],
    ids=" ".join,
)
@pytest.mark.parametrize("number", ["1.5", "2.0", "many", "1e3"])
def test_what_is_counted_is_never_rounded(words, number, softcover):
    status, out, err = softcover(*words, number)
    assert (status, out) == (2, "")
    assert err.startswith(f"softcover: Invalid value for {words[-1]}: {number!r} is not a whole number")
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize("page", PAGES, ids=" ".join)
def test_help_examples_name_options_that_exist(page):
    command = app
    for word in page:
        command = command[word]
    examples = [line.split() for line in command.help.splitlines() if line.strip().startswith("softcover ")]
    assert examples
    for words in examples:
        assert words[1 : 1 + len(page)] == page
        if command.default_command:
            known = {name for argument in command.assemble_argument_collection() for name in argument.names}
            assert {word.split("=")[0] for word in words if word.startswith("--")} <= known


def test_help_pages_import_no_heavy_package():
    code = (
        "import contextlib, io, sys\n"
        "from validation.cli import main\n"
        f"for words in {[[], *PAGES]!r}:\n"
        "    with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):\n"
        "        main([*words, '--help'])\n"
        "heavy = {'numpy', 'scipy', 'mujoco', 'skfem', 'pint', 'pydantic', 'matplotlib'}\n"
        "print(*heavy & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)  # noqa: S603 -- ours
    assert done.stdout.split() == []


BAD = [
    (["derive", "no.toml"], "no.toml: no such file or built-in sensor"),
    (["derive", "wts-0614-3"], "did you mean 'wts-0614-34'"),
    (["derive", "wts-0614-34", "--material", "dragonskn-30"], "did you mean 'dragon-skin-30'"),
    (["derive", "wts-0614-34", "--thickness", "2"], "--thickness: '2' has no unit"),
    (["derive", "wts-0614-34", "--thickness=-2mm"], "--thickness: must be positive"),
    (["derive", "wts-0614-34", "--thickness=5km"], "--thickness: must be at most 1 m, not '5km'"),
    (["derive"], "SENSOR is missing"),
    (["derive", "wts-0614-34", "--thicknes", "2mm"], "--thicknes"),
    (["press", "wts-0614-34", "--indenter", "shpere:radius=5mm", "--load", "1N"], "did you mean 'sphere'"),
    (["press", "wts-0614-34", "--indenter", "sphere:raduis=5mm", "--load", "1N"], "did you mean 'radius'"),
    (["press", "wts-0614-34", "--indenter", "sphere", "--load", "1N"], "sphere needs radius"),
    (["press", "wts-0614-34", "--indenter", "sphere:radius=5mm", "--load", "1N", "--method", "boxs"], "'boxes'"),
    (["press", "wts-0614-34", "--indenter", "sphere:radius=-5mm", "--load", "1N"], "positive"),
    (["press", "wts-0614-34", "--indenter", "box:size=1mmx2mm", "--load", "1N"], "is not 3 values"),
    (["press", "wts-0614-34", "--indenter", "sphere:radius=5mm"], "give one of them"),
    (
        ["press", "wts-0614-34", "--indenter", "tip", "--load", "1N", "--model", "fast", "--friction", "0.4"],
        "--friction: the fast model has none",
    ),
    (["press", "wts-0614-34", "--indenter", "sphere:radius=5mm", "--load", "5"], "--load: '5' has no unit"),
    (["press", "wts-0614-34", "--indenter", "sphere:radius=5mm", "--load", "0N"], "--load: must be positive"),
    (["press", "wts-0614-34", "--indenter", "sphere:radius=5mm", "--depth", "3mm"], "--depth: at a depth of 3 mm"),
    (["press", "wts-0614-34", "--indenter", "sphere:radius=5mm", "--load", "1N", "--at=1m,0m"], "is not on the array"),
    (
        ["press", "wts-0614-34", "--indenter", "sphere:radius=5mm", "--load", "1N", "--yaw=45"],
        "--yaw: '45' has no unit",
    ),
    (["press", "wts-0614-34", "--indenter", "sphere:radius=5mm", "--load", "1N", "--model=fen"], "did you mean 'fem'"),
    (["export", "wts-0614-34", "--format", "usd"], "unknown format 'usd'; did you mean 'sdf'? accepted: mjcf, gazebo"),
    (["export", "wts-0614-34", "--mass", "20g"], "--mass: mjcf holds massless boxes"),
    (["export", "wts-0614-34", "--format", "sdf", "--mass", "20mm"], "is not a unit of mass"),
    (["export", "wts-0614-34", "--format", "urdf", "--mass=-1g"], "--mass: must be positive"),
    (["derive", "wts-0614-34", "--layer", "2:thickness=1mm"], "--layer: the cover has no layer 2"),
    (["press", "wts-0614-34", "--indenter", "tip", "--load", "1N", "--layer", "1:E=1MPa"], "mean 'youngs_modulus'"),
    (["datasheet", "wts-0614-34", "--out", "sheet.pdf"], "sheet.pdf is neither .md nor .html"),
    (["validate", "wts-0614-34", "--recordings", "nowhere"], "nowhere: no such folder"),
    (["dervie", "wts-0614-34"], "did you mean 'derive'"),
    (["store", "--json", "lst"], "unknown action 'lst'; did you mean 'list'"),
    (["--json", "press"], "--json: unknown option; the options of a command follow its name"),
]


@pytest.mark.parametrize(("words", "expected"), BAD, ids=[" ".join(words) for words, _ in BAD])
def test_bad_input_is_one_line_and_status_2(softcover, tmp_path, words, expected):
    status, out, err = softcover(*words)
    assert status == 2
    assert expected in err
    assert out == ""
    assert all(line.startswith("softcover: ") for line in err.splitlines())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", [["demo"], ["derive", "wts-0614-34"], ["export", "wts-0614-34", "--thickness=1mm"]])
def test_unwritable_out_is_found_before_the_work(softcover, command, without_reference):
    status, _, err = softcover(*command, "--out", "/proc/no/report")
    assert status == 3
    assert err.startswith("softcover: /proc/no/report: cannot be written")


def test_out_folder_of_somebody_else_is_left_alone(softcover, tmp_path):
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "thesis.tex").write_text("years of work")
    status, _, err = softcover("export", "wts-0614-34", "--out", "home")
    assert status == 2
    assert "softcover did not write" in err
    assert (tmp_path / "home" / "thesis.tex").read_text() == "years of work"


@pytest.mark.parametrize(
    "words",
    [
        ["store", "list"],
        ["store", "verify"],
        ["store", "prune", "--dry-run"],
        ["materials"],
        ["materials", "dragon-skin-30"],
        ["materials", "--hardness", "30"],
        ["doctor"],
        ["datasheet", "sdh2-distal"],
        ["export", "wts-0614-34"],
        ["view", "wts-0614-34", "--indenter", "tip", "--load", "1N", "--seconds", "0.1"],
    ],
    ids=" ".join,
)
def test_the_keys_of_json_output_are_documented(softcover, words):
    status, out, _ = softcover(*words, "--json")
    assert status == 0
    documented = set(re.findall(r"`(\w+)`", DOCUMENTED_KEYS.read_text()))
    assert set(json.loads(out)) <= documented


@pytest.mark.parametrize(
    "words", [["materials"], ["datasheet", "wts-0614-34"], ["doctor", "--json"], ["--help"]], ids=" ".join
)
def test_a_reader_that_ends_early_is_told_nothing(words):
    """The pipe is closed before the command writes, as by `head` after its last line."""
    code = f"from validation.cli import main\nmain({words!r})"
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)  # noqa: S603 -- ours
    process.stdout.close()
    assert process.stderr.read() == ""
    assert process.wait() == 141


@pytest.mark.parametrize("words", [["derive"], ["regress", "wts-0614-34", "--baseline"], ["mesh"]], ids=" ".join)
def test_a_folder_in_place_of_a_file_is_named(softcover, tmp_path, words):
    status, out, err = softcover(*words, str(tmp_path))
    assert (status, out) == (2, "")
    assert f"{tmp_path}: is a folder; name a file" in err


def test_ctrl_c_is_status_130(softcover, monkeypatch):
    def interrupt(**_):
        raise KeyboardInterrupt

    monkeypatch.setattr("fem_reference.result_store.entries", interrupt)
    assert softcover("store", "list") == (130, "", "softcover: interrupted\n")


def test_a_programming_error_keeps_its_traceback(softcover, monkeypatch):
    def fail(**_):
        raise ZeroDivisionError

    monkeypatch.setattr("fem_reference.result_store.entries", fail)
    with pytest.raises(ZeroDivisionError):
        main(["store", "list"])


@given(word=st.text("abcdefghijklmnopqrstuvwxyz-", min_size=1, max_size=12).filter(lambda word: word[0] != "-"))
def test_an_unknown_command_is_answered_with_all_known_ones(word):
    assume(word not in _COMMANDS)
    messages = io.StringIO()
    with pytest.raises(SystemExit) as left, contextlib.redirect_stderr(messages):
        main([word])
    assert left.value.code == 2
    (line,) = messages.getvalue().splitlines()
    assert line.startswith(f"softcover: unknown command {word!r}; ")
    assert all(name in line.split("accepted: ")[1].split(", ") for name in _COMMANDS)


def test_a_note_is_written_only_by_a_command_that_succeeds(softcover, tmp_path):
    softcover("init", tmp_path / "own.toml")
    touch = ("--indenter", "sphere:radius=5mm", "--load", "1N")
    status, _, err = softcover("press", tmp_path / "own.toml", *touch, "--model", "slow")
    assert status == 2
    assert err.splitlines() == ["softcover: --model: unknown model 'slow'; accepted: fem, fast"]
    status, _, err = softcover("emulate", "x", "--fault", "lose=2")
    assert (status, err) == (2, "softcover: --fault: the rate of lose must lie in 0..1, not 2.0\n")


def test_a_folder_in_place_of_a_file_is_bad_input(softcover, tmp_path):
    (tmp_path / "dir").mkdir()
    for words in (("derive", "dir"), ("regress", "dir"), ("replay", "dir"), ("calibrate", "dir")):
        status, out, err = softcover(*words)
        assert (status, out) == (2, ""), words
        assert len(err.splitlines()) == 1


def test_ctrl_c_while_a_compiled_module_loads(softcover, monkeypatch):
    """Such a module turns it into an ImportError."""

    def load(**_):
        raise ImportError("initialization failed") from KeyboardInterrupt()

    monkeypatch.setattr("fem_reference.result_store.entries", load)
    assert softcover("store", "list") == (130, "", "softcover: interrupted\n")


@pytest.mark.parametrize("name", ["stdout", "stderr"])
def test_a_stream_that_the_shell_closed_stops_nothing(monkeypatch, name):
    """As in `softcover materials >&-`; Python then has None in its place."""
    monkeypatch.setattr(sys, name, None)
    for words, status in ((["materials"], 0), (["export", "nothere"], 2)):
        with pytest.raises(SystemExit) as ended:
            main(words)
        assert ended.value.code == status


def test_many_faults_of_one_file_are_counted(softcover, tmp_path):
    (tmp_path / "c.toml").write_text("".join(f"k{number} = 1\n" for number in range(3000)))
    status, _, err = softcover("validate", "wts-0614-34", "--campaign", "c.toml")
    assert status == 2
    assert err.splitlines()[-1] == "softcover: c.toml: and 2980 more"
    assert len(err.splitlines()) == 21


def test_a_full_disk_behind_standard_error_ends_with_its_status():
    code = "from validation.cli import main; main(['derive', 'nothere'])"
    with Path("/dev/full").open("w") as full:
        ended = subprocess.run([sys.executable, "-c", code], stderr=full, check=False)  # noqa: S603 -- own code
    assert ended.returncode == 3


def test_a_request_to_terminate_ends_every_command_like_ctrl_c(monkeypatch, capsys):
    before = signal.getsignal(signal.SIGTERM)

    def run(*_, **__):
        signal.raise_signal(signal.SIGTERM)

    monkeypatch.setattr("validation.cli.entry.app", run)
    with pytest.raises(SystemExit) as raised:
        main(["materials"])
    assert raised.value.code == 130
    assert capsys.readouterr().err == "softcover: interrupted\n"
    assert signal.getsignal(signal.SIGTERM) is before


def test_a_command_outside_the_main_thread_leaves_signals_alone(capsys):
    ended = []

    def run():
        with pytest.raises(SystemExit) as raised:
            main(["materials"])
        ended.append(raised.value.code)

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert ended == [0]
    assert "dragon-skin-30" in capsys.readouterr().out
