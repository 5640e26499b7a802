"""How curves and states look: static, logged once."""

from __future__ import annotations

import numpy as np

from fasaco_edge.recording import entities
from fasaco_edge.recording.scene.archetypes import (
    COVERED_COLOUR,
    RECOVERED_COLOUR,
    TRAIL,
    Colour,
    style_archetype,
)
from fasaco_edge.recording.sdk import rr
from fasaco_edge.recording.write.journal import Journal

CURVES: tuple[tuple[str, str, Colour], ...] = (
    (entities.COVERED_FRACTION, "covered", COVERED_COLOUR),
    (entities.RECOVERED_FRACTION, "again", RECOVERED_COLOUR),
    (f"{entities.LATENCY}/ingest", "map in", (56, 152, 222)),
    (f"{entities.LATENCY}/plan", "plan", (167, 139, 250)),
    (f"{entities.LATENCY}/map_to_path", "map to path", (245, 140, 40)),
    (entities.BEST_STEPS, "best walk", (250, 204, 21)),
    (entities.GAP, "gap of the plan", (250, 204, 21)),
    (f"{entities.MEMORY}/planner", "planner MB", (167, 139, 250)),
    (f"{entities.MEMORY}/recorder", "recorder MB", (156, 163, 175)),
    (entities.PROCESSOR, "planner %", (245, 140, 40)),
)

GREEN, AMBER, RED, BLUE, VIOLET, GREY = (
    0x059669FF,
    0xD97706FF,
    0xDC2626FF,
    0x2563EBFF,
    0x7C3AEDFF,
    0x6B7280FF,
)

STATES: dict[str, dict[str, int]] = {
    entities.MISSION_STATE: {
        "idle": GREY,
        "waiting for map": GREY,
        "waiting for pose": GREY,
        "loading": VIOLET,
        "planning": VIOLET,
        "covering": GREEN,
        "returning": GREEN,
        "paused": AMBER,
        "blocked": RED,
        "degraded": AMBER,
        "done": BLUE,
        "silent": AMBER,
    },
    entities.PLANNER_STATE: {"idle": GREY, "planning": VIOLET},
    entities.RECORDER_STATE: {
        "recording": GREEN,
        "disk full": RED,
        "stalled": AMBER,
        "stopping": GREY,
    },
}


def log_styles(journal: Journal) -> None:
    """Log names and colours of all curves and states."""
    journal.log_static(entities.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    journal.log_static(entities.TRAIL, style_archetype(TRAIL))
    for entity, name, colour in CURVES:
        line = rr.SeriesLines(names=name, colors=colour, widths=1.5, interpolation_mode="StepAfter")
        journal.log_static(entity, line)
    for entity, colours in STATES.items():
        states = list(colours)
        palette = np.array(list(colours.values()), np.uint32)
        journal.log_static(
            entity, rr.StateConfiguration(values=states, labels=states, colors=palette)
        )
