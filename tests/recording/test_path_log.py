"""Paths in the log of a recording: a line for each kind of plan, the others of level DEBUG."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("rerun")

from fasaco_edge.recording import entities
from fasaco_edge.recording.scene.blueprint import build_blueprint
from fasaco_edge.recording.scene.drawings import LOGGED_AGAIN_NS, PathDrawing
from fasaco_edge.recording.scene.layers import Anchor, Layers
from fasaco_edge.recording.write.quota import DiskBudget
from fasaco_edge.recording.write.writer import RecordingWriter
from fasaco_edge.wire.documents.path_documents import PathAttachment
from fasaco_edge.wire.messages.paths import PathMessage
from tests.support.recordings import TEXT, read_column

SECOND_NS = 1_000_000_000


def shown(folder, paths):
    """Return the lines of paths that are not of level DEBUG: when [s], and the reason."""
    writer = RecordingWriter(folder, "run", DiskBudget(10**9, 0), build_blueprint(None))
    drawing, empty = PathDrawing(writer, Layers()), np.zeros((0, 2))
    for revision, (at_s, reason, planner) in enumerate(paths, 1):
        writer.at(at_s * SECOND_NS)
        about = PathAttachment(revision=revision, reason=reason, planner=planner)
        drawing.add(PathMessage("map", 0, empty, empty[:, 0]), about, Anchor())
    assert writer.close()
    (part,) = folder.glob("*.rrd")
    texts = read_column(part, entities.PATH_LOG, TEXT)
    levels = read_column(part, entities.PATH_LOG, "TextLog:level").values
    # Each path is in the recording.
    assert len(texts.values) == len(paths)
    return [
        (at_ns // SECOND_NS, text.partition(": ")[2].partition(" (")[0])
        for at_ns, (text,), (level,) in zip(texts.wall_ns, texts.values, levels, strict=True)
        if level != "DEBUG"
    ]


def test_of_plans_of_one_kind_the_first_is_shown_and_one_a_minute(tmp_path):
    minute = LOGGED_AGAIN_NS // SECOND_NS
    paths = [
        (0, "first plan", "aco"),
        (1, "map: 3 cells more", "aco"),
        (2, "line polished", None),
        (3, "map: 1 cell more", "aco"),
        (4, "first plan", "aco"),
        (5, "map: 2 cells more", "aco"),
        (6, "map: 4 cells more", "aco"),
        (minute + 5, "map: 5 cells more", "aco"),
    ]
    assert shown(tmp_path, paths) == [
        (at_s, paths[index][1]) for index in (0, 1, 4, 5, 7) for at_s in (paths[index][0],)
    ]
