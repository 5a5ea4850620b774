"""The command line: `softcover COMMAND`.

Each command is a function in `commands`.  Its module is imported when the command or a help page is asked for; heavy
packages are imported only when the command runs.  The docstring of the function is the help page.

`main` turns an error into one readable line per fault and an exit status: 0 done, 1 a gate or a check failed, 2 bad
input, 3 something outside failed, 4 a solver did not converge, 130 interrupted.
"""

from __future__ import annotations

from validation.cli.entry import app, main

__all__ = ["app", "main"]
