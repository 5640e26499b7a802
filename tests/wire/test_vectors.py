"""The golden bytes in protocol/vectors: read or refused as their index says."""

from __future__ import annotations

from typing import Literal

import pytest

from fasaco_edge.errors import MalformedMessage
from tests.wire.contract_files import PROTOCOL
from tests.wire.decoders import DECODERS
from tests.wire.facts import check_facts, facts_of
from tests.wire.vectors import Vector, vectors


def each(kind: Literal["valid", "hostile"]) -> pytest.MarkDecorator:
    return pytest.mark.parametrize("vector", vectors(kind), ids=lambda vector: vector.name)


@pytest.mark.parametrize("kind", ["valid", "hostile"])
def test_each_file_is_small_and_in_an_index(kind: Literal["valid", "hostile"]) -> None:
    files = {file.stem: file for file in (PROTOCOL / "vectors" / kind).glob("*.bin")}
    assert files.keys() == {vector.name for vector in vectors(kind)}
    assert max(file.stat().st_size for file in files.values()) < 4096


@each("valid")
def test_valid_payload_is_read(vector: Vector) -> None:
    check_facts(facts_of(DECODERS[vector.schema](vector.payload)), vector.facts)


@each("hostile")
def test_hostile_payload_is_refused_for_its_reason(vector: Vector) -> None:
    with pytest.raises(MalformedMessage) as caught:
        DECODERS[vector.schema](vector.payload)
    text = str(caught.value)
    assert text.startswith(vector.schema)
    assert vector.facts["refused"] in text
    assert "got" in text


@each("valid")
def test_every_prefix_is_refused(vector: Vector) -> None:
    payload = vector.payload[: -1 if "padded" in vector.name else None]
    for size in range(len(payload)):
        with pytest.raises(MalformedMessage):
            DECODERS[vector.schema](payload[:size])
