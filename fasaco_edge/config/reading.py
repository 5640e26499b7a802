"""Reading of configurations: sections, YAML with the line of each key, all faults of a document."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import msgspec
import yaml

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.host.plain_yaml import PlainYamlError, compose, read_bounded
from fasaco_edge.text import misfit, nearest, objects_of, shown

FOLDER = "CREDENTIALS_DIRECTORY"
# Removed keys of earlier releases: why, and what to do. A removed key without a value is ignored,
# as copies of old examples contain it.
REMOVED = {
    "planner.own": (
        "was removed in this version, the daemon plans with its own planners only",
        "delete the key; `fasaco-edge plan --planner MODULE:NAME` runs a planner of your own",
    ),
    "planner.local_search": (
        "was removed in this version, each planner has a name of its own",
        "for true write name: colony-search, or leave the name out; for false write name: fasaco; "
        "with another name delete the key",
    ),
}


class Section(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A section of a configuration, in which unknown keys are errors."""


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of a configuration.

    Attributes:
        key: its place, like ``bus.listen[0]``; "" for the file.
        error: the fault, and the allowed values; without the name of the file.
        line: line in the file, from 1; None if there is none.
    """

    key: str
    error: BadConfiguration
    line: int | None = None


def section_faults(
    kind: type[Section], document: object, key: str = "", root: type[Section] | None = None
) -> Iterator[Fault]:
    """Yield the faults of ``document`` as a section ``kind``, key by key.

    Args:
        kind: the section.
        document: result of parsing its text as YAML.
        key: key of the section; "" for the whole.
        root: type of the whole document, in which an unknown key of the section may belong
            elsewhere.
    """
    root = root or kind
    fields = {field.encode_name: field for field in msgspec.structs.fields(kind)}
    if not isinstance(document, dict):
        yield _fault(key, f"{key or 'the file'}: expected object, got {shown(document)}")
        return
    if any(not isinstance(name, str) for name in document):
        yield _fault(key, f"{key or 'the file'}: expected str as key, got {shown(document)}")
    for name, value in document.items():
        if not isinstance(name, str):
            continue
        path = f"{key}.{name}" if key else name
        if path in REMOVED:
            why, hint = REMOVED[path]
            if value not in (None, ""):
                yield Fault(path, BadConfiguration(f"{path} {why}", hint=hint))
        elif name not in fields:
            yield _fault(path, f"unknown key {path}{_meant(name, key, list(fields), root)}")
        elif section := section_of(fields[name].type):
            yield from section_faults(section, value, path, root)
        elif unknown := tuple(_unknown_keys(fields[name].type, value, path, root)):
            yield from unknown
        else:
            yield from _value_faults(fields[name].type, value, path)
    for name, field in fields.items():
        if field.required and name not in document:
            yield _fault(key, f"{key}: object missing required field {name}")


def without_removed(document: Mapping[str, object], key: str = "") -> dict[str, object]:
    """Return a section ``key`` of an earlier release without the keys removed since."""
    kept: dict[str, object] = {}
    for name, value in document.items():
        path = f"{key}.{name}" if key else name
        if path not in REMOVED:
            kept[name] = without_removed(value, path) if isinstance(value, Mapping) else value
    return kept


def renamed(config: Mapping[str, object]) -> dict[str, object]:
    """Return a recorded configuration with this release's name of the planner.

    With ``planner.local_search``, fasaco was what is now colony-search.
    """
    planner = config.get("planner")
    if not isinstance(planner, Mapping) or "local_search" not in planner:
        return dict(config)
    planner = dict(planner)
    if planner.pop("local_search") and planner.get("name") == "fasaco":
        planner["name"] = "colony-search"
    return {**config, "planner": planner}


def section_of(kind: object) -> type[Section] | None:
    """Return the section, optional or not, that a key of this type contains; None for none."""
    return next((each for each in objects_of(kind, 1) if issubclass(each, Section)), None)


def _unknown_keys(kind: object, value: object, key: str, root: type[Section]) -> Iterator[Fault]:
    """Yield the unknown keys of an object, such as a dock, or of a list of objects."""
    objects = {f"{key}[{at}]": each for at, each in enumerate(value if type(value) is list else ())}
    for place, held in (objects or {key: value}).items():
        for structure in objects_of(kind) if isinstance(held, dict) else ():
            names = [field.encode_name for field in msgspec.structs.fields(structure)]
            for name in (str(each) for each in held if each not in names):
                path = f"{place}.{name}"
                yield _fault(path, f"unknown key {path}{_meant(name, place, names, root)}")


def _value_faults(kind: object, value: object, key: str) -> Iterator[Fault]:
    """Yield what is wrong with a value; of a list, with each item alone."""
    whole = _value_fault(kind, value, key)
    if whole is None:
        return
    items = enumerate(value if type(value) is list else ())
    alone = [_value_fault(kind, [item], key, str(at)) for at, item in items]
    yield from [fault for fault in alone if fault and fault.key != key] or [whole]


def _value_fault(kind: object, value: object, key: str, place: str = "") -> Fault | None:
    wanted: Any = kind
    try:
        msgspec.convert(value, wanted)
    except msgspec.ValidationError as error:
        at, expected, value = misfit(str(error), value)
        at = at.replace("[0]", f"[{place}]", 1) if place else at
        expected = _choices(kind) or expected
        if expected == "expected str":
            expected += ", in quotes"  # YAML 1.1 takes 8:1 for a number
        return _fault(key + at, f"{key}{at}: {expected}, got {shown(value)}")
    return None


def _choices(kind: object) -> str:
    """Return the names allowed for a key; "" if it does not take names."""
    if get_origin(kind) is not Literal:
        return ""
    *others, last = get_args(kind)
    return "expected " + (f"{', '.join(others)} or {last}" if others else str(last))


def _meant(name: str, key: str, names: list[str], root: type[Section]) -> str:
    """Return the key that was probably meant, or the existing keys."""
    before = f"{key}." if key else ""
    if near := nearest(name, names):
        return f"; did you mean {' or '.join(before + each for each in near)}?"
    elsewhere = [path for path in _paths(root, "") if path.rpartition(".")[2] == name]
    if elsewhere:
        return f"; did you mean {' or '.join(elsewhere)}?"
    return f"; there are {', '.join(names)}"


def _paths(kind: type[Section], before: str) -> Iterator[str]:
    """Yield all keys of a section."""
    for field in msgspec.structs.fields(kind):
        path = before + field.encode_name
        yield path
        if section := section_of(field.type):
            yield from _paths(section, f"{path}.")


def _fault(key: str, text: str) -> Fault:
    return Fault(key, BadConfiguration(text))


@dataclass(frozen=True, slots=True)
class ConfigText:
    """The content of a file.

    Attributes:
        document: plain values.
        lines: line of each key, from 1.
        duplicates: faults of keys that occur more than once; YAML would take the last value.
    """

    document: object
    lines: dict[str, int] = dataclasses.field(default_factory=dict)
    duplicates: tuple[Fault, ...] = ()

    def line_of(self, key: str) -> int | None:
        """Return the line of a key, or of its section if it is missing; None if both are."""
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
    except FileNotFoundError as error:
        hint = f"name another file, or write this one: fasaco-edge init {path}"
        raise BadConfiguration(str(error.strerror), hint=hint) from error
    except OSError as error:
        raise BadConfiguration(str(error.strerror)) from error
    except PlainYamlError as error:
        hint = "correct the file at that place"
        raise BadConfiguration(f"not plain YAML: {error}", hint=hint) from error
    lines: dict[str, int] = {}
    duplicates = []
    for key, line in keys_and_lines(node):
        if key in lines:
            text = f"{key}: is given twice, in line {lines[key]} and in line {line}"
            duplicates.append(Fault(key, BadConfiguration(text), line))
        lines[key] = line
    return ConfigText(document if document is not None else {}, lines, tuple(duplicates))


def keys_and_lines(node: yaml.Node | None, before: str = "") -> Iterator[tuple[str, int]]:
    """Yield each key and its line."""
    if isinstance(node, yaml.MappingNode):
        for name, value in node.value:
            key = f"{before}.{name.value}" if before else str(name.value)
            yield key, name.start_mark.line + 1
            yield from keys_and_lines(value, key)
    elif isinstance(node, yaml.SequenceNode):
        for index, item in enumerate(node.value):
            key = f"{before}[{index}]"
            yield key, item.start_mark.line + 1
            yield from keys_and_lines(item, key)


def with_credentials(part: object, environ: Mapping[str, str] = os.environ) -> object:
    """Return a part of a configuration with ``$CREDENTIALS_DIRECTORY/`` resolved.

    A service manager passes files in a folder of its own for each service (LoadCredential= in
    systemd.exec(5)). Without that folder the text stays, so that the file is reported missing.
    """
    folder = environ.get(FOLDER)
    if folder is None:
        return part
    if isinstance(part, dict):
        return {key: with_credentials(value, environ) for key, value in part.items()}
    if isinstance(part, str) and part.startswith(f"${FOLDER}/"):
        return folder + part.removeprefix(f"${FOLDER}")
    return part
