"""Which key expressions match which keys, by Zenoh's own word; as the contract's pages have it."""

from __future__ import annotations

import pytest
import zenoh

from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.query_table import RPC_NAMES
from tests.wire.contract_files import WILDCARDS, load

TOPICS = {
    entry["name"]: entry["key"].removeprefix("{base}/@v1/{robot}/").replace("*/*", "1f/plans")
    for entry in load("keys.yaml")["keys"]
}
ROBOTS = ("robot", "mower-2")


def topics(*names: str, robots: tuple[str, ...] = ("robot",)) -> set[str]:
    return {f"{Keys(robot).prefix}/{TOPICS[name]}" for name in names for robot in robots}


def queries(*names: str, robots: tuple[str, ...] = ("robot",)) -> set[str]:
    return {Keys(robot).rpc(name) for name in names for robot in robots}


ALL_KEYS = topics(*TOPICS, robots=ROBOTS) | queries(*RPC_NAMES, robots=ROBOTS)
MATCHED = {
    "fasaco/**": set(),
    "**": set(),
    "fasaco/@v1/**": topics(*TOPICS, robots=ROBOTS),
    "fasaco/@v1/robot/**": topics(*TOPICS),
    "fasaco/@v1/robot/*": topics(*TOPICS.keys() - {"recorder_alive", "claim", "driver"}),
    "fasaco/@v1/*/status": topics("status", robots=ROBOTS),
    "fasaco/@v1/*/alive": topics("alive", robots=ROBOTS),
    "fasaco/@v1/**/alive": topics("alive", "recorder_alive", robots=ROBOTS),
    "fasaco/@v1/robot/map$*": topics("map", "map_update"),
    "fasaco/@v1/robot/@rpc/*": queries(*RPC_NAMES),
    "fasaco/@v1/*/@rpc/status": queries("status", robots=ROBOTS),
    "fasaco/*/robot/path": set(),
}
NO_EXPRESSION = "fasaco/@v1/robot/map*"


def test_the_table_is_checked_as_a_whole():
    assert WILDCARDS.keys() == MATCHED.keys() | {NO_EXPRESSION}


@pytest.mark.parametrize("expression", MATCHED)
def test_an_expression_matches_the_listed_keys(expression):
    asked = zenoh.KeyExpr(expression)
    assert {key for key in ALL_KEYS if asked.intersects(zenoh.KeyExpr(key))} == MATCHED[expression]


def test_half_a_chunk_has_another_wildcard():
    with pytest.raises(zenoh.ZError):
        zenoh.KeyExpr(NO_EXPRESSION)
