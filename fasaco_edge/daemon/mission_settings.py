"""Configuration of the mission, and of where its progress is kept."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from msgspec import Meta

from fasaco_edge.daemon.section import Section
from fasaco_edge.errors import BadConfiguration


class MissionSettings(Section, frozen=True):
    """Whether to begin without being told to, how patient to be, and where progress is kept.

    What is blocked or left over in the end is tried again ``retries`` times, each after
    ``retry_s`` [s]. Without a pose for ``lost_pose_s`` [s], or a map or an update for
    ``stale_map_s`` [s], the state is degraded; 0 for never. ``state_dir`` "" is the folder a
    service manager or the user has for that.
    """

    autostart: bool = True
    retries: Annotated[int, Meta(ge=0, le=100)] = 2
    retry_s: Annotated[float, Meta(ge=0, le=86_400)] = 30.0
    lost_pose_s: Annotated[float, Meta(ge=0, le=86_400)] = 3.0
    stale_map_s: Annotated[float, Meta(ge=0, le=86_400)] = 0.0
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
