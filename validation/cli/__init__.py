"""The command line: `softcover COMMAND`.

Each command is a function in a module of the folder `commands`.  The module is imported when the user runs the command
or opens a help page.  Heavy packages are imported only when the command runs.  The docstring of the function is the
command's help page.

`main` converts an error into one readable line per fault and an exit status: 0 done, 1 a check failed or accuracy
dropped, 2 bad input, 3 a file, a device or a missing package failed, 4 a solver did not converge, 130 interrupted.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

#: Exit status after Ctrl-C.  It repeats `INTERRUPTED` of `validation.cli.entry`, whose import takes too long here.
_INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one command of the command line, then end the process with the command's exit status.

    Args:
        arguments: Words after `softcover` on the command line; those of the present process if None.

    Raises:
        SystemExit: Always, with the exit status.
    """
    try:
        # Imported here, so that Ctrl-C during the import of modules has the same effect as later.
        from validation.cli.entry import main as run
    except KeyboardInterrupt:
        sys.stderr.write("softcover: interrupted\n")
        raise SystemExit(_INTERRUPTED) from None
    run(arguments)
