"""Paths in the log of a recording: a line for each kind of plan, the others of level DEBUG."""

from __future__ import annotations

import pytest

pytest.importorskip("rerun")

from fasaco_edge.recording import entities
from fasaco_edge.recording.scene.blueprint import build_blueprint
from fasaco_edge.recording.scene.drawings import GROUP_NS, PathLog
from fasaco_edge.recording.write.quota import DiskBudget
from fasaco_edge.recording.write.writer import RecordingWriter
from fasaco_edge.wire.documents.path_documents import PathAttachment
from tests.support.recordings import TEXT, read_column

SECOND_NS = 1_000_000_000


def shown(folder, paths):
    """Return the lines of paths that are not of level DEBUG: when [s], and the text."""
    writer = RecordingWriter(folder, "run", DiskBudget(10**9, 0), build_blueprint(None))
    log = PathLog(writer)
    for revision, (at_s, reason, planner) in enumerate(paths, 1):
        writer.at(at_s * SECOND_NS)
        log.catch_up()
        log.add(PathAttachment(revision=revision, reason=reason, planner=planner), reason)
    log.finish()
    assert writer.close()
    (part,) = folder.glob("*.rrd")
    texts = read_column(part, entities.PATH_LOG, TEXT)
    levels = read_column(part, entities.PATH_LOG, "TextLog:level").values
    # Each path is in the recording.
    assert {reason for _, reason, _ in paths} <= {text for (text,) in texts.values}
    return [
        (at_ns // SECOND_NS, text)
        for at_ns, (text,), (level,) in zip(texts.wall_ns, texts.values, levels, strict=True)
        if level != "DEBUG"
    ]


def test_polished_lines_are_left_out_and_plans_grouped(tmp_path):
    paths = [
        (0, "first plan", "aco"),
        (1, "map: 3 cells more", "aco"),
        (2, "line polished", None),
        (3, "map: 1 cell more", "aco"),
        (4, "map: passages changed", "aco"),
        (5, "better further on", "aco"),
    ]
    assert shown(tmp_path, paths) == [
        (0, "first plan"),
        (1, "map: 3 cells more"),
        (5, "2 more plans up to path 5: the map changed"),
        (5, "better further on"),
    ]


def test_a_group_ends_after_a_minute(tmp_path):
    minute = GROUP_NS // SECOND_NS
    paths = [(at_s, f"map: {at_s} cells more", "aco") for at_s in (0, 30, minute + 10, minute + 20)]
    assert shown(tmp_path, paths) == [
        (0, "map: 0 cells more"),
        (minute + 10, "1 more plan up to path 2: the map changed"),
        (minute + 10, f"map: {minute + 10} cells more"),
        (minute + 20, "1 more plan up to path 4: the map changed"),
    ]
