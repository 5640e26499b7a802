"""The text of ``--help``, laid out for the width of the terminal."""

from __future__ import annotations

import argparse
import re
import shutil
import textwrap
from collections.abc import Iterator

# Longer lines are hard to read [characters].
WIDEST = 100
# Least width of the second column of a row [characters].
LEAST_COLUMN = 24
_QUOTED = re.compile(r"'[^']*'|\"[^\"]*\"")
_ROW = re.compile(r"( +\S.*? {2,})\S")


class HelpText(argparse.HelpFormatter):
    """Lays out descriptions and epilogs as well as options: prose is filled, tables are kept."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, width=min(shutil.get_terminal_size().columns, WIDEST + 2) - 2)

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return fitted(text, width)

    def _split_lines(self, text: str, width: int) -> list[str]:
        return _wrap(" ".join(text.split()), width)


def fitted(text: str, width: int) -> str:
    """Return a text with lines of at most ``width`` characters; those that fit stay as they are.

    Lines that are not indented are prose. An indented line is a row: what it goes on with stands
    below its second column, which follows two spaces, or further in than the row. A command that
    is too long is continued as a shell reads it.
    """
    return "\n".join(line for block in _blocks(text.strip("\n")) for line in _laid(block, width))


def _blocks(text: str) -> Iterator[list[str]]:
    """Yield the lines of each paragraph, row and gap."""
    block: list[str] = []
    for line in text.splitlines():
        if block and not _goes_on(block, line):
            yield block
            block = []
        block.append(line)
    yield block


def _goes_on(block: list[str], line: str) -> bool:
    first = block[0]
    if not line.strip() or not first.strip():
        return False
    inward = _inward(line)
    if not _inward(first):
        return inward == 0 and not first.endswith(":")
    row = _ROW.match(first)
    if line.lstrip().startswith("#"):
        return False
    return inward == len(row[1]) if row else inward > _inward(first)


def _laid(block: list[str], width: int) -> list[str]:
    """Return the lines of a block for a width."""
    if all(len(line) <= width for line in block):
        return block
    first, rest = block[0], [line.strip() for line in block[1:]]
    inward, row = _inward(first), _ROW.match(first)
    if not inward:
        return _wrap(" ".join([first, *rest]), width)
    begin = row[1] if row else " " * inward
    words = " ".join([first[len(begin) :], *rest])
    is_command = first.strip().startswith("fasaco-edge ")
    if len(begin) > width - LEAST_COLUMN or (is_command and row is None):
        # The second column stands below the first.
        above, words = (begin, words) if row else (first, " ".join(rest))
        below = " " * (inward + 4)
        head = _command(above, width) if is_command else [above.rstrip()]
        return [*head, *_wrap(words, width, below, below)]
    # A comment in a file goes on as one.
    after = "# " if words.startswith("#") else "" if row else "  "
    return _wrap(words, width, begin, " " * len(begin) + after)


def _command(line: str, width: int) -> list[str]:
    """Return a command on several lines, as a shell reads it: no option without its value."""
    begin = " " * _inward(line)
    glued = _QUOTED.sub(lambda quoted: quoted[0].replace(" ", "\0"), line.strip())
    glued = re.sub(r"(--\S+) (?![-|])", "\\1\0", glued)
    lines = _wrap(glued, width - 2, begin, begin + "  ")
    return " \\\n".join(lines).replace("\0", " ").split("\n")


def _wrap(words: str, width: int, begin: str = "", below: str = "") -> list[str]:
    return textwrap.wrap(
        words,
        width,
        initial_indent=begin,
        subsequent_indent=below,
        break_long_words=False,
        break_on_hyphens=False,
    )


def _inward(line: str) -> int:
    return len(line) - len(line.lstrip())
