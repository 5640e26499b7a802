"""deploy/README.md as a reader follows it: its commands and configurations, in order."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

MANUAL = Path(__file__).parents[2] / "deploy" / "README.md"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True, slots=True)
class Block:
    """A block of code.

    Attributes:
        section: the heading it stands under.
        kind: ``sh`` or ``yaml``.
        text: what it holds.
    """

    section: str
    kind: str
    text: str

    @property
    def commands(self) -> list[str]:
        """Its lines, if they are commands."""
        return self.text.splitlines() if self.kind == "sh" else []


def blocks() -> list[Block]:
    found = []
    for section in re.split(r"^## ", MANUAL.read_text(encoding="utf-8"), flags=re.MULTILINE):
        title, _, text = section.partition("\n")
        found += [Block(title, kind, code) for kind, code in BLOCK.findall(text)]
    return found
