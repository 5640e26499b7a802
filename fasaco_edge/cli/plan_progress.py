"""The progress bar of ``fasaco-edge plan``."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from fasaco_edge.cli.terminal import progress, progress_of_time

if TYPE_CHECKING:
    from fasaco_edge.planners.colony import ColonyConfig
    from fasaco_edge.planners.work import SearchProgress

# A terminal shows no more pictures a second; drawing them costs the search time.
LEAST_INTERVAL_S = 0.05


@contextmanager
def watching(
    args: argparse.Namespace, colony: ColonyConfig
) -> Iterator[Callable[[SearchProgress], None]]:
    """Yield what shows how far a search is: the budget used up, else the ants that walked."""
    with progress_of_time() if args.local_search else progress() as bar:
        total = args.budget if args.local_search else colony.ants
        task = bar.add_task("ants", total=total)
        began = shown = time.perf_counter()

        def show(search: SearchProgress) -> None:
            nonlocal shown
            now = time.perf_counter()
            if not bar.disable and now - shown >= LEAST_INTERVAL_S:
                shown = now
                done = now - began if args.local_search else search.work.ants
                bar.update(task, completed=done, description=_words(search))

        yield show


def _words(search: SearchProgress) -> str:
    words = f"{search.steps} steps"
    return words if search.gap is None else f"{words}, {search.gap:.2%} above the bound"
