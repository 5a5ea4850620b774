"""The application, its commands by name, and the way from an error to an exit status."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from types import MappingProxyType

from cyclopts import App, CycloptsError, MissingArgumentError, Parameter, UnknownCommandError

from validation.cli.failures import explain
from validation.errors import InputError, nearest

#: What each command does, and examples for its help page.
_COMMANDS: Mapping[str, tuple[str, tuple[str, ...]]] = MappingProxyType(
    {
        "demo": (
            "The whole way on the default sensor: PSF, fit, scores against finite elements and recordings, report.",
            ("softcover demo", "softcover demo --out my-report", "softcover demo --recordings ~/recordings"),
        ),
        "derive": (
            (
                "Point spread function of a sensor's cover, and the fast model's parameters fitted to it.\n\n"
                "Prints sigma and ksize of the Gaussian kernel and how much of the load it misplaces, every other "
                "estimator's sigma, the two-point resolution (how far apart two equal touches must be to show a dip "
                "between them, at the base and with these texels), how sigma changes with thickness and Poisson ratio, "
                "and the error estimate of the finite elements.\n\n"
                "Young's modulus drops out of the point spread function: a softer cover of the same thickness and "
                "Poisson ratio spreads a given pressure just as far (of several layers the ratio of their moduli "
                "counts). It decides how deep and wide an indenter goes: see `softcover press`."
            ),
            (
                "softcover derive wts-0614-34",
                "softcover derive sensor.toml --out derived",
                "softcover derive wts-0614-34 --material dragon-skin-30 --thickness 3mm --json",
            ),
        ),
        "press": (
            "One indentation by the finite elements and by the fast model, and how far they agree.",
            (
                "softcover press wts-0614-34 --indenter sphere:radius=5mm --load 500g",
                "softcover press sensor.toml --indenter box:size=9mmx9mmx5mm --load 2N --at=1mm,-2mm --yaw=45deg",
                "softcover press wts-0614-34 --indenter cylinder:radius=4mm --depth 0.2mm --model fem --json",
            ),
        ),
        "view": (
            (
                "Live image of the fast model: the indenter comes down and slides in a circle.\n\n"
                "On a terminal it runs in real time until Ctrl-C, in the MuJoCo viewer's window where there is a "
                "display, else in the terminal; without a terminal for 5 s of the simulation as fast as it can.  Then "
                "the last image is printed."
            ),
            (
                "softcover view wts-0614-34 --indenter sphere:radius=5mm --load 500g",
                "softcover view wts-0614-34 --indenter sphere:radius=5mm --load 500g --display terminal",
                "softcover view sensor.toml --indenter box:size=6mmx6mmx5mm --load 2N --method boxes --seconds 10",
            ),
        ),
        "validate": (
            "Score the fast model of a sensor against finite elements, and against recordings where given.",
            (
                "softcover validate sensor.toml --out my-report",
                "softcover validate sdh2-distal --recordings ~/recordings",
                "softcover validate wts-0614-34 --material dragon-skin-30 --thickness 2mm --json",
            ),
        ),
        "record": (
            "Record a real sensor as MCAP, with a live image.",
            (
                "softcover record /dev/ttyACM0 --indenter sphere:radius=5mm --load 500g --seconds 10",
                "softcover record /dev/ttyACM0 --out touch.mcap --note 'third trial' --reconnect 5",
            ),
        ),
        "replay": (
            "Show a recording of any known format in the terminal.",
            (
                "softcover replay touch.mcap",
                "softcover replay A1.dsa --array 1 --csv a1.csv",
                "softcover replay run.bag --json",
            ),
        ),
        "import": (
            "Bring a recording of any known format into one labelled form.",
            (
                "softcover import A1.dsa --indenter box:size=10.5mmx10.5mmx5mm --load 200g",
                "softcover import run.bag --topic /tactile/image --out run.mcap",
                "softcover import table.csv --rows 14 --columns 6",
            ),
        ),
        "calibrate": (
            "What a real sensor does with force: characteristic, gains and more, each with its interval.",
            (
                "softcover calibrate 200g.mcap 400g.mcap 600g.mcap 800g.mcap",
                "softcover calibrate *.mcap --array 1 --threshold 100 --sensor sensor.toml --out calibrated.toml",
            ),
        ),
        "emulate": (
            "Stand in for a sensor on a port that speaks its protocol, for tests without the device.",
            (
                "softcover emulate /tmp/wts",
                "softcover emulate /tmp/wts --show touch.mcap --fault lose=0.01",
                "softcover emulate /tmp/wts --show derived --indenter sphere:radius=5mm --load 8N",
            ),
        ),
        "regress": (
            "Compare the fast model's accuracy with a stored baseline; leave with 1 when it dropped.",
            (
                "softcover regress wts-0614-34 --baseline baseline.json --update",
                "softcover regress wts-0614-34 --baseline baseline.json",
            ),
        ),
        "init": (
            "Write a commented sensor file to start from.",
            ("softcover init", "softcover init my-sensor.toml"),
        ),
        "materials": (
            "The materials that a cover can be made of by name, one of them, or a modulus from a hardness.",
            (
                "softcover materials",
                "softcover materials dragon-skin-30",
                "softcover materials --hardness 30",
                "softcover materials --json",
            ),
        ),
        "store": (
            (
                "The results that the reference keeps: list them, check them, remove them.\n\n"
                "Each one is found again by its whole input and the version of the code. They lie in the user's cache "
                "folder, or in the folder that the environment variable SOFTCOVER_STORE names."
            ),
            ("softcover store list", "softcover store verify", "softcover store prune"),
        ),
        "export": (
            "The sensor for other simulators: an MJCF model or a Gazebo block, and the fast model's parameters.",
            (
                "softcover export wts-0614-34 --format mjcf --out wts",
                "softcover export wts-0614-34 --format mjcf --method boxes --json",
                "softcover export sensor.toml --format mjcf --material dragon-skin-30 --thickness 2mm",
            ),
        ),
        "doctor": (
            "Say what is installed, what is missing and the command that brings it.",
            ("softcover doctor", "softcover doctor --json", "softcover doctor --port /dev/ttyACM0"),
        ),
    }
)

#: What the actions of a command do, and examples.
_ACTIONS: Mapping[str, Mapping[str, tuple[str, tuple[str, ...]]]] = MappingProxyType(
    {
        "store": {
            "list": (
                "List the kept results with what they are, size and age, newest first.",
                ("softcover store list", "softcover store list --json"),
            ),
            "verify": (
                "Read every kept result and check it; leave with 1 when one is damaged, and say which.",
                ("softcover store verify", "softcover store verify --json"),
            ),
            "prune": (
                "Remove kept results and say which: those of other code versions, or those that the options choose.",
                (
                    "softcover store prune",
                    "softcover store prune --older-than 30d --dry-run",
                    "softcover store prune --keep-latest 100",
                    "softcover store prune --all",
                ),
            ),
        },
    }
)

#: Commands whose name cannot be that of a function.
_TARGETS = {"import": "validation.cli.import_file:import_file"}


def _version() -> str:
    try:
        return version("softcover")
    except PackageNotFoundError:
        return "unknown"


app = App(
    name="softcover",
    help=(
        "Tactile arrays under a soft cover: finite-element reference, fast MuJoCo model, "
        "and how far they agree.\n\n"
        "Start with `softcover demo`, or with `softcover init` and `softcover derive sensor.toml`."
    ),
    version=_version,
    default_parameter=Parameter(negative=()),
)


def _about(text: str, examples: Sequence[str]) -> dict[str, str]:
    """What the help page of a command says."""
    return {"help": text, "help_epilogue": "Examples:\n\n" + "\n\n".join(f"    {example}" for example in examples)}


for _name, (_help, _examples) in _COMMANDS.items():
    if _name in _ACTIONS:
        _group = App(name=_name, **_about(_help, _examples))  # type: ignore[arg-type]
        for _action, _texts in _ACTIONS[_name].items():
            _group.command(f"validation.cli.{_name}:{_action}_entries", name=_action, **_about(*_texts))
        app.command(_group)
    else:
        _target = _TARGETS.get(_name, f"validation.cli.{_name}:{_name}")
        app.command(_target, name=_name, **_about(_help, _examples))


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one command and leave with its exit status.

    Args:
        arguments: The words after `softcover`; those of the process when not given.

    Raises:
        SystemExit: Always, with the exit status.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        result = app(words, exit_on_error=False, print_error=False, result_action="return_value")
    except Exception as raised:
        error = raised
        if isinstance(error, UnknownCommandError):
            error = _unknown(words)
        elif isinstance(error, MissingArgumentError) and error.argument is not None:
            error = InputError(f"{error.argument.name} is missing; `softcover {_command(words)}--help` has examples")
        explanation = explain(error)
        if explanation is None or os.environ.get("SOFTCOVER_TRACEBACK"):
            raise
        for line in explanation.lines:
            sys.stderr.write(f"softcover: {line}\n")
        if isinstance(error, CycloptsError):
            sys.stderr.write(f"softcover: see: softcover {_command(words)}--help\n")
        raise SystemExit(explanation.status) from None
    except KeyboardInterrupt:
        sys.stderr.write("softcover: interrupted\n")
        raise SystemExit(130) from None
    raise SystemExit(result if isinstance(result, int) else 0)


def _unknown(words: Sequence[str]) -> InputError:
    """A word that is no command, or no action of its command."""
    if words[0] in _ACTIONS:
        return InputError(f"unknown action {words[1]!r}; {nearest(words[1], _ACTIONS[words[0]])}")
    return InputError(f"unknown command {words[0]!r}; {nearest(words[0], _COMMANDS)}")


def _command(words: Sequence[str]) -> str:
    return f"{words[0]} " if words and words[0] in _COMMANDS else ""
