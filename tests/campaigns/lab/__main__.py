"""Missions in the lab: the product in ir-sim, with OpenKarto's mapper, judged by the true poses.

    python -m tests.campaigns.lab --building office --seed 1 --out DIR
    python -m tests.campaigns.lab table --maps DIR

Takes minutes.

Base, mapper, mission and follower run in one process in simulated time: the same seed gives the
same mission, bit for bit, however busy the machine is. ``table`` runs several and prints a table.
A small change of anything makes another mission: compare several seeds (``--seeds``). It needs
``pip install -e ".[lab]"``, or ``--own usual``: the project's own base and mapper. Exit code 1
after a false done or a deadlock.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import time
from collections.abc import Callable
from dataclasses import fields, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

from tests.campaigns.lab.own import NOISES
from tests.campaigns.lab.settings import LabSettings

if TYPE_CHECKING:
    from tests.campaigns.lab.report import Judged

# Buildings of the table: the project's own, and those of the folder given by --maps.
OWN, OTHERS = ("office", "flat"), ("tb3_world", "aws_small_house")
OPTIONS = {
    "seed": "of all noise",
    "people": "how many walk about",
    "noise_m": "scatter of the lidar [m]",
    "radius_m": "radius that the product is told [m]",
    "hull_m": "radius of the hull that collides [m]",
    "clearance_m": "what its lines keep beside the radius [m]",
    "seconds": "limit of simulated time [s]; 0 for one by the size of the building",
    "pose_hz": "rate of poses [1/s]",
    "scan_hz": "rate of scans that are offered to the mapper [1/s]",
    "speed_m_s": "speed of the robot [m/s]",
    "tool_m": "width of its tool [m]",
    "turn_radius_m": "tightest arc of the own base [m]; 0 if it turns on the spot",
    "left_m": "how far the robot is to the left of where its follower takes it to be [m]",
    "swept": "share of the floor that is asked for; 0 for what is worth its time",
}


def main() -> int:
    """Run one mission, or several for a table."""
    args = _parser().parse_args()
    try:
        from tests.campaigns.lab import report
    except ModuleNotFoundError as error:
        print(f'{error}: the lab needs pip install -e ".[lab]"', file=sys.stderr)
        return 2
    if args.command is None:
        found = _mission(args, args.building[0] if args.building else OWN[0], args.seed, args.out)
        print(json.dumps(found.document()) if args.json else report.in_words(found))
        return int(found.figures.is_fault)
    all_found = []
    seeds = range(args.seed, args.seed + args.seeds)
    for name, seed in product(args.building or _names(args.maps), seeds):
        found = _mission(args, name, seed, args.out and args.out / f"{Path(name).stem}_{seed}")
        print(report.in_words(found), file=sys.stderr, flush=True)
        all_found.append(found)
    if args.json:
        print(json.dumps([found.document() for found in all_found]))
    else:
        print(report.table(all_found))
    return int(any(found.figures.is_fault for found in all_found))


def _names(folder: Path | None) -> list[str]:
    """Return the buildings of the table."""
    others = [name for name in OTHERS if folder and (folder / f"{name}.yaml").is_file()]
    return [*OWN, *others]


def _mission(args: argparse.Namespace, name: str, seed: int, out: Path | None) -> Judged:
    from tests.campaigns.lab.building import Building
    from tests.campaigns.lab.mission import run_mission
    from tests.campaigns.lab.report import judged

    given = {field.name: getattr(args, field.name) for field in fields(LabSettings)}
    began = time.perf_counter()
    settings = replace(LabSettings(**given), seed=seed)
    run = run_mission(Building.read(name, args.maps, args.start), settings)
    return judged(run, time.perf_counter() - began, out)


def _parser() -> argparse.ArgumentParser:
    about, _, epilog = (__doc__ or "").partition("\n\n")
    parser = argparse.ArgumentParser(
        prog="python -m tests.campaigns.lab",
        description=about,
        epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("command", nargs="?", choices=("table",), help="run several missions")
    add("--building", action="append", help="a map's name or file; of a table several")
    add("--seeds", type=int, default=1, metavar="N", help="of a table: seeds from --seed on")
    add("--maps", type=Path, metavar="DIR", help="a folder with further maps")
    add("--start", type=_numbers(3), metavar="X,Y,YAW", help="where it starts [m, rad]")
    add("--walk", type=_numbers(4), metavar="X1,Y1,X2,Y2", help="where people walk [m]")
    add("--scan", action="store_true", help="give the follower the lidar's scans")
    add("--own", default="", choices=sorted(NOISES), help="the project's own base and mapper")
    add("--ideal", action="store_true", help="no slip, no drift")
    defaults = LabSettings()
    for name, what in OPTIONS.items():
        default = getattr(defaults, name)
        option = "--" + re.sub("_(m|s|m_s)$", "", name).replace("_", "-")
        told = f"{what} (default: {default:g})"
        add(option, dest=name, type=type(default), default=default, metavar="N", help=told)
    add("--out", type=Path, metavar="DIR", help="write picture, map and figures there")
    add("--json", action="store_true", help="print figures as JSON")
    return parser


def _numbers(count: int) -> Callable[[str], tuple[float, ...]]:
    def numbers(text: str) -> tuple[float, ...]:
        found = tuple(map(float, text.split(",")))
        if len(found) != count:
            raise argparse.ArgumentTypeError(f"must be {count} numbers, got {text!r}")
        return found

    return numbers


if __name__ == "__main__":
    sys.exit(main())
