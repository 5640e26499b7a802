"""JSON Schemas of ``protocol/schema``, made from the structs; ``make contract`` writes them.

A test holds the files to what this module makes of the structs. A member's description stands
in the docstring of its struct, below ``Attributes:``.
"""

from __future__ import annotations

import inspect
import json
import pkgutil
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, get_args

import msgspec

from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.mission.orders.commands import CommandDocument
from fasaco_edge.wire import documents
from fasaco_edge.wire.documents.fleet import FleetMember
from fasaco_edge.wire.documents.replies import Error
from fasaco_edge.wire.documents.turns import TurnBatch
from fasaco_edge.wire.query_table import QUERIES
from fasaco_edge.wire.topics import TOPICS

HEAD = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "$comment": "Written by `make contract` from the typed documents of fasaco_edge.",
}
# Documents in no row of the table of topics, or whose struct has another name than their file.
_OTHERS = {"error": Error, "fleet": FleetMember, "mission": CommandDocument, "turns": TurnBatch}


def _documents() -> dict[str, type[msgspec.Struct]]:
    """Return the struct of each file that the table of topics names: `Odometer`, odometer.json."""
    structs = {
        re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower(): kind
        for module in pkgutil.iter_modules(documents.__path__, f"{documents.__name__}.")
        for name, kind in vars(import_module(module.name)).items()
        if isinstance(kind, type) and issubclass(kind, msgspec.Struct)
    }
    named = {name for topic in TOPICS for name in (topic.json, topic.attachment)}
    named |= {name for query in QUERIES for name in (query.json, query.payload)}
    stems = {name.removesuffix(".json") for name in named - {"", "config.json"}} - _OTHERS.keys()
    if lacking := stems - structs.keys():
        raise LookupError(f"wire/documents has no struct for {', '.join(sorted(lacking))}.json")
    return {name: structs[name] for name in stems} | _OTHERS


DOCUMENTS = _documents()


def files() -> dict[str, str]:
    made = {f"{name}.json": schema_of(kind) for name, kind in DOCUMENTS.items()}
    made["config.json"] = config_schema()
    return {name: json.dumps(HEAD | made[name], indent=2) + "\n" for name in sorted(made)}


def schema_of(kind: type[msgspec.Struct]) -> dict[str, Any]:
    schema = msgspec.json.schema(kind, schema_hook=lambda _: {"$comment": "any value"})
    for struct in structs_in(kind):
        _complete(schema["$defs"][struct.__name__], struct)
    return schema


def config_schema() -> dict[str, Any]:
    """Return the JSON Schema of the configuration: its sections, whatever stands in each."""
    fields = msgspec.structs.fields(DaemonConfig)
    return {
        "title": "Config",
        "description": "The configuration in force, by sections; secrets are left out. What may "
        "stand in each section is the package's own business.",
        "type": "object",
        "properties": {
            field.name: {"description": _summary(next(_structs_of(field.type))), "type": "object"}
            for field in fields
        },
        "required": [field.name for field in fields if field.default is not msgspec.UNSET],
    }


def structs_in(kind: type[msgspec.Struct]) -> set[type[msgspec.Struct]]:
    found = {kind}
    for field in msgspec.structs.fields(kind):
        for inner in _structs_of(field.type):
            found |= structs_in(inner)
    return found


def _structs_of(kind: Any) -> Iterator[type[msgspec.Struct]]:
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        yield kind
    for argument in get_args(kind):
        yield from _structs_of(argument)


def _complete(part: dict[str, Any], struct: type[msgspec.Struct]) -> None:
    """Add what the docstring says, and that a writer sends all members it does not leave out."""
    part["description"] = _summary(struct)
    if part["type"] == "array":
        return
    for base in reversed(struct.__mro__):
        for name, text in descriptions(base.__doc__ or "").items():
            if name in part["properties"]:
                part["properties"][name].setdefault("description", text)
    config = struct.__struct_config__
    if config.omit_defaults or (config.forbid_unknown_fields and struct is not Error):
        return  # a member that is missing has its default
    fields = msgspec.structs.fields(struct)
    part["required"] = [field.encode_name for field in fields if field.default is not msgspec.UNSET]
    for member in part["properties"].values():
        member.pop("default", None)


def _summary(struct: type[msgspec.Struct]) -> str:
    paragraphs = inspect.cleandoc(struct.__doc__ or "").split("\n\n")
    return " ".join(paragraphs[0].split())


def descriptions(docstring: str) -> dict[str, str]:
    listed = inspect.cleandoc(docstring).partition("Attributes:\n")[2].partition("\n\n")[0]
    found: dict[str, str] = {}
    for entry in re.split(r"\n(?=    \S)", listed) if listed else ():
        names, _, text = entry.partition(": ")
        for name in names.split(","):
            found[name.strip()] = " ".join(text.split()).rstrip(".")
    return found


def write(into: Path) -> None:
    for name, content in files().items():
        (into / name).write_text(content)
