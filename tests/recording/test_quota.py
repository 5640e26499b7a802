"""Which recording is older, whatever the clock said; and which ones go."""

from __future__ import annotations

import os
from datetime import UTC, datetime
from pathlib import Path

import pytest

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.recording.write.quota import delete_oldest, next_run, oldest_first

AT_BOOT, LAST_WEEK, NEXT_YEAR = (
    datetime(year, month, 20, 10, tzinfo=UTC) for year, month in ((1970, 1), (2026, 11), (2027, 11))
)


def run(folder: Path, began: datetime, robot: str = "maja", parts: int = 1) -> list[str]:
    names = [f"{next_run(folder, robot, began)}-part{number + 1}.rrd" for number in range(parts)]
    for name in names:
        (folder / name).write_bytes(bytes(10))
    return names


def order(folder: Path, robot: str = "maja") -> list[str]:
    return [path.name for path, _ in oldest_first(folder, robot)]


def test_a_clock_that_goes_back_makes_no_newer_part_go(tmp_path):
    runs = [run(tmp_path, began, parts=2) for began in (LAST_WEEK, AT_BOOT, NEXT_YEAR, LAST_WEEK)]
    assert order(tmp_path) == [name for names in runs for name in names]
    assert sorted(order(tmp_path)) == order(tmp_path), "nor does a listing show it elsewhere"
    deleted = delete_oldest(tmp_path, "maja", 30)
    assert [path.name for path in deleted] == runs[0] + runs[1] + runs[2][:1]


def test_runs_without_a_number_are_older_than_those_with_one(tmp_path):
    old = [
        "20261101T000012Z-maja-part1.rrd",
        "20261120T100000Z-maja-part2.rrd",
        "20261120T100000Z-maja-part10.rrd",
    ]
    for name in old:
        (tmp_path / name).write_bytes(bytes(10))
    new = run(tmp_path, AT_BOOT)
    assert order(tmp_path) == [*old, *new]


def test_another_robots_recordings_and_links_are_left_alone(tmp_path):
    others = [run(tmp_path, LAST_WEEK, robot)[0] for robot in ("maja-2", "my-maja", "maja2")]
    outside = tmp_path / "outside"
    outside.write_bytes(bytes(10))
    link = tmp_path / "run00001-20261120T100000Z-maja-part1.rrd"
    link.symlink_to(outside)
    mine = run(tmp_path, LAST_WEEK)
    assert order(tmp_path) == mine
    assert [path.name for path in delete_oldest(tmp_path, "maja", 5)] == mine
    assert outside.exists()
    assert all((tmp_path / name).exists() for name in others)


def test_runs_count_from_1_but_an_unreadable_folder_is_an_error(tmp_path, monkeypatch):
    assert next_run(tmp_path / "none", "maja", LAST_WEEK) == "run00001-20261120T100000Z-maja"
    # A number of ten digits would be found by nobody.
    (tmp_path / "run999999999-x.rrd").touch()
    assert next_run(tmp_path, "maja", LAST_WEEK) == "run00001-20261120T100000Z-maja"

    def refuse(_folder: object) -> list[str]:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "listdir", refuse)
    with pytest.raises(BadConfiguration, match="cannot record into"):
        next_run(tmp_path, "maja", LAST_WEEK)
