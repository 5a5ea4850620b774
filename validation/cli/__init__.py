"""The command line: `softcover COMMAND`.

Each command is a function in a module of the folder `commands`.  The module is imported when the user runs the command
or opens a help page; heavy packages are imported only when the command runs.  The docstring of the function is the
command's help page.

`main` converts an error into one readable line per fault and an exit status: 0 done, 1 a check failed or accuracy
dropped, 2 bad input, 3 a file, a device or a missing package failed, 4 a solver did not converge, 130 interrupted.
"""

from __future__ import annotations

from validation.cli.entry import app, main

__all__ = ["app", "main"]
