"""The configuration, read again: what is taken, what needs a restart, what is kept out."""

from __future__ import annotations

import threading

import msgspec
import pytest

from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.notify import ServiceManager
from fasaco_edge.daemon.reload import (
    CHANGEABLE,
    FIXED,
    Reload,
    changed_keys,
    is_changeable,
    with_changeable,
)
from fasaco_edge.errors import BadConfiguration, OpenToEveryone, together
from tests.support.outsider import TIMEOUT_S

RUNNING = DaemonConfig()


def configured(**sections) -> DaemonConfig:
    return msgspec.convert(sections, DaemonConfig)


def reloaded(written: DaemonConfig) -> DaemonConfig:
    reload = Reload(lambda: written, ServiceManager({}))
    reload.asked.set()
    taken, faults = taken_by(reload)
    assert faults == []
    return taken


def taken_by(reload: Reload) -> tuple[DaemonConfig, list[BadConfiguration]]:
    ended = threading.Event()
    reload.begin(RUNNING, ended.set)
    assert reload.is_reading
    assert not reload.asked.is_set()
    assert ended.wait(TIMEOUT_S)
    assert reload.is_read
    try:
        return reload.take(RUNNING)
    finally:
        assert not reload.is_reading


@pytest.mark.parametrize(
    "sections",
    [
        {"planner": {"ants": 50, "seed": 3}},
        {"map": {"free_at_most": 10}},
        {"mission": {"retries": 5, "retry_s": 1.0, "lost_pose_s": 9.0, "stale_map_s": 8.0}},
        {"mission": {"until_min": 5.0, "by_room": "always"}},
        {"mission": {"keep_out": [[[0, 0], [1, 0], [1, 1]]], "keep_out_mask": "a.yaml"}},
        {"robot": {"speed_m_s": 1.0, "quarter_turn_s": 0.0}},
    ],
)
def test_changeable_keys_take_effect(sections, caplog):
    written = configured(**sections)
    caplog.set_level("INFO")
    assert reloaded(written) == written
    for name, section in sections.items():
        assert all(f"{name}.{key}" in caplog.text for key in section)
    assert "needs a restart" not in caplog.text


@pytest.mark.parametrize(
    ("key", "sections"),
    [
        ("robot.name", {"robot": {"name": "other"}}),
        ("robot.tool_width_m", {"robot": {"tool_width_m": 0.5}}),
        ("bus.base", {"bus": {"base": "else"}}),
        ("bus.security", {"bus": {"security": {"roles": {"mapper": ["a"]}}}}),
        ("mission.autostart", {"mission": {"autostart": False}}),
        ("pose.schema", {"pose": {"schema": "nav_msgs/msg/Odometry"}}),
        ("recording.part_mb", {"recording": {"part_mb": 7}}),
        ("ros2", {"ros2": {"kind": "bridge"}}),
    ],
)
def test_other_keys_are_named_and_unchanged(key, sections, caplog):
    assert reloaded(configured(**sections)) == RUNNING
    assert f"{key}: needs a restart" in caplog.text


def test_changeable_and_other_keys_are_separated():
    written = configured(robot={"name": "other", "speed_m_s": 2.0})
    taken = reloaded(written)
    assert (taken.robot.name, taken.robot.speed_m_s) == ("robot", 2.0)


def test_an_invalid_file_changes_nothing(caplog):
    def read() -> DaemonConfig:
        first = BadConfiguration("expected a whole number, got 'many'", key="planner.ants")
        raise together([first, OpenToEveryone("anybody may join", key="bus.listen[0]")])

    reload = Reload(read, ServiceManager({}))
    reload.asked.set()
    taken, faults = taken_by(reload)
    assert taken == RUNNING
    said = ["planner.ants: expected a whole number, got 'many'", "bus.listen[0]: anybody may join"]
    assert [str(fault) for fault in faults] == said
    assert all(
        f"configuration refused, the previous one stays in force: {s}" in caplog.text for s in said
    )
    assert [record.code for record in caplog.records] == ["bad_configuration", "open_to_everyone"]


def test_every_changeable_key_is_one():
    sections = ("robot", "map", "mission", "planner")
    keys = {f"{n}.{k}" for n in sections for k in getattr(RUNNING, n).__struct_fields__}
    assert {"planner", "map", "mission"} | keys >= CHANGEABLE
    assert keys >= FIXED
    assert is_changeable("planner.ants")
    assert not is_changeable("robot.name")
    # What the memory is shared out by, once.
    assert not is_changeable("map.max_pixels")
    assert not is_changeable("map.max_lattice_cells")
    assert changed_keys(RUNNING, RUNNING) == []
    assert with_changeable(RUNNING, RUNNING) == RUNNING
