"""Sections of the configuration for planner, mission and recorder, and their common base."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec
from msgspec import Meta

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.mission.config import MissionPolicy
from fasaco_edge.planners.colony import ColonyConfig, parse_velocities
from fasaco_edge.planners.registry import PLANNER_NAMES

if TYPE_CHECKING:
    PlannerName = str
else:
    PlannerName = Literal[PLANNER_NAMES]


class Section(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A section, in which unknown keys are errors."""


class PlannerConfig(Section, frozen=True):
    """The colony, see ``planners.colony.ColonyConfig``; and the time one plan may take [s].

    While the robot drives, ``spare_share`` of a processor core goes into making the rest of its
    path better; fasaco with local search alone can do that.

    ``local_search`` is for planners that have it (``planners.registry``), which is fasaco alone;
    without it a plan may end before its budget.

    ``velocities`` is ``8:1`` for cohorts from 8 down to 1, ``1:8``, ``4`` or ``8,4,1``.
    The paper's ants see no further than their neighbours; a robot's see what will soon
    be cut off, which saves it revisits (``fasaco_edge/bench/RESULTS.md``).
    """

    name: PlannerName = "fasaco"
    local_search: bool = True
    ants: Annotated[int, Meta(ge=1, le=1_000_000)] = 200
    velocities: str = "8:1"
    q0: Annotated[float, Meta(ge=0, le=1)] = 0.98
    alpha: Annotated[float, Meta(gt=0, le=1)] = 0.1
    tau0: Annotated[float, Meta(ge=1e-12, le=1e6)] = 0.1
    visibility: Literal["neighbour", "distance", "fewest-open"] = "fewest-open"
    beta: Annotated[float, Meta(ge=0, le=10)] = 2.0
    threads: Annotated[int, Meta(ge=1, le=64)] = 1
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)] = 0
    budget_s: Annotated[float, Meta(gt=0, le=3600)] = 0.1
    spare_share: Annotated[float, Meta(ge=0, le=1)] = 0.05

    def colony(self) -> ColonyConfig:
        """Return these as a colony.

        Raises:
            BadConfiguration: the velocities cannot be read, or there are fewer ants
                than cohorts.
        """
        return ColonyConfig(
            ants=self.ants,
            velocities=parse_velocities(self.velocities),
            q0=self.q0,
            alpha=self.alpha,
            tau0=self.tau0,
            seed=self.seed,
            visibility=self.visibility,
            beta=self.beta,
        )


class MissionSettings(Section, MissionPolicy, frozen=True):
    """The mission's policy, and where progress is kept.

    ``state_dir`` "" is the folder a service manager or the user has for that.
    """

    state_dir: str = ""

    def state_folder(self, environ: Mapping[str, str] = os.environ) -> Path:
        """Return the folder of the coverage ledger.

        By default systemd's $STATE_DIRECTORY, else fasaco-edge in an absolute $XDG_STATE_HOME,
        else in ~/.local/state; BadConfiguration where there is no such home.
        """
        if self.state_dir:
            return _home(Path(self.state_dir))
        if service := environ.get("STATE_DIRECTORY", "").partition(":")[0]:
            return Path(service)
        if (user := environ.get("XDG_STATE_HOME", "")).startswith("/"):
            return Path(user, "fasaco-edge")
        return _home(Path("~/.local/state/fasaco-edge"))


def _home(path: Path) -> Path:
    try:
        return path.expanduser()
    except RuntimeError as error:
        raise BadConfiguration(f"mission.state_dir: {path}: there is no home folder") from error


class RecordingConfig(Section, frozen=True):
    """How large and how old a file may become, and what all may take.

    A recording goes on in the next file after ``part_mb`` [MB] or ``part_min`` [min], 0 for
    never. Of more than ``quota_mb`` [MB] of this robot's files the oldest are deleted; 0 for
    no limit. Nothing is written while the disk has less than ``least_free_mb`` [MB] free.
    """

    part_mb: Annotated[int, Meta(ge=1, le=100_000)] = 64
    part_min: Annotated[float, Meta(ge=0, le=10_000)] = 10.0
    quota_mb: Annotated[int, Meta(ge=0, le=100_000_000)] = 2000
    least_free_mb: Annotated[int, Meta(ge=0, le=100_000_000)] = 200
