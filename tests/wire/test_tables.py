"""The contract's README, its data and the code say the same."""

from __future__ import annotations

import importlib
import pkgutil
import re

import pytest

import fasaco_edge
from fasaco_edge.bus import session_config
from fasaco_edge.bus.publisher import QOS, VOLATILE, Qos
from fasaco_edge.daemon.loop.commands import REPLAN_PERIOD_S
from fasaco_edge.daemon.memory import QUEUES
from fasaco_edge.errors import FasacoError
from fasaco_edge.mission.coverage.ledger import MOST_TILES
from fasaco_edge.mission.orders import order
from fasaco_edge.wire import limits
from fasaco_edge.wire.keys import RPC_NAMES, Keys
from tests.wire import readme_tables
from tests.wire.readme_tables import PROTOCOL, load

README = (PROTOCOL / "README.md").read_text()
PRIORITIES = (
    "real_time", "interactive_high", "interactive_low", "data_high", "data", "data_low",
    "background",
)  # fmt: skip


@pytest.mark.parametrize("table", ["key", "qos", "query", "wildcard", "error"])
def test_a_table_of_the_readme_is_that_of_the_data(table):
    """To write it anew: python -m tests.wire.readme_tables."""
    rows = getattr(readme_tables, f"{table}_rows")()
    assert "\n|---" in README
    assert "\n".join(rows) in README


def test_the_contents_lead_to_headings():
    contents = README.partition("\n\n| file |")[0]
    links = re.findall(r"\[([^]]+)\]\(#([^)]+)\)", contents)
    assert len(links) > 8
    for title, anchor in links:
        assert f"\n## {title}\n" in README
        assert anchor == title.lower().replace(" ", "-")


def test_what_the_readme_names_is_there():
    names = re.findall(r"^\| `([\w/.]+)` \|", README.partition("## Keys")[0], re.MULTILINE)
    linked = re.findall(r"\]\((schema/\w+\.json)\)", README)
    assert {"keys.yaml", "errors.yaml", "examples/client.py"} <= set(names)
    for name in (*names, *linked):
        assert (PROTOCOL / name).exists(), name


def test_queries_are_those_of_the_code():
    queries = load("keys.yaml")["queries"]
    assert tuple(query["name"] for query in queries) == RPC_NAMES
    codes = {error["code"] for error in load("errors.yaml")["errors"] if "query" in error["from"]}
    keys = Keys("mower-2", "site/hall_1")
    for query in queries:
        assert query["key"].format(base=keys.base, robot=keys.robot) == keys.rpc(query["name"])
        assert set(query["errors"]) <= codes
        assert 0 < query["timeout_s"] <= 5
    assert len({frozenset(query) for query in queries}) == 1


def test_publishers_get_the_quality_of_service_of_the_table():
    table = load("qos.yaml")["qos"]
    for row in table.values():
        row.pop("blocks")
    assert {name: Qos(**row) for name, row in table.items()} == QOS
    keys = {entry["name"]: entry for entry in load("keys.yaml")["keys"]}
    assert {entry["qos"] for entry in keys.values()} == {*QOS, None}
    for name, qos in QOS.items():
        assert keys[name]["qos"] == name
        assert keys[name]["latched"] == qos.latched


def test_priorities_make_sense():
    def rank(name):
        return PRIORITIES.index(QOS[name].priority)

    assert rank("path") < rank("status") < rank("coverage") < rank("pheromone")
    assert rank("path") == min(map(rank, QOS))
    assert rank("pheromone") == max(map(rank, QOS))
    # An update must not overtake the map it belongs to.
    assert rank("map") == rank("map_update")
    entries = load("keys.yaml")["keys"]
    sent = {entry["name"] for entry in entries if entry["direction"].startswith("out")}
    assert {QOS[name].congestion for name in sent} == {"drop"}, "nobody holds up a daemon"


def test_every_publisher_says_how():
    """One that says nothing is as Zenoh's are: no key of the contract is."""
    assert VOLATILE not in QOS.values()
    said = re.compile(r"\.publisher\([^)]*QOS\[")
    for path in PROTOCOL.parent.glob("fasaco_edge/**/*.py"):
        for call in re.findall(r"bus\.publisher\([^)]*\)", path.read_text()):
            assert said.search(call), f"{path}: {call}"


def test_limits_are_those_of_the_code():
    def upper(module):
        return {name.lower(): value for name, value in vars(module).items() if name.isupper()}

    assert load("limits.yaml") == {
        **upper(limits),
        **{name: value for name, value in upper(order).items() if isinstance(value, int | float)},
        **{f"queue_{name}": length for name, length in QUEUES.items()},
        "replan_period_s": REPLAN_PERIOD_S,
        "most_ledger_tiles": MOST_TILES,
    }
    assert session_config.MAX_MESSAGE_BYTES == limits.MAX_MESSAGE_BYTES
    named = {name for entry in load("keys.yaml")["keys"] for name in entry["limits"]}
    assert named <= load("limits.yaml").keys()


def all_errors(kind: type[FasacoError] = FasacoError) -> set[type[FasacoError]]:
    return {kind}.union(*(all_errors(below) for below in kind.__subclasses__()))


def test_error_codes_are_those_of_the_code():
    for module in pkgutil.walk_packages(fasaco_edge.__path__, "fasaco_edge."):
        # What needs rerun raises no errors of its own; a __main__ would run.
        if ".recording" not in module.name and not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    table = {error["code"]: error for error in load("errors.yaml")["errors"]}
    # One hands on what a daemon has answered, under the daemon's code.
    kinds = [kind for kind in all_errors() if kind.code != FasacoError.code]
    assert {kind.code for kind in kinds} == table.keys()
    assert len({kind.code for kind in kinds}) == len(kinds), "each code is one error"
    for kind in kinds:
        if kind.hint:
            assert table[kind.code]["do"] == kind.hint
    for error in table.values():
        assert set(error["from"]) <= {"query", "status", "command line"}
