"""``python -m wheelhouse``: make a release folder."""

from __future__ import annotations

import argparse
import platform
import subprocess
import sys
from pathlib import Path

from wheelhouse.closure import IncompleteError, Target
from wheelhouse.release import SOURCE, make_release

EPILOG = """\
The folder holds the wheels of fasaco_edge and of all it needs, and what installs them. Copied to a
robot (scp, a USB stick), its install.sh needs no network. Making it needs one; this computer need
not be of the robot's kind. Rerun comes without its viewer: a robot records, it shows nothing.

The robot compiles its kernels while it is installed.

examples:
  make wheelhouse                                  for this kind of computer, Python 3.11
  make wheelhouse ARCH=aarch64                     for a Raspberry Pi
  make wheelhouse ARCH=aarch64 TARGET_PYTHON=3.13  for one with Debian 13
  make wheelhouse ARGS=--without-recording
"""


def main() -> int:
    """Make the folder, and say what is in it."""
    args = _parser().parse_args()
    target = Target(args.arch, args.python)
    try:
        release = make_release(target, args.out, recording=not args.without_recording)
    except (IncompleteError, subprocess.CalledProcessError) as error:
        print(f"wheelhouse: {error}", file=sys.stderr)
        return 1
    print(f"{release}: copy it to the robot and run install.sh there")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="wheelhouse",
        description="Make a folder from which a robot is installed without a network.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--arch",
        choices=("x86_64", "aarch64"),
        default=platform.machine(),
        help="the robot's processor, `uname -m` there (default: this computer's)",
    )
    parser.add_argument(
        "--python", default="3.11", metavar="X.Y", help="the robot's Python (default: %(default)s)"
    )
    parser.add_argument(
        "--out", type=Path, default=SOURCE / "dist", metavar="DIR", help="(default: dist)"
    )
    parser.add_argument("--without-recording", action="store_true", help="leave Rerun out")
    return parser


if __name__ == "__main__":
    sys.exit(main())
