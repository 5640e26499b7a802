"""Planner of the user's own in a process beside the daemon, and what plans where it fails.

The code may raise, hang, crash or fill its memory: that costs one plan, which another planner
makes. Code that cannot be loaded, and a process that hangs or dies, are not tried again.
"""

from __future__ import annotations

import math
import os
import pickle
import socket
import subprocess
import time
from collections.abc import Callable

import numpy as np

from fasaco_edge.errors import BadConfiguration, FasacoError, PlannerFailed
from fasaco_edge.host.processes import python_program
from fasaco_edge.planners.cost import NO_WORK
from fasaco_edge.planners.own.child import FAILURES, LENGTH, WALK
from fasaco_edge.planners.own.planner import path_of
from fasaco_edge.planners.own.problem import posed
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.planner import (
    CoveragePlanner,
    Observer,
    SearchProgress,
    StoppingCriterion,
)
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.text import lines

# How long a plan may take [s], and the first one, with the imports.
MOST_S, FIRST_S = 5.0, 60.0
# The stopping criterion is called this often: the daemon's watchdog counts these calls [s].
PERIOD_S = 0.1
# Limits on a walk, as on a path in a message [bytes], and on a text.
MOST_BYTES = 64 * 1024 * 1024
MOST_TEXT = 500


class OwnProcess:
    """Plans by the user's own code, in a process of its own.

    Args:
        place: ``MODULE:NAME``.
        seed: passed to the code.
        instead: plans where the code fails.
        tell: called with each failure, on the planning thread.
    """

    def __init__(
        self,
        place: str,
        seed: int,
        instead: CoveragePlanner,
        tell: Callable[[FasacoError], None],
    ) -> None:
        self._place, self._seed = place, seed
        self._instead, self._tell = instead, tell
        self._process: subprocess.Popen[bytes] | None = None
        self._other: socket.socket | None = None
        self._is_given_up = False

    def plan(
        self, problem: CoverageProblem, stop: StoppingCriterion, observe: Observer
    ) -> CoveragePath:
        """Return the code's walk, or the other planner's; ``stop`` ends the latter alone."""
        if not self._is_given_up:
            try:
                return self._planned(problem, stop)
            except FasacoError as error:
                if isinstance(error, BadConfiguration):
                    self._give_up()
                self._tell(error)
        return self._instead.plan(problem, stop, observe)

    def _planned(self, problem: CoverageProblem, stop: StoppingCriterion) -> CoveragePath:
        began, most_s = time.monotonic(), FIRST_S if self._other is None else MOST_S
        try:
            other = self._other or self._start()
            question = pickle.dumps(posed(problem, self._seed))
            exchange = _Exchange(other, began + most_s, stop)
            exchange.send(LENGTH.pack(len(question)) + question)
            (size,) = LENGTH.unpack(exchange.receive(LENGTH.size))
            if not 0 < size <= MOST_BYTES:
                raise EOFError
            answer = exchange.receive(size)
        except TimeoutError:
            raise self._given_up(f"no walk within {most_s:g} s") from None
        except (OSError, EOFError) as error:
            why = f"; {error.strerror}" if isinstance(error, OSError) and error.strerror else ""
            raise self._given_up(f"its process has ended{why}") from error
        if answer[:1] == WALK:
            cells = np.frombuffer(answer, np.int32, offset=1).reshape(-1, 2)
            taken_s = time.monotonic() - began
            return path_of(problem, cells, self._place, self._seed, taken_s)
        said = lines(answer[1:].decode(errors="replace"), MOST_TEXT)
        raise FAILURES.get(answer[:1], PlannerFailed)(said)

    def _start(self) -> socket.socket:
        mine, its = socket.socketpair()
        with its:
            self._process = subprocess.Popen(
                [*python_program("fasaco_edge.planners.own.child"), self._place, str(its.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                pass_fds=(its.fileno(),),
                env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
            )
        self._other = mine
        return mine

    def _given_up(self, why: str) -> PlannerFailed:
        self._give_up()
        return PlannerFailed(
            f"planner {self._place}: {why}",
            hint="planner.name plans until the daemon is started or reloaded; try the planner by "
            "fasaco-edge plan --planner",
        )

    def _give_up(self) -> None:
        self._is_given_up = True
        if self._other is not None:
            self._other.close()
        if self._process is not None:
            self._process.kill()
            self._process.wait()


class _Exchange:
    """One message each way, with a timeout; calls the stopping criterion meanwhile."""

    def __init__(self, other: socket.socket, until: float, stop: StoppingCriterion) -> None:
        self._other, self._until, self._stop = other, until, stop
        other.settimeout(PERIOD_S)

    def send(self, message: bytes) -> None:
        left = memoryview(message)
        while left:
            try:
                left = left[self._other.send(left[: 1 << 20]) :]
            except TimeoutError:
                self._wait()

    def receive(self, size: int) -> bytes:
        parts = bytearray()
        while len(parts) < size:
            try:
                part = self._other.recv(min(size - len(parts), 1 << 20))
            except TimeoutError:
                self._wait()
                continue
            if not part:
                raise EOFError
            parts += part
        return bytes(parts)

    def _wait(self) -> None:
        self._stop(SearchProgress(NO_WORK, math.inf, 0))
        if time.monotonic() >= self._until:
            raise TimeoutError
