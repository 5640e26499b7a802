"""Sanitized standard output and error: no printed text can control a terminal.

Tracebacks and the parser's errors are sanitized here. Tables and progress bars, which need escape
sequences, are sanitized by ``cli.console.terminal``.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from io import TextIOWrapper
from typing import Any, TextIO, cast

from fasaco_edge.text import json_line, lines


class CleanStream:
    """A text stream that escapes control characters, except line ends and tabs.

    While a progress bar is shown, the bar's console prints the lines above it. The stream stays the
    same object, as the handler of the log refers to it.
    """

    def __init__(self, stream: TextIO) -> None:
        # Rich writes to the stream of this name, so that its escape sequences are kept.
        self.rich_proxied_file = stream
        self._print: Callable[[str], None] | None = None
        self._begun = ""
        self._lock = threading.RLock()

    def write(self, text: str) -> int:
        """Write ``text``; return its length."""
        with self._lock:
            if self._print is None:
                self.rich_proxied_file.write(lines(text))
            else:
                whole, end, self._begun = (self._begun + lines(text)).rpartition("\n")
                if end:
                    self._print(whole)
        return len(text)

    @contextmanager
    def printed_by(self, print_lines: Callable[[str], None]) -> Iterator[None]:
        """Within the context, pass whole lines to ``print_lines``; at its end, a partial line."""
        with self._lock:
            self._print = print_lines
        try:
            yield
        finally:
            with self._lock:
                self._print, begun, self._begun = None, self._begun, ""
                self.rich_proxied_file.write(begun)

    def writelines(self, texts: Iterable[str]) -> None:
        """Write all texts."""
        for text in texts:
            self.write(text)

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the stream has
        return getattr(self.rich_proxied_file, name)


def open_missing_streams() -> None:
    """Open /dev/null for each standard stream that the caller has closed.

    Otherwise the next opened file or socket gets the stream's number, and with it all output.
    """
    for number, (name, mode) in enumerate((("stdin", "r"), ("stdout", "w"), ("stderr", "w"))):
        try:
            os.fstat(number)
        except OSError:
            # open returns the lowest free number, which is this one.
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, mode, encoding="utf-8", closefd=False))


def clean_streams() -> None:
    """Sanitize all output of this process from now on."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is not None and not isinstance(stream, CleanStream):
            # Characters that the locale lacks are escaped: names may have any.
            if isinstance(stream, TextIOWrapper):
                stream.reconfigure(errors="backslashreplace")
            setattr(sys, name, cast("TextIO", CleanStream(stream)))


@contextmanager
def printed_by(print_lines: Callable[[str], None]) -> Iterator[None]:
    """Within the context, pass lines printed to a terminal to ``print_lines``."""
    with ExitStack() as stack:
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, CleanStream) and stream.isatty():
                stack.enter_context(stream.printed_by(print_lines))
        yield


def print_json(document: object) -> None:
    """Print a document as one line of JSON."""
    print(json_line(document))
