"""From the files of a run to its review."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import count
from pathlib import Path
from typing import TypeVar

from fasaco_edge.recording.read.run import count_frames, read_run_record
from fasaco_edge.recording.read.samples import RecordedSamples
from fasaco_edge.review.review import Review, review_of
from fasaco_edge.review.story import gather

# So often is progress told: each so many-th frame or sample.
EVERY = 200

Tell = Callable[[str, int, int], None]
"""Hears what is being done, how much of it is done, and how much there is in all."""
Item = TypeVar("Item")


def read_review(paths: Sequence[Path], tell: Tell = lambda *_: None) -> Review:
    """Read the parts of one run, and review it.

    Args:
        paths: the files, in any order; they are left as they are.
        tell: hears of progress now and then.

    Raises:
        UnreadableRecording: a file is missing, no recording, or without samples.
        DifferentRuns: the parts are not of one run.
    """
    total, numbers = count_frames(paths), count(1)
    record = read_run_record(paths, lambda: tell("reading", next(numbers), total))
    samples = RecordedSamples.of(record.batches)
    # Samples are numbered: the last batch tells about how many there are.
    about = max(batch.place.first for batch in record.batches) + 1
    story = gather(_told(samples, tell, "decoding", about), record.began_ns)
    tell("following the robot", 0, 1)
    return review_of(record, story, samples.missing)


def _told(items: Iterable[Item], tell: Tell, task: str, total: int) -> Iterator[Item]:
    for number, item in enumerate(items):
        if number % EVERY == 0:
            tell(task, min(number, total), total)
        yield item
