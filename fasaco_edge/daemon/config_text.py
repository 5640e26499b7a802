"""The text of a configuration: YAML, with the line of each key."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import yaml

from fasaco_edge.daemon.config_faults import Fault
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.plain_yaml import PlainYamlError, compose, read_bounded


@dataclass(frozen=True, slots=True)
class ConfigText:
    """What a file holds.

    Attributes:
        document: plain values.
        lines: of each key, from 1 on.
        twice: keys that stand there more than once: YAML would take the last.
    """

    document: object
    lines: dict[str, int] = field(default_factory=dict)
    twice: tuple[Fault, ...] = ()

    def line_of(self, key: str) -> int | None:
        """Return the line of a key, or of what it would stand in; None where nothing does."""
        while key:
            if key in self.lines:
                return self.lines[key]
            key = key[: max(key.rfind("."), key.rfind("["), 0)]
        return None


def read_text(path: Path) -> ConfigText:
    """Read a file.

    Raises:
        BadConfiguration: it cannot be read, or is no YAML; without the name of the file.
    """
    try:
        node, document = compose(read_bounded(path))
    except OSError as error:
        raise BadConfiguration(str(error.strerror)) from error
    except PlainYamlError as error:
        raise BadConfiguration(f"not plain YAML: {error}") from error
    lines: dict[str, int] = {}
    twice = []
    for key, line in _keys(node, ""):
        if key in lines:
            said = f"{key}: stands twice, in line {lines[key]} and in line {line}"
            twice.append(Fault(key, BadConfiguration(said), line))
        lines[key] = line
    return ConfigText(document if document is not None else {}, lines, tuple(twice))


def _keys(node: yaml.Node | None, before: str) -> Iterator[tuple[str, int]]:
    """Yield each key and its line."""
    if isinstance(node, yaml.MappingNode):
        for name, value in node.value:
            key = f"{before}.{name.value}" if before else str(name.value)
            yield key, name.start_mark.line + 1
            yield from _keys(value, key)
    elif isinstance(node, yaml.SequenceNode):
        for index, item in enumerate(node.value):
            key = f"{before}[{index}]"
            yield key, item.start_mark.line + 1
            yield from _keys(item, key)
