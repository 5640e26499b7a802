"""The contract as data (protocol/*.yaml) and as code agree; JSON and keys keep to it."""

from __future__ import annotations

import contextlib
import math
import re
from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.errors import BadConfiguration, MalformedMessage
from fasaco_edge.host.resources import folder
from fasaco_edge.mission.line.unswept import Unswept
from fasaco_edge.wire import limits, schemas, topics
from fasaco_edge.wire.documents.json_text import decode_json, encode_json
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.messages.maps import CoverageValue
from fasaco_edge.wire.schemas import POSE_SCHEMAS
from tests.support.examples import examples
from tests.wire.contract_files import CONTRACT, load

PROTOCOL = folder("protocol")
TABLE = load("keys.yaml")
ENTRIES = {entry["name"]: entry for entry in TABLE["keys"]}


def constants(module: object) -> dict[str, object]:
    return {name: value for name, value in vars(module).items() if name.isupper()}


def test_defaults_are_those_of_the_table() -> None:
    assert Keys() == Keys(TABLE["robot"], TABLE["base"])
    assert Keys().of(topics.MAP) == "fasaco/@v1/robot/map"


def test_payloads_are_those_of_the_table() -> None:
    tables = [*ENTRIES.values(), *TABLE["ros2"]["topics"]]
    named = {schema for entry in tables for schema in entry["schema"]}
    ours = {value for value in constants(schemas).values() if isinstance(value, str)}
    assert named == ours
    assert ENTRIES["pose"]["schema"] == list(POSE_SCHEMAS)
    encodings = {entry["encoding"] for entry in ENTRIES.values()}
    assert encodings == {"application/cdr", "application/json", None}
    columns = {frozenset(entry) for entry in ENTRIES.values()}
    assert len(columns) == 1


@pytest.mark.parametrize(
    ("key", "values"), [("coverage", sorted(CoverageValue)), ("unswept", [0, *sorted(Unswept)])]
)
def test_the_readme_has_the_values_of_a_grid(key: str, values: list[int]) -> None:
    table = CONTRACT.split(f"| value in `{key}` |")[1].split("\n\n")[0]
    shown = re.findall(r"^\| (-?\d+) \|", table, re.MULTILINE)
    assert [int(value) for value in shown] == values


NO_CHUNKS = ["", "a/b", "@v1", "a b", "*", "**", "$*", "a#", "ä", "a\n", "a?", ".", "\u0661"]
NO_CHUNKS += ["a\u200b", "ａ", "a\0"]


@pytest.mark.parametrize("name", NO_CHUNKS)
def test_names_that_are_no_chunk_are_refused(name: str) -> None:
    for make in (lambda: Keys(robot=name), lambda: Keys().rpc(name)):
        with pytest.raises(BadConfiguration, match="got"):
            make()
    for base in (f"{name}/fasaco", f"fasaco/{name}"):
        if name != "a/b":
            with pytest.raises(BadConfiguration, match="base: must be"):
                Keys(base=base)


@dataclass
class Progress:
    covered: int
    ratio: float | None


def test_json_of_values() -> None:
    payload = encode_json({"state": "planning", "progress": Progress(3, None), "list": [1, 2.5]})
    assert payload == b'{"state":"planning","progress":{"covered":3,"ratio":null},"list":[1,2.5]}'
    assert decode_json(payload)["progress"] == {"covered": 3, "ratio": None}


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_json_has_no_nan(value: float) -> None:
    with pytest.raises(MalformedMessage, match=r"message\.a\[1\]\.ratio must be finite"):
        encode_json({"a": [0.0, Progress(1, value)]})


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"[]",
        b"1",
        b'"text"',
        b"{",
        b'{"a":1}x',
        b'{"a":NaN}',
        b'{"a":Infinity}',
        b'{"a":1e999}',
        b'{"a":' + b"9" * 5000 + b"}",
        b'{"a":"\xff"}',
        b'{"\xff":1}',
        b'{"a":"\\ud800"}',
        b"\xef\xbb\xbf{}",
        b'{"a":' * 100_000,
        b'{"a":"' + b"x" * limits.MAX_JSON_BYTES + b'"}',
    ],
    ids=lambda payload: repr(payload[:14]),
)
def test_invalid_json_is_refused(payload: bytes) -> None:
    with pytest.raises(MalformedMessage, match="JSON"):
        decode_json(payload)


@examples(200)
@given(st.binary(max_size=60), st.integers(0, 59))
def test_noise_in_json_raises_only_malformed_message(noise: bytes, at: int) -> None:
    good = encode_json({"state": "planning", "steps": [1, 2, 3], "eta_s": 1.5})
    for payload in (noise, good[:at] + noise + good[at:], good[:at]):
        with contextlib.suppress(MalformedMessage):
            assert isinstance(decode_json(payload), dict)
