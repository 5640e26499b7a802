"""Visible screen of a terminal, computed from all that was written to it."""

from __future__ import annotations

import re

_ESCAPE = re.compile(r"\x1b\[([0-9;?]*)([A-Za-z])")
_TEXT = re.compile(r"[^\x1b\r\n]+")
# An incomplete escape at the end of the text.
_BEGUN = re.compile(r"\x1b(\[[0-9;?]*)?\Z")
_PAGE, _PAGE_END = "\x1b[?2026h", "\x1b[?2026l"


class Screen:
    """A terminal; its height is unlimited, except for its alternate screen.

    It knows the escapes that the commands use, and refuses all others.

    Attributes:
        columns: its width.
        wrapped: lines that were wider than the terminal, and continued on the next line.
        hides_cursor: whether its cursor is hidden.
        is_alternate: whether it shows the alternate screen.
    """

    def __init__(self, columns: int) -> None:
        self.columns = columns
        self.wrapped: list[str] = []
        self.hides_cursor = self.is_alternate = False
        self._rows, self._row, self._column = [""], 0, 0
        self._before = (self._rows, 0, 0)
        self._held = ""

    def lines(self) -> list[str]:
        """Return the visible lines; on the alternate screen with drawn spaces at their ends."""
        return self._rows if self.is_alternate else [text.rstrip() for text in self._rows]

    def feed(self, written: str) -> None:
        """Take in the text that is written next.

        Raises:
            AssertionError: it has an escape or character that commands do not use.
        """
        written, at = self._held + written, 0
        begun, page = _BEGUN.search(written), written.rfind(_PAGE)
        end = len(written) if begun is None else begun.start()
        if page > written.rfind(_PAGE_END):
            end = min(end, page)
        self._held = written[end:]
        while at < end:
            if text := _TEXT.match(written, at, end):
                self._write(text[0])
                at = text.end()
            elif escape := _ESCAPE.match(written, at, end):
                self._obey(*escape.groups())
                at = escape.end()
            else:
                assert written[at] in "\r\n", f"unexpected {written[at : at + 9]!r}"
                # The terminal driver adds a carriage return to a line end.
                self._go(self._row + (written[at] == "\n"), 0)
                at += 1

    def _go(self, row: int, column: int) -> None:
        self._row, self._column = row, column
        self._rows += [""] * (row + 1 - len(self._rows))

    def _write(self, text: str) -> None:
        assert text.isprintable(), f"unexpected character in {text!r}"
        while text:
            if self._column == self.columns:
                assert not self.is_alternate, f"a page is too wide: {self._rows[self._row]!r}"
                self.wrapped.append(self._rows[self._row])
                self._go(self._row + 1, 0)
            here, text = text[: self.columns - self._column], text[self.columns - self._column :]
            before, end = self._rows[self._row], self._column + len(here)
            self._rows[self._row] = f"{before:{self._column}}"[: self._column] + here + before[end:]
            self._column = end

    def _obey(self, numbers: str, kind: str) -> None:
        match numbers, kind:
            case (_, "m"):
                pass
            case ("?2026", "h" | "l"):
                pass
            case ("?25", "h" | "l"):
                self.hides_cursor = kind == "l"
            case ("?1049", "h"):
                self._before = (self._rows, self._row, self._column)
                self.is_alternate, self._rows, self._row, self._column = True, [""], 0, 0
            case ("?1049", "l"):
                self.is_alternate = False
                self._rows, self._row, self._column = self._before
            case ("2", "J"):
                # A real cursor would stay, but all commands move it before they write.
                self._rows, self._row, self._column = [""], 0, 0
            case ("2", "K"):
                self._rows[self._row] = ""
            case (count, "A"):
                self._go(max(self._row - int(count or 1), 0), self._column)
            case (place, "H") if self.is_alternate:
                row, column = map(int, place.split(";"))
                self._go(row - 1, column - 1)
            case _:
                raise AssertionError(f"unexpected ESC [{numbers}{kind}")
