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
_ROW = re.compile(r"( +\S.*? {2,})\S")


class HelpText(argparse.HelpFormatter):
    """Lays out descriptions, epilogs and options: prose is filled, tables are kept."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, width=min(shutil.get_terminal_size().columns, WIDEST + 2) - 2)

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return fitted(text, width)

    def _split_lines(self, text: str, width: int) -> list[str]:
        return _wrap(" ".join(text.split()), width)


def fitted(text: str, width: int) -> str:
    """Return a text with lines of at most ``width`` characters; lines that fit are unchanged.

    Lines without indentation are prose. An indented line is a row of a table; two or more spaces
    separate its columns. Its continuation lines align with the second column, or are indented more
    than the row. A command stays on one line, so that it can be copied.
    """
    return "\n".join(line for block in _blocks(text.strip("\n")) for line in _laid(block, width))


def _blocks(text: str) -> Iterator[list[str]]:
    """Yield the lines of each paragraph, row and blank line."""
    block: list[str] = []
    for line in text.splitlines():
        if block and not _goes_on(block[0], line):
            yield block
            block = []
        block.append(line)
    yield block


def _goes_on(first: str, line: str) -> bool:
    if not line.strip() or not first.strip() or line.lstrip().startswith("#"):
        return False
    inward, row = _inward(line), _ROW.match(first)
    if row:
        return inward == len(row[1])
    return inward > _inward(first) if _inward(first) else not inward and not first.endswith(":")


def _laid(block: list[str], width: int) -> list[str]:
    if all(len(line) <= width for line in block):
        return block
    first, inward, row = block[0], " " * _inward(block[0]), _ROW.match(block[0])
    words = " ".join(line.strip() for line in block)
    is_command = words.startswith("fasaco-edge ")
    if row is None and not is_command:
        return _wrap(words, width, inward, inward and inward + "  ")
    begin = row[1] if row else first
    words = words[len(begin.strip()) :].strip()
    if is_command or len(begin) > width - LEAST_COLUMN:
        # The second column goes below the first.
        below = inward + "    "
        return [begin.rstrip(), *_wrap(words, width, below, below)]
    return _wrap(words, width, begin, " " * len(begin))


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
