"""The contract's JSON Schemas, and documents checked against them."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

from jsonschema import Draft202012Validator
from referencing import Registry
from referencing.jsonschema import DRAFT202012

from tests.wire.contract_files import PROTOCOL

NAMES = sorted(path.name for path in (PROTOCOL / "schema").glob("*.json"))
# What may stand in a section of the configuration is not the contract's.
OPEN = {"config.json"}


def schema(name: str) -> Any:
    return json.loads((PROTOCOL / "schema" / name).read_text())


def check(name: str, document: object) -> None:
    """Check a document against a schema; a member that the schema does not have is wrong, too.

    Raises:
        jsonschema.ValidationError: it does not fit.
    """
    _validator(name).validate(document)


@cache
def _validator(name: str) -> Draft202012Validator:
    closed = {other: schema(other) for other in NAMES}
    for other in NAMES:
        if other not in OPEN:
            _close(closed[other])
    resources = [(other, DRAFT202012.create_resource(closed[other])) for other in NAMES]
    registry: Registry[Any] = Registry().with_resources(resources)
    return Draft202012Validator({"$ref": name}, registry=registry)


def _close(part: object) -> None:
    """Let the objects of a schema have no other members than those it names."""
    if isinstance(part, dict):
        if "properties" in part:
            part.setdefault("additionalProperties", False)
        for inner in part.values():
            _close(inner)
    elif isinstance(part, list):
        for inner in part:
            _close(inner)
