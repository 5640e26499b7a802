"""A progress bar of a search: the budget used up, or the ants that walked."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from fasaco_edge.cli.console import terminal
from fasaco_edge.planners.planner import SearchProgress

# A terminal shows no more pictures a second; drawing them costs the search time.
LEAST_INTERVAL_S = 0.05


@contextmanager
def watching(
    total: float | None, *, counted: bool = False
) -> Iterator[Callable[[SearchProgress], None]]:
    """Yield a display of the progress of a search.

    Args:
        total: of its budget [s], or with ``counted`` of its ants.
        counted: whether its ants are counted.
    """
    with terminal.progress(counted=counted) as bar:
        task = bar.add_task("ants", total=total)
        began = shown = time.perf_counter()

        def show(search: SearchProgress) -> None:
            nonlocal shown
            now = time.perf_counter()
            if not bar.disable and now - shown >= LEAST_INTERVAL_S:
                shown = now
                done = search.work.ants if counted else now - began
                bar.update(task, completed=done, description=_words(search))

        yield show


def _words(search: SearchProgress) -> str:
    words = f"{search.steps} steps"
    return words if search.gap is None else f"{words}, {search.gap:.2%} above the bound"
