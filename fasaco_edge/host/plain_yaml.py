"""Plain YAML: a document written by a user, of bounded size and depth, with the line of each key.

Aliases count with their expanded size: 500 bytes of aliases can expand to gigabytes. Tags, which
turn a text into other types, are refused.
"""

from __future__ import annotations

import os
import re
import select
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

import yaml

from fasaco_edge.errors import DocumentError, together

MOST_BYTES = 1_048_576
MOST_VALUES = 50_000
MOST_DEPTH = 32
# Largest number of digits of an integer: Python cannot print integers of 4300 digits.
MOST_DIGITS = 100
# Timeout of a pipe [s]: a daemon that reloads its configuration is blocked until then.
PIPE_S = 5.0


class PlainYamlError(ValueError):
    """A file is not plain YAML; the text names the place, not the file."""


def read_bounded(path: Path) -> str:
    """Return the text of a file, also of a pipe.

    Raises:
        OSError: it cannot be read.
        PlainYamlError: it is longer than ``MOST_BYTES``, or not UTF-8.
    """
    content = b""
    # Without O_NONBLOCK, opening or reading a pipe without a writer would block endlessly.
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        until = time.monotonic() + PIPE_S
        while len(content) <= MOST_BYTES:
            if not select.select([descriptor], [], [], max(until - time.monotonic(), 0.0))[0]:
                raise PlainYamlError(f"the pipe was not closed within {PIPE_S:g} s")
            piece = os.read(descriptor, MOST_BYTES + 1 - len(content))
            if not piece:
                break
            content += piece
    finally:
        os.close(descriptor)
    if len(content) > MOST_BYTES:
        raise PlainYamlError(f"more than {MOST_BYTES} bytes")
    try:
        return content.decode()
    except UnicodeDecodeError as error:
        raise PlainYamlError(f"byte {error.start + 1} is not text in UTF-8") from error


_Error = TypeVar("_Error", bound=DocumentError)


@dataclass(frozen=True, slots=True)
class Written(Generic[_Error]):
    """The content of a file.

    Attributes:
        file: the file.
        values: plain values; None for an empty file.
        lines: line of each key, from 1.
        twice: a fault for each key that occurs more than once; YAML would take the last.
    """

    file: Path
    values: object
    lines: dict[str, int]
    twice: tuple[_Error, ...]

    def faults(self, found: Sequence[_Error]) -> list[_Error]:
        """Return all faults in the order of their lines: duplicate keys, and those ``found``."""
        for fault in (faults := [*self.twice, *found]):
            fault.file, fault.line = self.file, self._line_of(fault.key)
        return sorted(faults, key=lambda fault: fault.line or 0)

    def check(self, found: Sequence[_Error]) -> None:
        """Raise the first of all faults, with the others as its rest; see ``faults``."""
        if faults := self.faults(found):
            raise together(faults)

    def _line_of(self, key: str) -> int | None:
        """Return the line of a key or, without the key, of its section; None without either."""
        while key:
            if key in self.lines:
                return self.lines[key]
            key = key[: max(key.rfind("."), key.rfind("["), 0)]
        return None


def read_written(
    path: Path,
    error: type[_Error],
    *,
    missing: str,
    broken: str = "correct the file at that place",
    parse: Callable[[str], object] | None = None,
) -> Written[_Error]:
    """Read a file.

    Args:
        path: the file.
        error: kind of the errors.
        missing: hint for a file that does not exist.
        broken: hint for a file that is not plain YAML.
        parse: reads the values of a JSON file; None for YAML.

    Raises:
        DocumentError: ``error``, the file cannot be read, or is not plain YAML.
    """
    try:
        text = read_bounded(path)
        keys, values = compose(text) if parse is None else (_keys_of_json(text), parse(text))
    except (OSError, ValueError, RecursionError) as refused:
        if isinstance(refused, OSError):
            is_missing = isinstance(refused, FileNotFoundError)
            hint = missing if is_missing else "name a file that can be read"
            fault = error(str(refused.strerror), hint=hint)
        else:
            why = "nested too deeply" if isinstance(refused, RecursionError) else refused
            fault = error(f"not plain {'JSON' if parse else 'YAML'}: {why}", hint=broken)
        fault.file = path
        raise fault from refused
    lines: dict[str, int] = {}
    twice = []
    for key, line in keys:
        if key in lines:
            both = f", in line {lines[key]} and" if lines[key] != line else ""
            text = f"is given twice{both} in line {line}"
            twice.append(error(text, key=key))
        lines[key] = line
    return Written(path, values, lines, tuple(twice))


def _keys_of_json(text: str) -> list[tuple[str, int]]:
    """Return the keys of JSON, read as YAML without tabs; none if YAML refuses the text."""
    try:
        return compose(text.replace("\t", " "))[0]
    except PlainYamlError:
        return []


def _keys_and_lines(node: yaml.Node | None, before: str = "") -> Iterator[tuple[str, int]]:
    if isinstance(node, yaml.MappingNode):
        for name, value in node.value:
            key = f"{before}.{name.value}" if before else str(name.value)
            yield key, name.start_mark.line + 1
            yield from _keys_and_lines(value, key)
    elif isinstance(node, yaml.SequenceNode):
        for index, item in enumerate(node.value):
            key = f"{before}[{index}]"
            yield key, item.start_mark.line + 1
            yield from _keys_and_lines(item, key)


def compose(text: str) -> tuple[list[tuple[str, int]], object]:
    """Return each key of a document and its line, from 1; and the document as plain values.

    Raises:
        PlainYamlError: it is not YAML, or not plain.
    """
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        # Construction adds the keys that << merges; keys beside << may replace them.
        keys = list(_keys_and_lines(node))
        return keys, None if node is None else loader.construct_document(node)
    except PlainYamlError:
        raise
    except RecursionError as error:
        raise PlainYamlError("nested too deeply") from error
    except yaml.MarkedYAMLError as error:
        raise PlainYamlError(_described(error)) from error
    # Invalid UTF-8, an impossible date, or a number in base 60 beyond the range of floats.
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        raise PlainYamlError(str(error)) from error


def dump(document: object) -> str:
    """Return plain values as YAML, which ``compose`` reads back."""
    return yaml.dump(document, Dumper=_Dumper, sort_keys=False)


# Messages of the parser for frequent mistakes, and their meaning.
_PLAIN = {
    "found character '\\t' that cannot start any token": "a tab: indent by spaces",
    "expected <block end>, but found '<block mapping start>'": (
        "indented differently from the lines before"
    ),
    "mapping values are not allowed here": "a key within a value: perhaps the line before lacks a "
    "quote, or this one is indented too far",
}


def _described(error: yaml.MarkedYAMLError) -> str:
    """Return where a document is not YAML, and why, in one line."""
    mark, began = error.problem_mark or error.context_mark, error.context_mark
    where = "" if mark is None else f"line {mark.line + 1}, column {mark.column + 1}: "
    context = error.context or ""
    if began is not None and mark is not None and began.line != mark.line:
        context += f" that begins in line {began.line + 1}"
    if (problem := error.problem or "") in _PLAIN:
        return where + _PLAIN[problem]
    return where + ", ".join(filter(None, (problem, context)))


class _Loader(yaml.SafeLoader):
    """Counts values while they are read, before objects are built from them."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._values = self._depth = self._deepest = 0
        # Number of values, and of levels, of each anchor.
        self._sizes: dict[str, tuple[int, int]] = {}

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        where, anchor = f"line {event.start_mark.line + 1}", getattr(event, "anchor", None)
        values, levels = 1, 1
        if isinstance(event, yaml.AliasEvent):
            if anchor not in self._sizes:
                raise PlainYamlError(f"{where}: *{anchor} refers to nothing, or to itself")
            values, levels = self._sizes[anchor]
        elif event.tag is not None:
            raise PlainYamlError(f"{where}: a tag, {event.tag}: write the value alone")
        began, outer_deepest = self._values, self._deepest
        self._values += values
        self._deepest = self._depth + levels
        if self._values > MOST_VALUES:
            raise PlainYamlError(f"{where}: more than {MOST_VALUES} values, aliases written out")
        if self._deepest > MOST_DEPTH:
            raise PlainYamlError(f"{where}: nested deeper than {MOST_DEPTH} levels")
        self._depth += 1
        node = super().compose_node(parent, index)
        self._depth -= 1
        if anchor is not None and not isinstance(event, yaml.AliasEvent):
            self._sizes[anchor] = self._values - began, self._deepest - self._depth
        self._deepest = max(self._deepest, outer_deepest)
        return node

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        if len(node.value) > MOST_DIGITS:
            line = node.start_mark.line + 1
            raise PlainYamlError(f"line {line}: an integer of more than {MOST_DIGITS} digits")
        return super().construct_yaml_int(node)


_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.construct_yaml_int)
# As in YAML 1.2: YAML 1.1 reads 1e-6 as a text.
_EXPONENT = re.compile(r"[-+]?[0-9]+(\.[0-9]*)?[eE][-+]?[0-9]+")


class _Dumper(yaml.SafeDumper):
    """Quotes texts that ``_Loader`` would read as numbers."""


for _kind in (_Loader, _Dumper):
    _kind.add_implicit_resolver("tag:yaml.org,2002:float", _EXPONENT, list("-+0123456789"))
