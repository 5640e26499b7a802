"""Index of the campaigns: what each looks for, its command, and how long that takes.

    python -m tests.campaigns

A campaign takes minutes to days; its short form is a test, but of attack, arm64 and manual.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

from rich.console import Console
from rich.table import Table

HERE = Path(__file__).parent
COMMAND = re.compile(
    r"^ *((?:PYTHONPATH=\S+ )?python -m (tests\.campaigns\.\w+).*?)\s*(?:#.*)?$", re.M
)


TAKES = re.compile(r"^Takes (.+)\.$", re.M)


def campaigns() -> list[tuple[str, str, str]]:
    """Return command, purpose and approximate duration of each campaign, by name."""
    found = []
    for path in sorted([*HERE.glob("*.py"), *HERE.glob("*/__main__.py")]):
        about = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        name = path.parent.name if path.stem == "__main__" else path.stem
        command, takes = COMMAND.search(about), TAKES.search(about)
        if command is not None and command[2] == f"tests.campaigns.{name}":
            duration = "" if takes is None else takes[1]
            found.append((command[1], about.splitlines()[0], duration))
    return found


def main() -> None:
    """Print the index."""
    table = Table("command", "what it looks for", "takes", show_lines=True)
    for row in campaigns():
        table.add_row(*row)
    Console().print(table)


if __name__ == "__main__":
    main()
