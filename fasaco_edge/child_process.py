"""Python processes that this one starts, and what they take over from it."""

from __future__ import annotations

import sys


def python_program(module: str, *words: str) -> list[str]:
    """Return the command line that runs a module with this interpreter.

    ``-m`` alone would search the working folder first, which may be anybody's. What was started in
    isolation goes on so: neither the environment nor a home folder says what is imported.
    """
    shut = "-I" if sys.flags.isolated else "-P"
    return [sys.executable, shut, "-m", module, *words]
