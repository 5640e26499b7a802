"""Rerun viewer without a screen: opens recordings, reports errors, takes pictures.

It needs a Vulkan driver, for example lavapipe (Debian: mesa-vulkan-drivers, libegl1,
libxkbcommon0).

    python -m tests.support.viewer FILE... PICTURE.png --at 0.5
"""

from __future__ import annotations

import argparse
import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import rerun_cli
from rerun.experimental import ViewerClient

DRIVERS = Path("/usr/share/vulkan/icd.d")
WINDOW = (1280, 720)
TIMELINE = "wall"
START_TIMEOUT_S = 120.0
# Software rendering takes a few frames to settle after a jump in time [s].
SETTLE_S = 1.5


@dataclass(frozen=True, slots=True)
class Shot:
    """View of the viewer: its picture (PNG), the names of its views, and their errors."""

    picture: bytes
    views: tuple[str, ...]
    complaints: tuple[str, ...]


def drivers() -> list[Path]:
    """Return the software renderers that are installed."""
    return sorted(DRIVERS.glob("lvp_icd*.json"))


@contextmanager
def headless_viewer() -> Iterator[ViewerClient]:
    """Run a viewer with an invisible window of 1280 x 720."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    binary = Path(rerun_cli.__file__).parent / "rerun"
    size = f"{WINDOW[0]}x{WINDOW[1]}"
    # Only the software renderer, as others may need a screen.
    environment = os.environ | {
        "VK_ICD_FILENAMES": ":".join(map(str, drivers())),
        "XDG_RUNTIME_DIR": os.environ.get("XDG_RUNTIME_DIR", "/tmp"),
        "RUST_LOG": "error",
    }
    options = ["--headless", "--hide-welcome-screen", "--window-size", size, "--port", str(port)]
    process = subprocess.Popen(
        [binary, *options], env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        yield _connected(port, process)
    finally:
        process.terminate()
        process.wait()


def shoot(viewer: ViewerClient, recordings: Sequence[Path], at: float) -> Shot:
    """Open ``recordings``, go to a fraction ``at`` of their time, and return the view."""
    viewer.open([str(path.resolve()) for path in recordings])
    while viewer.get_state().loading:
        time.sleep(0.1)
    time.sleep(SETTLE_S)
    state = viewer.get_state()
    recording = next(one for one in state.recordings if one.store_id == state.active_recording)
    timeline = next(one for one in recording.timelines if one.name == TIMELINE)
    now_ns = timeline.start + round(at * (timeline.end - timeline.start))
    viewer.set_time(TIMELINE, timestamp=now_ns / 1e9, play_state="paused")
    time.sleep(SETTLE_S)
    views = viewer.get_state().views
    complaints = [f"{view.name}: {report}" for view in views for report in view.reports]
    complaints += [log.message for log in viewer.get_logs() if log.level == "ERROR"]
    names = tuple(view.name for view in views)
    return Shot(_screenshot(viewer), names, tuple(complaints))


def _screenshot(viewer: ViewerClient) -> bytes:
    """Return the window as PNG; repeat if its frame takes longer than the viewer's limit, 15 s."""
    deadline = time.monotonic() + START_TIMEOUT_S
    while True:
        try:
            return viewer.take_screenshot()
        except TimeoutError:
            if time.monotonic() > deadline:
                raise


def _connected(port: int, process: subprocess.Popen[bytes]) -> ViewerClient:
    deadline = time.monotonic() + START_TIMEOUT_S
    while True:
        try:
            viewer = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            viewer.get_state()
        except Exception:
            if process.poll() is not None or time.monotonic() > deadline:
                raise
            time.sleep(0.2)
        else:
            return viewer


def main() -> int:
    """Write a picture of recordings at a fraction of their time; return 1 if a view has errors."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("recordings", nargs="+", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--at", type=float, default=1.0, help="fraction of the time, 0 to 1")
    arguments = parser.parse_args()
    with headless_viewer() as viewer:
        shot = shoot(viewer, arguments.recordings, arguments.at)
    arguments.picture.write_bytes(shot.picture)
    for complaint in shot.complaints:
        print(complaint, file=sys.stderr)
    return 1 if shot.complaints else 0


if __name__ == "__main__":
    sys.exit(main())
