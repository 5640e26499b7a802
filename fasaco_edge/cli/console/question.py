"""A question on the terminal, before something is lost."""

from __future__ import annotations

import sys

from fasaco_edge.cli.console.terminal import err


def may_ask() -> bool:
    """Return whether a person can read a question, and answer it."""
    return sys.stdin.isatty() and sys.stderr.isatty()


def agrees(*facts: str) -> bool:
    """Show facts, and ask whether to go on; all answers but yes mean no."""
    console = err()
    for fact in facts:
        console.print(fact)
    console.print("Go on? [y/N] ", end="")
    return sys.stdin.readline().strip().lower() in ("y", "yes")
