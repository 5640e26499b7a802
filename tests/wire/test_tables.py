"""The contract's pages, its data and the code say the same."""

from __future__ import annotations

import importlib
import pkgutil
import re

import pytest

import fasaco_edge
from fasaco_edge.daemon.loop.answers import REPLAN_PERIOD_S
from fasaco_edge.errors import FasacoError
from fasaco_edge.mission.coverage.ledger import MOST_TILES
from fasaco_edge.mission.coverage.swept_floor import MOST_FLOOR_TILES
from fasaco_edge.mission.orders import keep_outs, order, passes
from fasaco_edge.wire import limits
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.query_table import QUERIES
from fasaco_edge.wire.topic_types import VOLATILE
from fasaco_edge.wire.topics import QOS, QUEUE_LENGTHS, RECORDED, TOPICS, TURNS
from tests.wire import contract_files, page_rows
from tests.wire.contract_files import CONTRACT, PAGES, PROTOCOL, load

PRIORITIES = (
    "real_time", "interactive_high", "interactive_low", "data_high", "data", "data_low",
    "background",
)  # fmt: skip


@pytest.mark.parametrize("row", page_rows.role_rows())
def test_a_role_has_the_rights_of_the_table_of_topics(row):
    """To write it: make contract."""
    assert row in CONTRACT


@pytest.mark.parametrize("table", ["key", "qos", "query", "wildcard", "error", "state"])
def test_a_table_of_the_contract_is_that_of_the_data(table):
    """To write it: make contract."""
    rows = getattr(contract_files, f"{table}_rows")()
    assert "\n".join(rows) in CONTRACT


def test_links_lead_to_pages_and_headings():
    links = [
        (page, *link)
        for page in PAGES
        for link in re.findall(r"\]\(([\w./-]*)(?:#([\w-]+))?\)", page.read_text())
    ]
    assert len(links) > 30
    for page, target, anchor in links:
        other = page.parent / target if target else page
        assert other.exists(), (page.name, target)
        if anchor:
            titles = re.findall(r"^##+ (.+)$", other.read_text(), re.MULTILINE)
            assert anchor in [title.lower().replace(" ", "-") for title in titles], page.name


def test_files_named_in_the_readme_exist():
    readme = (PROTOCOL / "README.md").read_text()
    names = re.findall(r"^\| `([\w/.]+)` \|", readme, re.MULTILINE)
    assert {"keys.yaml", "errors.yaml", "examples/client.py"} <= set(names)
    for name in names:
        assert (PROTOCOL / name).exists(), name
    assert all(page.name in readme for page in PAGES if page.name != "README.md")


def test_keys_queries_and_qos_equal_the_table_of_topics():
    keys = load("keys.yaml")
    assert keys["keys"] == [contract_files.key_entry(topic) for topic in TOPICS]
    assert keys["queries"] == [contract_files.query_entry(query) for query in QUERIES]
    table = {topic.name: contract_files.qos_entry(topic) for topic in TOPICS if topic.qos}
    assert load("qos.yaml")["qos"] == table
    names = Keys("mower-2", "site/hall_1")
    for entry, topic in zip(keys["keys"], TOPICS, strict=True):
        assert entry["key"].format(base=names.base, robot=names.robot) == names.of(topic)
    for entry in keys["queries"]:
        assert entry["key"].format(base=names.base, robot=names.robot) == names.rpc(entry["name"])


def test_a_recorder_subscribes_to_the_turn_log_last():
    """The daemon takes that subscriber for one that receives all inputs."""
    assert RECORDED[-1] is TURNS
    assert set(RECORDED) == {topic for topic in TOPICS if topic.queues.recorder is not None}
    assert {topic.name for topic in TOPICS if topic.is_input} <= {each.name for each in RECORDED}


def test_queries_make_sense():
    codes = {error["code"] for error in load("errors.yaml")["errors"] if "query" in error["from"]}
    for query in QUERIES:
        assert set(query.errors) <= codes
        assert 0 < query.timeout_s <= 5


@pytest.mark.parametrize("name", contract_files.template_grants())
def test_a_session_template_has_the_keys_of_the_table_of_topics(name):
    text = (PROTOCOL / "config" / f"{name}.json5").read_text()
    assert contract_files.with_keys(text, contract_files.template_grants()[name]) == text
    # And would get them.
    broken = text.replace("/map_update", "/other")
    assert contract_files.with_keys(broken, contract_files.template_grants()[name]) == text


def test_priorities_make_sense():
    def rank(name):
        return PRIORITIES.index(QOS[name].priority)

    assert rank("path") < rank("status") < rank("coverage") < rank("pheromone")
    assert rank("path") == min(map(rank, QOS))
    assert rank("pheromone") == max(map(rank, QOS))
    # An update must not overtake the map it belongs to.
    assert rank("map") == rank("map_update")
    sent = {topic.name for topic in TOPICS if topic.direction.startswith("out")}
    assert {QOS[name].congestion for name in sent} == {"drop"}, "no receiver blocks a daemon"


def test_every_publisher_has_the_quality_of_service_of_a_row():
    """What is published on no key of the contract travels as Zenoh's default does."""
    assert VOLATILE not in QOS.values()
    for path in PROTOCOL.parent.glob("fasaco_edge/**/*.py"):
        for call in re.findall(r"bus\.publisher\([^)]*\)", path.read_text()):
            assert ".qos or" in call, f"{path}: {call}"


def test_limits_are_those_of_the_code():
    def upper(module):
        return {name.lower(): value for name, value in vars(module).items() if name.isupper()}

    assert load("limits.yaml") == {
        **upper(limits),
        **{
            name: value
            for module in (order, keep_outs, passes)
            for name, value in upper(module).items()
            if isinstance(value, int | float)
        },
        **{f"queue_{name}": length for name, length in QUEUE_LENGTHS.items()},
        "replan_period_s": REPLAN_PERIOD_S,
        "most_ledger_tiles": MOST_TILES,
        "most_floor_tiles": MOST_FLOOR_TILES,
    }
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
