"""From the files of a run to its review."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from fasaco_edge.recording.run_reading import read_run_record
from fasaco_edge.recording.samples import RecordedSamples
from fasaco_edge.review.review import Review, review_of
from fasaco_edge.review.story import gather


def read_review(paths: Sequence[Path], advance: Callable[[int], None] = lambda _: None) -> Review:
    """Read the parts of one run, and review it.

    Args:
        paths: the files, in any order; they are left as they are.
        advance: called now and then with the number of frames read since.

    Raises:
        UnreadableRecording: a file is missing, no recording, or without samples.
        DifferentRuns: the parts are not of one run.
    """
    record = read_run_record(paths, advance)
    samples = RecordedSamples.of(record.batches)
    story = gather(samples, record.began_ns)
    return review_of(record, story, samples.missing)
