"""The choice of the newest run among the recordings named on the command line."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from fasaco_edge.cli.console import terminal
from fasaco_edge.errors import DifferentRuns
from fasaco_edge.recording.read.frames import is_fleet_recording, recording_id

# Number, time and robot of a run: run00002-20261130T064945Z-robot.
_NAME = re.compile(r"(run\d+|)-?\d{8}T\d{6}Z-(?P<robot>.*)")


def files_of_a_run(paths: Sequence[Path]) -> list[Path]:
    """Return the files of the newest run; print a note if there are other runs.

    If there is a fleet's recording, those of its robots are ignored.

    Raises:
        DifferentRuns: the files are of several robots.
        UnreadableRecording: a file is missing, or is not a recording.
    """
    fleets = [path for path in paths if is_fleet_recording(path)]
    runs: dict[str, list[Path]] = {}
    for path in fleets or paths:
        runs.setdefault(recording_id(path), []).append(path)
    # A part has no name if its recorder was killed just after it began.
    nameless = runs.pop("", [])
    robots = {match["robot"] if (match := _NAME.match(run)) else run for run in runs}
    if len(robots) > 1:
        raise DifferentRuns(
            f"recordings of several robots: {', '.join(sorted(robots))}",
            hint="name the files of one robot at a time, or the recording of their fleet",
        )
    if len(runs) > 1:
        terminal.say(
            terminal.err(),
            f"{len(runs)} runs: this is the newest, {max(runs)}; for another run name its files, "
            f"such as {min(runs)}-*.rrd",
        )
    return [*(runs[max(runs)] if runs else []), *nameless]
