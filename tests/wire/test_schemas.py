"""The JSON Schemas are schemas, and the contract's tables of members are theirs."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest
from jsonschema import Draft202012Validator, ValidationError

from fasaco_edge.errors import NotYet
from fasaco_edge.wire.documents.replies import TROUBLES, encode_error
from tests.wire.contract_files import CONTRACT, PROTOCOL, load
from tests.wire.make_schemas import files
from tests.wire.page_rows import MEMBERS, members_in, with_members
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
    return schema(file)["$defs"][name]


@pytest.mark.parametrize("heading", MEMBERS)
def test_the_contract_has_the_members_of_a_schema(heading):
    """To add the rows that lack: make contract."""
    assert with_members(CONTRACT, heading) == CONTRACT


def test_a_member_without_a_row_gets_one_by_its_description():
    heading, row = (
        "member of `floor`",
        re.search(r"^\| `possible_m2` \|.*\n", CONTRACT, re.MULTILINE),
    )
    mended = with_members(CONTRACT.replace(row[0], ""), heading)
    assert members_in(mended, heading) == members_in(CONTRACT, heading)
    assert mended != CONTRACT


def test_a_member_without_row_and_description_is_an_error():
    row = re.search(r"^\| `ordered` \|.*\n", CONTRACT, re.MULTILINE)
    with pytest.raises(LookupError, match="describe ordered below `Attributes:`"):
        with_members(CONTRACT.replace(row[0], ""), "member of `mission`")


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
def test_a_wrong_document_is_refused(name, document):
    with pytest.raises(ValidationError):
        check(name, document)
