"""The planning thread; its kernels release the interpreter lock, so that the loop keeps running."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

from fasaco_edge.bus.mailbox import LatestSlot
from fasaco_edge.errors import PlanFailed
from fasaco_edge.mission.events import PlanBroken, PlanReady, PlanRequest
from fasaco_edge.mission.path.plan_requests import most_s
from fasaco_edge.planners.planner import (
    AnyOf,
    CoveragePlanner,
    Interrupt,
    SearchProgress,
    StopRecorder,
    TimeBudget,
    ignore,
)

LOG = logging.getLogger(__name__)


class PlanningWorker:
    """Plans one request at a time and posts the result.

    Attributes:
        progress: counts the stop checks of a search and the waits for a request; it stands still
            only if the thread hangs.
    """

    def __init__(
        self, planner: CoveragePlanner, budget_s: float, post: Callable[[str, object], None]
    ) -> None:
        self.progress = 0
        self._planner = planner
        self._budget_s = budget_s
        self._post = post
        self._requests = LatestSlot[PlanRequest]()
        self._stopping = threading.Event()
        self._interrupt = threading.Event()
        self._thread = threading.Thread(target=self._run, name="planner", daemon=True)
        self._thread.start()

    def submit(self, request: PlanRequest) -> None:
        """Plan ``request`` next."""
        self._requests.put(request)

    def interrupt(self) -> None:
        """End the current search with its best walk, as a newer request waits."""
        self._interrupt.set()

    def disown(self) -> None:
        """Interrupt the search; its result is not posted, and the thread ends by itself."""
        self._stopping.set()
        self._interrupt.set()

    def close(self, timeout_s: float) -> None:
        """Interrupt the search and end the thread."""
        self.disown()
        self._thread.join(timeout_s)

    def _run(self) -> None:
        try:
            while not self._stopping.is_set():
                self.progress += 1
                request = self._requests.take(timeout_s=0.2)
                if request is not None:
                    self._plan(request)
        except BaseException as error:
            self._post("failed", error)

    def _plan(self, request: PlanRequest) -> None:
        started = time.monotonic()
        self._interrupt.clear()
        if self._stopping.is_set():
            return
        problem = request.problem
        budget_s = most_s(problem) if problem.only_better else self._budget_s
        stop = StopRecorder(AnyOf(self._count, TimeBudget(budget_s), Interrupt(self._interrupt)))
        try:
            path = self._planner.plan(problem, stop, ignore)
        except Exception as error:
            # Exiting would not help, as the same map arrives again after a restart.
            LOG.exception("plan %d", request.number, extra={"event": "plan_failed"})
            why = f"plan {request.number} failed: {type(error).__name__}: {error}"
            self._post("plan", PlanBroken(request.number, PlanFailed(why)))
            return
        seconds = time.monotonic() - started
        if self._stopping.is_set():
            return
        self._post("plan", PlanReady(request.number, path, seconds, tuple(stop.stops)))

    def _count(self, progress: SearchProgress) -> bool:
        self.progress += 1
        return False
