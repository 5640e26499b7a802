"""Index of the campaigns: what each looks for, and the command of its full form.

    python -m tests.campaigns

A campaign takes minutes to days; its short form is a test beside it.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

from rich.console import Console
from rich.table import Table

HERE = Path(__file__).parent
COMMAND = re.compile(
    r"((?:PYTHONPATH=\S+ )?python -m (tests\.campaigns\.\w+).*?)\s*(?:#.*)?$", re.M
)


def campaigns() -> list[tuple[str, str]]:
    """Return command and purpose of each campaign, by name."""
    found = []
    for path in sorted([*HERE.glob("*.py"), *HERE.glob("*/__main__.py")]):
        about = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        name = path.parent.name if path.stem == "__main__" else path.stem
        command = COMMAND.search(about)
        if command is not None and command[2] == f"tests.campaigns.{name}":
            found.append((command[1].rstrip("`"), about.splitlines()[0].rstrip(":;,")))
    return found


def main() -> None:
    """Print the index."""
    table = Table("command", "what it looks for", show_lines=True)
    for row in campaigns():
        table.add_row(*row)
    Console().print(table)


if __name__ == "__main__":
    main()
