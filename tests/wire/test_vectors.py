"""The golden bytes in protocol/vectors: up to date, read or refused as their index says."""

from __future__ import annotations

from typing import Any

import pytest

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.host.resources import folder
from tests.wire.contract_files import load
from tests.wire.decoders import DECODERS
from tests.wire.facts import check_facts, facts_of
from tests.wire.make_vectors import files

VECTORS = folder("protocol") / "vectors"


def index(kind: str) -> list[Any]:
    entries = load(f"vectors/{kind}/index.yaml")
    return [pytest.param(entry, id=entry["file"]) for entry in entries]


def payload_of(kind: str, entry: dict[str, Any]) -> bytes:
    return (VECTORS / kind / entry["file"]).read_bytes()


def test_the_files_are_what_the_generator_makes() -> None:
    found = {
        file.relative_to(VECTORS).as_posix(): file.read_bytes()
        for file in VECTORS.rglob("*")
        if file.is_file()
    }
    assert found == files()
    assert max(len(content) for name, content in found.items() if name.endswith(".bin")) < 4096


@pytest.mark.parametrize("entry", index("valid"))
def test_valid_payload_is_read(entry: dict[str, Any]) -> None:
    said = facts_of(DECODERS[entry["schema"]](payload_of("valid", entry)))
    check_facts(said, {k: v for k, v in entry.items() if k not in ("file", "schema")})


@pytest.mark.parametrize("entry", index("hostile"))
def test_hostile_payload_is_refused_for_its_reason(entry: dict[str, Any]) -> None:
    with pytest.raises(MalformedMessage) as caught:
        DECODERS[entry["schema"]](payload_of("hostile", entry))
    text = str(caught.value)
    assert text.startswith(entry["schema"])
    assert entry["refused"] in text
    assert "got" in text


@pytest.mark.parametrize("entry", index("valid"))
def test_every_prefix_is_refused(entry: dict[str, Any]) -> None:
    payload = payload_of("valid", entry)
    if "padded" in entry["file"]:
        payload = payload[:-1]
    for size in range(len(payload)):
        with pytest.raises(MalformedMessage):
            DECODERS[entry["schema"]](payload[:size])
