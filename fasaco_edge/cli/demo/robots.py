"""The robots of a demo: start, configuration and programs of each."""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from pathlib import Path

import yaml

from fasaco_edge.cli.console.arguments import writing
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.map_files import find_map, read_map
from fasaco_edge.planners.grids import start_point
from fasaco_edge.simulation.robot import SimulationConfig
from fasaco_edge.wire.keys import Keys

FLEET = "demo"

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class DemoRobot:
    """A simulated robot and its daemon.

    Attributes:
        name: name on the bus.
        start: start position (x, y) [m].
        folder: folder of its configuration, recording, trail and logs.
    """

    name: str
    start: Point
    folder: Path

    @property
    def config(self) -> Path:
        """File of the daemon's configuration."""
        return self.folder / "config.yaml"

    @property
    def trail(self) -> Path:
        """File of the driven positions."""
        return self.folder / "trail.csv"

    def write_config(self, args: argparse.Namespace, endpoint: str) -> None:
        """Write the daemon's configuration; ``endpoint``: the router to join."""
        simulated = SimulationConfig()
        config: dict[str, object] = {
            "robot": {
                "name": self.name,
                "radius_m": args.robot_radius,
                "tool_width_m": args.cell,
                "speed_m_s": simulated.speed_m_s,
                "turn_deg_s": math.degrees(simulated.turn_rad_s),
                "turn_deg_s2": math.degrees(simulated.turn_acceleration_rad_s2),
                "acceleration_m_s2": simulated.acceleration_m_s2,
                "time_scale": args.speed,
            },
            "bus": {"mode": "client", "listen": [], "connect": [endpoint]},
            "planner": {"seed": args.seed},
        }
        if args.robots > 1:
            config["fleet"] = {"name": FLEET}
        if args.battery_min:
            x_m, y_m = self.start
            config["mission"] = {"dock": {"x_m": x_m, "y_m": y_m, "approach_m": 0.0}}
            config["battery"] = {}
        with writing(self.config) as new:
            new.write_text(yaml.safe_dump(config), encoding="utf-8")

    def programs(self, args: argparse.Namespace, endpoint: str) -> list[tuple[str, list[str]]]:
        """Return the name of each program to start, and its arguments for `fasaco-edge`."""
        daemon = ["run", "--config", str(self.config), "--record", str(self.folder)]
        # A fresh state folder has no progress of another daemon or demo.
        daemon += ["--state", str(self.folder / "state"), "--fresh"]
        robot = ["simulate", str(find_map(args.map)), "--driver", args.driver]
        robot += ["--connect", endpoint, "--robot", self.name, "--speed", str(args.speed)]
        robot += [f"--start-xy={self.start[0]!r},{self.start[1]!r}"]
        robot += ["--robot-radius", str(args.robot_radius), "--trail-out", str(self.trail)]
        robot += ["--battery-min", str(args.battery_min)]
        if args.robots > 1:
            robot.append("--meets-others")
        programs = [("daemon", daemon), ("robot", robot)]
        if args.driver == "follow":
            follower = ["follow", "--config", str(self.config), "--speed", str(args.speed)]
            programs.append(("follower", follower))
        return programs


def fleet_recorder(out: Path, endpoint: str) -> list[str]:
    """Return the arguments of `fasaco-edge` that record all robots in one file."""
    return ["record", "--fleet", FLEET, "--out", str(out), "--connect", endpoint]


def demo_robots(args: argparse.Namespace, out: Path) -> list[DemoRobot]:
    """Return the robots: one with the default name, or several that start far from each other.

    Raises:
        StartBlocked: there are fewer start positions than robots.
    """
    file = find_map(args.map)
    truth = read_map(file)
    first = start_point(file, truth, args.robot_radius)
    if args.robots == 1:
        return [DemoRobot(Keys().robot, first, out)]
    from fasaco_edge.cli.fleet_wing import apart

    lattice = CoverageLattice.from_map(truth, Footprint(args.cell, args.robot_radius))
    starts = [first, *apart(lattice, first, args.robots - 1)]
    names = [f"r{number}" for number in range(1, args.robots + 1)]
    return [DemoRobot(name, at, out / name) for name, at in zip(names, starts, strict=True)]
