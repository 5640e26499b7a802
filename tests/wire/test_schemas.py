"""The JSON Schemas are schemas, and the contract's tables of members are theirs."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest
from jsonschema import Draft202012Validator, ValidationError

from fasaco_edge.errors import NotYet
from fasaco_edge.wire.documents.replies import STATES, encode_error
from fasaco_edge.wire.documents.status import TROUBLES
from tests.wire.contract_files import CONTRACT, PROTOCOL, load
from tests.wire.make_schemas import files
from tests.wire.schemas import NAMES, check, schema


@pytest.mark.parametrize("name", NAMES)
def test_it_is_a_schema(name):
    Draft202012Validator.check_schema(schema(name))


def test_they_are_what_the_structs_make():
    """To write them anew: make contract."""
    written = {path.name: path.read_text() for path in (PROTOCOL / "schema").iterdir()}
    assert written == files()


def test_every_schema_has_a_use():
    table = load("keys.yaml")
    used = {entry["json"] for entry in (*table["keys"], *table["queries"])}
    used |= {entry["attachment"] for entry in table["keys"]}
    used |= {query["payload"] for query in table["queries"]}
    assert used - {None} | {"error.json"} == set(NAMES)


def struct(file: str, name: str) -> dict[str, Any]:
    """Return the part of a schema that a struct makes."""
    return schema(file)["$defs"][name]


def members(heading: str) -> list[str]:
    """Return the names in the first column of the contract's table with this heading."""
    table = CONTRACT.partition(f"\n| {heading} |")[2].partition("\n\n")[0]
    cells = [line.split(" | ")[0] for line in table.splitlines()[2:]]
    return [name for cell in cells for name in re.findall(r"`(\w+)`", cell)]


@pytest.mark.parametrize(
    ("heading", "documented"),
    [
        ("member of `coverage`", struct("status.json", "CoverageReport")),
        ("member of `mission`", struct("status.json", "MissionReport")),
        ("member of `ledger`", struct("status.json", "LedgerReport")),
        ("member of `status`", struct("status.json", "Status")),
        ("member of a path", struct("path_attachment.json", "PathAttachment")),
        ("member of `order`", struct("mission.json", "OrderDocument")),
    ],
)  # fmt: skip
def test_the_contract_has_the_members_of_a_schema(heading, documented):
    names = members(heading)
    # Beside its own the table of zones names what a zone has.
    assert set(documented["properties"]) <= set(names)
    assert set(documented["required"]) <= set(names)


def test_the_contract_has_the_states():
    table = CONTRACT.partition("\n| state |")[2].partition("\n\n")[0]
    cells = "".join(line.split(" | ")[0] for line in table.splitlines()[2:])
    assert re.findall(r"`([^`]+)`", cells) == list(STATES)


def test_the_contract_has_the_troubles():
    table = CONTRACT.partition("\n| trouble |")[2].partition("\n\n")[0]
    assert re.findall(r"^\| `(\w+)`", table, re.MULTILINE) == list(TROUBLES)


def test_the_contract_has_the_commands():
    table = CONTRACT.partition("\n| command |")[2].partition("\n\n")[0]
    cells = "".join(line.split(" | ")[0] for line in table.splitlines()[2:])
    enum = struct("mission.json", "CommandDocument")["properties"]["command"]["enum"]
    assert sorted(re.findall(r"`(\w+)`", cells)) == enum


def test_an_error_is_one():
    check("error.json", json.loads(encode_error(NotYet("there is no path yet"))))


@pytest.mark.parametrize(
    ("name", "document"),
    [
        ("error.json", {"code": "not_yet", "message": "no path"}),
        ("error.json", {"code": "not_yet", "message": "", "hint": ""}),
        ("version.json", {"package": "fasaco-edge", "version": "1", "protocol": "@v1"}),
        ("replan.json", {"robot": "robot", "accepted": False, "plan": 1}),
        ("mission.json", {"command": "dance"}),
    ],
)
def test_what_is_wrong_is_refused(name, document):
    with pytest.raises(ValidationError):
        check(name, document)
