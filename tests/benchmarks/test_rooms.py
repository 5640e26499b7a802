"""Benchmark of rooms in its short form, and its judge."""

import json
from dataclasses import replace

import numpy as np

from tests.benchmarks.__main__ import main
from tests.benchmarks.rooms import identity, one_by_one
from tests.benchmarks.rooms.homes import home, seen
from tests.benchmarks.rooms.judge import judge


def test_the_judge_counts_pixels():
    truth = np.array([[1, 1, 1, 1, 2, 2, 2, 2, 0]], np.int32)
    same = judge(truth, truth, 1)
    assert (same.recall, same.precision, same.matthews, same.true, same.found) == (1, 1, 1, 2, 2)
    joined = judge(truth, np.ones_like(truth), 1)
    assert (joined.recall, joined.precision, joined.found) == (1, 0.5, 1)
    assert joined.matthews == 0
    split = judge(truth, np.array([[1, 1, 3, 3, 2, 2, 2, 2, 2]], np.int32), 1)
    assert (split.recall, split.precision, split.found) == (0.75, 1, 3)
    nothing = judge(truth, np.zeros_like(truth), 1)
    assert (nothing.recall, nothing.precision, nothing.found) == (0, 1, 0)


def test_a_floor_seen_in_part_shows_nothing_else():
    floor = home("home", 4)
    free = np.count_nonzero(floor.grid.cells == 0)
    for share in (0.2, 0.8):
        cells = seen(floor, share, 4).cells
        assert share <= np.count_nonzero(cells == 0) / free < share + 0.35
        is_seen = cells >= 0
        assert np.array_equal(cells[is_seen], floor.grid.cells[is_seen])


def test_it_runs_as_a_command(capsys, tmp_path):
    words = ["rooms", "--floors", "1", "--seed", "7", "--pictures", str(tmp_path), "--json"]
    main(words)
    document = json.loads(capsys.readouterr().out)
    groups = {(group["kind"], group["share"]): group for group in document["rooms"]}
    assert len(groups) == 8
    for kind in ("home", "office"):
        whole = groups[kind, 1.0]
        assert min(whole["recall"], whole["precision"]) >= 0.9
    assert len(list(tmp_path.glob("*.png"))) == 8


def test_rooms_keep_their_names_while_the_map_grows(monkeypatch):
    """The short form of ``room-ids``: one map from each place, and a loop closure."""
    monkeypatch.setattr(identity, "MAPS_EACH", 1)
    floor = home("home", 4)
    book, maps, moved = identity.follow(floor, 4, is_named=True)
    assert maps > 30
    assert not moved
    assert len({room.name for room in book.rooms} - {""}) >= 4
    # The judge sees a room that is somewhere else.
    one, other = [room for room in book.rooms if room.name][:2]
    names = one.name, other.name
    book.put(replace(one, name="aside"))
    book.put(replace(other, name=names[0]))
    assert names[0] in identity.name_rooms(book, floor, floor.grid.geometry.origin)


def test_stays_in_rooms_are_counted():
    """A hall, 2, leads to two rooms; the robot comes back to one of them, and to the hall."""
    stays = [(2, 5), (1, 30), (2, 9), (3, 20), (2, 1), (1, 12), (2, 8), (3, 3)]
    assert one_by_one.returns_to(stays) == {2: 2, 1: 1, 3: 0}
    assert one_by_one.passages(stays) == {2}


def test_a_mission_is_judged_with_and_without_a_price_on_rooms(monkeypatch):
    """The short form of ``by-room``: a small home, swept either way in nearly the same time."""
    monkeypatch.setattr(one_by_one, "PROPOSALS", 50_000)
    floor = home("home", 28)
    drives = [one_by_one.drive(floor, 0, policy, "home", 28) for policy in one_by_one.POLICIES]
    assert all(drive.is_done for drive in drives)
    never, auto, always = (drive.seconds for drive in drives)
    assert 0.95 < auto / never < 1.05
    assert 0.95 < always / never < 1.3
    assert min(drive.crossings for drive in drives) >= 8
