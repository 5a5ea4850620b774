import contextlib
import json
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from validation.cli.entry import _COMMANDS, app, main

DOCUMENTED_KEYS = Path(__file__).parents[3] / "docs" / "json.md"
PAGES = [[name] for name in _COMMANDS] + [["store", action] for action in ("list", "verify", "prune")]


#: Options of texts that may begin with a minus sign; that of a number may always.
SIGNED = {"--load", "--depth", "--at", "--direction", "--yaw", "--tilt", "--friction", "--thickness", "--mass"} | {
    "--accuracy",
    "--seconds",
    "--reconnect",
    "--force-delay",
    "--hold",
    "--tip",
    "--budget",
    "--older-than",
    "--place-error",
    "--shift-error",
    "--step",
    "--noise",
    "--two",
    "--radius",
    "--pitch",
    "--ball",
}


@pytest.mark.parametrize("page", PAGES, ids=" ".join)
def test_help_has_examples_and_explains_every_option_and_a_quantity_may_begin_with_a_minus_sign(softcover, page):
    status, out, _ = softcover(*page, "--help")
    assert status == 0
    assert f"softcover {' '.join(page)}" in out.split("Examples of use")[1]
    command = app
    for word in page:
        command = command[word]
    options = command.assemble_argument_collection(parse_docstring=True) if command.default_command else ()
    for argument in options:
        name, parameter = argument.names[0], argument.parameter
        if name == "*":  # a group of options
            continue
        assert parameter.help, name
        assert parameter.help[0].isupper() or parameter.help[0] == "`", name
        assert parameter.help.endswith("."), name
        assert bool(parameter.allow_leading_hyphen) == (name in SIGNED), name
    examples = [line.split() for line in command.help.splitlines() if line.strip().startswith("softcover ")]
    used = {word.split("=")[0] for words in examples for word in words if word.startswith("--")}
    assert all(words[1 : 1 + len(page)] == page for words in examples)
    assert used <= {name for argument in options for name in argument.names} or not options


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


@pytest.mark.parametrize("command", [["demo"], ["derive", "wts-0614-34"], ["export", "wts-0614-34", "--thickness=1mm"]])
def test_unwritable_out_is_found_before_the_work(softcover, command, without_reference):
    status, _, err = softcover(*command, "--out", "/proc/no/report")
    assert status == 3
    assert err.startswith("softcover: /proc/no/report: cannot be written")


@pytest.mark.parametrize(
    "command",
    [
        "store list",
        "store verify",
        pytest.param("store prune --dry-run", marks=pytest.mark.slow),
        "materials",
        "materials dragon-skin-30",
        "materials --hardness 30",
        "doctor",
        "datasheet sdh2-distal",
        "export wts-0614-34",
        pytest.param("limits sdh2-distal --noise 5mN", marks=pytest.mark.slow),
        "design sdh2-distal --thickness 2mm --noise 5mN",
        "view wts-0614-34 --indenter tip --load 1N --seconds 0.1",
    ],
)
def test_the_keys_of_json_output_are_documented(softcover, command):
    status, out, _ = softcover(*command.split(), "--json")
    assert status == 0
    assert set(json.loads(out)) <= set(re.findall(r"`(\w+)`", DOCUMENTED_KEYS.read_text()))


@pytest.mark.parametrize("words", [pytest.param(["materials"], marks=pytest.mark.slow), ["--help"]], ids=" ".join)
def test_a_reader_that_ends_early_is_told_nothing(words):
    """The pipe is closed before the command writes, as by `head` after its last line."""
    code = f"from validation.cli import main\nmain({words!r})"
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)  # noqa: S603 -- ours
    process.stdout.close()
    assert process.stderr.read() == ""
    assert process.wait() == 141


#: Ctrl-C, also as a compiled module raises it while it loads.
LOADING = ImportError("initialization failed")
LOADING.__cause__ = KeyboardInterrupt()


@pytest.mark.parametrize("error", [KeyboardInterrupt(), LOADING, ZeroDivisionError()], ids=repr)
def test_ctrl_c_is_status_130_and_a_programming_error_keeps_its_traceback(softcover, monkeypatch, error):
    def fail(**_):
        raise error

    monkeypatch.setattr("fem_reference.result_store.entries", fail)
    if isinstance(error, ZeroDivisionError):
        with pytest.raises(ZeroDivisionError):
            main(["store", "list"])
    else:
        assert softcover("store", "list") == (130, "", "softcover: interrupted\n")


def test_a_note_is_written_only_by_a_command_that_succeeds(softcover, tmp_path):
    softcover("init", tmp_path / "own.toml")
    touch = ("--indenter", "sphere:radius=5mm", "--load", "1N")
    status, _, err = softcover("press", tmp_path / "own.toml", *touch, "--model", "slow")
    assert status == 2
    assert err.splitlines() == ["softcover: --model: unknown model 'slow'; accepted: fem, fast"]


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


@pytest.mark.slow
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


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_error_after_an_interrupt_is_named_beside_it(monkeypatch, capsys, number):
    """A compiled library may turn the interrupt into an error; the next command knows nothing of the interrupt."""
    before = signal.getsignal(number)

    def run(words, **_):
        with contextlib.suppress(KeyboardInterrupt):
            if words == ["materials"]:
                signal.raise_signal(number)
        raise SystemError("no exception set")

    monkeypatch.setattr("validation.cli.entry.app", run)
    with pytest.raises(SystemExit) as raised:
        main(["materials"])
    said = "softcover: interrupted; SystemError: no exception set; SOFTCOVER_TRACEBACK=1 shows where\n"
    assert (raised.value.code, capsys.readouterr().err) == (130, said)
    assert signal.getsignal(number) is before
    with pytest.raises(SystemError):
        main(["store"])


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_command_that_ignores_a_signal_goes_on(monkeypatch, number):
    """As a shell starts jobs in its background."""
    monkeypatch.setattr("validation.cli.entry.app", lambda *_, **__: signal.raise_signal(number))
    before = signal.signal(number, signal.SIG_IGN)
    try:
        with pytest.raises(SystemExit) as raised:
            main(["materials"])
        assert signal.getsignal(number) is signal.SIG_IGN
    finally:
        signal.signal(number, before)
    assert raised.value.code == 0


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
