"""The command-line application `softcover`: its commands, the run of one, and the explanation of errors to the user."""

from __future__ import annotations

import codecs
import contextlib
import errno
import io
import math
import os
import shlex
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from cyclopts import (
    App,
    CycloptsError,
    Group,
    MissingArgumentError,
    Parameter,
    Token,
    UnknownCommandError,
    UnusedCliTokensError,
    convert,
)

from fem_reference.errors import ConvergenceError
from validation.cli.output import forget_notes, say, say_notes
from validation.errors import InputError, nearest
from validation.extras import EXTRAS, MissingExtraError

#: Exit status after success; `docs/json.md` explains all statuses.
DONE = 0
#: Exit status if a check failed, a wanted accuracy is not reached, or the acceptance criterion of a campaign is missed
#: or undecided.
CHECK_FAILED = 1
#: Exit status if an input is wrong.
BAD_INPUT = 2
#: Exit status if something outside the program failed, such as the disk, a device or a missing extra.
OUTSIDE_FAILED = 3
#: Exit status if the finite elements did not converge.
NOT_CONVERGED = 4
#: Exit status after Ctrl-C: 128 plus the number of the signal, 2, by the convention of shells.
INTERRUPTED = 130
#: Exit status when the reader of the output has ended, as in `softcover materials | head`: 128 plus the number of the
#: signal, 13.
PIPE_CLOSED = 141

#: Errors of the operating system that are due to the text of a path: a name that is too long, a file in place of a
#: folder or the reverse, or a cycle of links.
_PATH_FAULTS = {errno.ENAMETOOLONG, errno.ENOTDIR, errno.EISDIR, errno.EEXIST, errno.ELOOP, errno.EINVAL, errno.EILSEQ}
#: Errors of a full disk or quota.  Files name themselves in theirs, so that others are of standard output.
_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
#: What helps against an error of a path.
_REMEDIES = {
    errno.ENAMETOOLONG: "take a shorter name",
    **dict.fromkeys((errno.EEXIST, errno.ENOTDIR), "a file stands where a folder is needed; name another place"),
}
#: Characters of messages and results, and what stands for them in an encoding that lacks them.
_PLAIN = {"±": "+-", "²": "2", "°": " deg", "µ": "u", "×": "x", "–": "-", "“": '"', "”": '"'}  # noqa: RUF001
#: Largest number of faults of a user's input that are printed, one line each [-].
_MOST_LINES = 50
#: Signals that asked the running command to end.
_INTERRUPTS: list[int] = []
#: Commands by purpose, in the order of the help page.
_GROUPS = {
    "Design": ("init", "materials", "derive", "mesh", "datasheet", "limits", "design", "sweep"),
    "Simulate": ("press", "view", "export"),
    "Prove": ("demo", "validate", "regress"),
    "Real sensor": ("record", "replay", "import", "calibrate", "locate", "emulate"),
    "Housekeeping": ("doctor", "store"),
}
_COMMANDS = tuple(name for names in _GROUPS.values() for name in names)
#: Options of the program itself, which the help page lists below the commands.
_OPTIONS = ("--help", "--install-completion", "--version")
#: What to do next after a command that succeeded, by command; `{0}` is the command's first argument, and the words in
#: capitals are the user's to fill in.  An empty name stands for the program without arguments.
_NEXT = {
    "": "softcover doctor checks the installation; then softcover demo, or softcover init for a sensor of your own",
    "init": "softcover derive {0}",
    "derive": "softcover press {0} --indenter sphere:radius=5mm --load 5N; softcover validate {0} --quick",
    "mesh": "softcover derive {0} --out FOLDER",
    "datasheet": "softcover export {0} --out FOLDER writes the model for your simulation",
    "press": "softcover validate SENSOR --quick scores many touches",
    "view": "softcover export {0} --out FOLDER writes the model for your simulation",
    "demo": "open the report; softcover init writes a file for a sensor of your own",
    "validate": "softcover regress {0} --update stores what the model does now, so that CI notices a change",
    "regress": "run the same command without --update in CI; it ends with 1 when a value changes",
    "record": "softcover replay FILE shows the recording; softcover calibrate FILES --sensor SENSOR fits the sensor",
    "replay": "softcover calibrate {0} --sensor SENSOR fits the sensor, if the load is known",
    "import": "softcover calibrate FILES --sensor SENSOR fits the sensor",
    "calibrate": "softcover datasheet FILE shows the file that --out writes; --next N plans further touches",
}
#: Module and function in the folder `commands`, as `module:function`, for each command whose module or function has
#: another name than the command.
_PLACES = {"demo": "validate:demo", "replay": "recordings:replay", "import": "recordings:import_recording"}


def _convert(wanted: type, tokens: Sequence[Token]) -> object:
    """Convert the words of one option to its type, and refuse numbers that cyclopts would change or accept silently.

    cyclopts itself rounds 1.5 to a whole number and accepts nan.

    Raises:
        ValueError: If an option of a count is not a whole number, or another numeric option is not finite.
    """
    kinds: dict[object, tuple[type[int | float], str]] = {int: (int, "whole"), float: (float, "finite")}
    if wanted in kinds:
        kind, word = kinds[wanted]
        for token in tokens:
            try:
                valid = math.isfinite(kind(token.value)) and "_" not in token.value
            except (ValueError, OverflowError):
                valid = False
            if not valid:
                raise ValueError(f"{token.value[:40]!r} is not a {word} number")
    return convert(wanted, tokens)


def _show_default(value: object) -> str | None:
    """Return the text of a default value on a help page; None for a value that stands for `not given`."""
    return None if value is False or value in (None, "", ()) else str(value)


app = App(
    name="softcover",
    help=(
        "Tactile arrays under a soft cover: finite-element reference, fast MuJoCo model, "
        "and how far they agree.\n\n"
        "`softcover COMMAND --help` explains the options of a command."
    ),
    help_format="markdown",
    version=lambda: metadata.version("softcover"),
    default_parameter=Parameter(negative=(), converter=_convert, show_default=_show_default),
    suppress_keyboard_interrupt=False,
)
app.register_install_completion_command(help="Install completion of commands and options in this shell.")
for _order, (_title, _names) in enumerate(_GROUPS.items()):
    _group = Group(_title, sort_key=_order)
    for _rank, _name in enumerate(_names):
        _place = f"validation.cli.commands.{_PLACES.get(_name, f'{_name}:{_name}')}"
        app.command(_place, name=_name, group=_group, sort_key=_rank)
_group = Group("Options", sort_key=len(_GROUPS))
for _name in _OPTIONS:
    app[_name].group = _group


def _replace_character(error: UnicodeError) -> tuple[str | bytes, int]:
    """Replace a character that the encoding of the terminal lacks, so that no result is lost for a plus-minus sign.

    Bytes of file names that are no text, which Python decodes as lone surrogates, are written as they were.
    """
    if not isinstance(error, UnicodeEncodeError):
        raise error
    character = error.object[error.start]
    is_byte = "\udc80" <= character <= "\udcff"
    return bytes([ord(character) - 0xDC00]) if is_byte else _PLAIN.get(character, "?"), error.start + 1


codecs.register_error(_replace_character.__name__, _replace_character)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one command of the command line, then end the process with the command's exit status.

    Args:
        arguments: Words after `softcover` on the command line; those of the present process if None.

    Raises:
        SystemExit: Always, with the exit status.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # The shell closed the stream, as in `softcover materials >&-`.
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115 -- open until the end
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=_replace_character.__name__)
    try:
        with _note_interrupts():
            status = _run(list(sys.argv[1:] if arguments is None else arguments))
        sys.stdout.flush()  # fails again after a full disk, before the end of the process would write what is left
    except BrokenPipeError:
        _drop_output()
        status = PIPE_CLOSED
    except OSError:  # The disk behind standard output or standard error is full.
        if os.environ.get("SOFTCOVER_TRACEBACK"):
            raise
        _drop_output()
        status = OUTSIDE_FAILED
    raise SystemExit(status)


@contextlib.contextmanager
def _note_interrupts() -> Iterator[None]:
    """Note Ctrl-C, and treat SIGTERM like it, so that a command completes its file and removes its temporary folder.

    The note outlasts the exception, which some compiled libraries turn into one of their own.
    """
    if threading.current_thread() is not threading.main_thread():  # Only the main thread handles signals.
        yield
        return
    noted = _INTERRUPTS.copy()
    _INTERRUPTS.clear()
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    # A shell lets jobs in its background ignore Ctrl-C.  A handler of C code, None here, could not be restored.
    before = {each: handler for each, handler in handlers.items() if handler is not None and handler != signal.SIG_IGN}
    for number in before:
        signal.signal(number, _interrupt)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        _INTERRUPTS[:] = noted


def _interrupt(number: int, _: object) -> None:
    """Note a signal and interrupt the command."""
    _INTERRUPTS.append(number)
    raise KeyboardInterrupt


def _run(words: Sequence[str]) -> int:
    """Run one command, print its errors, and return the exit status.

    Raises:
        BrokenPipeError: If the program that reads the output has ended.
    """
    try:
        _refuse_unusable(words)
        if not words or words[0] not in _COMMANDS:
            # The list of all commands shows the first line of each command's docstring, so all modules are imported.
            for name in _COMMANDS:
                app[name]
        result = app(words, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except SystemExit as raised:
        if isinstance(raised.__context__, BrokenPipeError):  # The reader of a help page ended after its first lines.
            raise raised.__context__ from None
        raise
    except Exception as raised:  # noqa: BLE001 -- raised again if it is a programming error
        return _report_error(raised, words)
    except KeyboardInterrupt:
        return _report_interrupt()
    say_notes()
    status = result if isinstance(result, int) else DONE
    if status == DONE and not {"--json", "--help", "-h", *_OPTIONS} & set(words):
        _say_next(words)
    return status


def _say_next(words: Sequence[str]) -> None:
    """State in one line what to do after a command that succeeded; `words` are those after `softcover`."""
    command, placeholder, first = words[0] if words else "", "SENSOR", words[1:2]
    if command == "init":  # All its words but the names of options are the file that it writes.
        placeholder, first = "sensor.toml", [word.removeprefix("--out=").removeprefix("--path=") for word in words[1:]]
    if advice := _NEXT.get(command):
        first = next((shlex.quote(word) for word in first if not word.startswith("-")), placeholder)
        say(f"next: {advice.format(first)}")


def _report_error(raised: Exception, words: Sequence[str]) -> int:
    """Print an error, and return the exit status; raise a programming error again."""
    cause: BaseException | None = raised if isinstance(raised, ImportError) else None
    while cause is not None:  # A compiled module turns Ctrl-C during its import into an ImportError.
        if isinstance(cause, KeyboardInterrupt):
            return _report_interrupt()
        cause = cause.__cause__ or cause.__context__
    error = _clarify(raised, words)
    explanation = explain(error)
    traced = bool(os.environ.get("SOFTCOVER_TRACEBACK"))
    if explanation is None and _INTERRUPTS and not traced:
        # Either a library turned the interrupt into this error, or the error came later.
        return _report_interrupt(f"; {type(raised).__name__}: {raised}; SOFTCOVER_TRACEBACK=1 shows where")
    if explanation is None or traced:
        raise raised
    see = f"; see: softcover {_command(words)}--help" if isinstance(error, CycloptsError) else ""
    for line in explanation.lines[:_MOST_LINES]:
        say(f"softcover: {line.removesuffix('.')}{see}" if see else f"softcover: {line}")
    if (rest := len(explanation.lines) - _MOST_LINES) > 0:  # A damaged file may have a fault in each of its lines.
        say(f"softcover: ... and {rest} more faults; mend these first")
    forget_notes()
    return explanation.status


def _report_interrupt(error: str = "") -> int:
    """State that Ctrl-C ended the command, with which error if any, and return the exit status."""
    sys.stderr.write(f"softcover: interrupted{error}\n")
    forget_notes()
    return INTERRUPTED


def _drop_output() -> None:
    """Discard all further output, because the program that reads it, such as `head`, has ended or the disk is full."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):  # The stream is no file, as in tests.
            stream.flush()
        with contextlib.suppress(OSError, ValueError):
            os.dup2(nowhere, stream.fileno())
    forget_notes()


def _refuse_unusable(words: Sequence[str]) -> None:
    """Refuse words that cannot be file names: NUL, and characters that the file system cannot encode.

    Raises:
        InputError: If there is such a word.  Programs can pass one, a shell cannot.
    """
    faults = []
    for number, word in enumerate(words, start=1):
        try:
            fault = "holds a NUL character" if b"\0" in os.fsencode(word) else ""
        except UnicodeEncodeError as error:
            fault = f"holds a character that cannot be encoded as {error.encoding}"
        if fault:
            faults.append(f"argument {number}, {word[:80]!r}, {fault}; accepted: text that can name a file")
    if faults:
        raise InputError(*faults)


def _clarify(error: Exception, words: Sequence[str]) -> Exception:
    """Replace three kinds of errors of the argument parser by errors that name the accepted values.

    Args:
        error: Error of a command; errors of other kinds are returned unchanged.
        words: The words after `softcover` on the command line.
    """
    if isinstance(error, UnknownCommandError):
        if words[0].startswith("-"):
            return InputError(f"{words[0]}: unknown option; the options of a command follow its name")
        group, kind, rest = (app[words[0]], "action", words[1:]) if words[0] in _COMMANDS else (app, "command", words)
        word = next((word for word in rest if not word.startswith("-")), rest[0])
        known = [name for name in group if not name.startswith("-")]
        return InputError(f"unknown {kind} {word!r}; {nearest(word, known)}")
    if isinstance(error, UnusedCliTokensError):
        return InputError(
            f"unexpected {', '.join(map(repr, error.unused_tokens or ()))}; see: softcover {_command(words)}--help"
        )
    return _explain_missing(error, words) if isinstance(error, MissingArgumentError) and error.argument else error


def _explain_missing(error: MissingArgumentError, words: Sequence[str]) -> InputError:
    """Explain a missing argument: by an option that the command does not know, by a missing value, or by itself."""
    name = error.argument.name  # type: ignore[union-attr]  # the caller has checked it
    arguments = app[words[0]].assemble_argument_collection()
    known = sorted({each for one in arguments for each in one.names if each.startswith("--") and each[:5] != "--no-"})
    given = [word.partition("=")[0] for word in words[1:] if word.startswith("--")]
    if unknown := [word for word in given if word not in known]:
        return InputError(f"unknown option {unknown[0]}; {nearest(unknown[0], known)}")
    if name in words:
        return InputError(f"{name} has no value; one that begins with a hyphen stands behind `=`: {name}=...")
    if error.argument.index is not None:  # type: ignore[union-attr]  # A positional one is named as in the help: SENSOR.
        name = name.lstrip("-").upper()
    return InputError(f"{name} is missing; `softcover {_command(words)}--help` has examples")


def _command(words: Sequence[str]) -> str:
    """Return the name of the command among the words of the command line, and a blank; empty if there is none."""
    return f"{words[0]} " if words and words[0] in _COMMANDS else ""


@dataclass(frozen=True, kw_only=True)
class Explanation:
    """Explanation of an error to the user: the lines to print, and the exit status of the command."""

    lines: tuple[str, ...]
    status: int


def explain(error: Exception) -> Explanation | None:
    """Explain an error to the user.

    Returns:
        Lines to print and exit status; None for a programming error, which needs a traceback.
    """
    text, status = " ".join(str(error).split()), BAD_INPUT
    match error:
        case ImportError():
            missing = _find_missing_extra(error)
            if missing is None:
                return None
            text, status = str(missing), OUTSIDE_FAILED
        case ConvergenceError():
            status = NOT_CONVERGED
        case MemoryError():
            text, status = "not enough memory for this input", OUTSIDE_FAILED
        case OSError():
            reason = str(error.strerror or error)
            place = error.filename or ("standard output" if error.errno in _FULL else "")
            text = "; ".join(filter(None, [f"{place}: {reason}" if place else reason, _REMEDIES.get(error.errno or 0)]))
            of_path = any(getattr(each, "errno", None) in _PATH_FAULTS for each in (error, error.__cause__))
            status = BAD_INPUT if of_path else OUTSIDE_FAILED
        case InputError():
            return Explanation(lines=error.faults, status=status)
        case CycloptsError() | ValueError():  # All packages of softcover raise subclasses of ValueError for bad input.
            pass
        case _:
            return None
    return Explanation(lines=(text,), status=status)


def _find_missing_extra(error: BaseException | None) -> MissingExtraError | None:
    """Find out whether an import error, or one of its causes, is due to an optional module that is not installed.

    Returns:
        An error that names the extra to install; None if no optional module is missing.
    """
    while error is not None and not isinstance(error, MissingExtraError):
        module = str(getattr(error, "name", "")).split(".")[0]
        error = MissingExtraError(module) if module in EXTRAS else error.__cause__
    return error
