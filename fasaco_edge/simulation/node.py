"""Simulated robot on the bus: map and pose out, paths or velocities in."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Literal, NamedTuple

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.mailbox import LatestSlot
from fasaco_edge.bus.session import Bus, join, open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.errors import MalformedMessage, WrongFrame
from fasaco_edge.host.processes import stop_event
from fasaco_edge.simulation.world import Emission, World
from fasaco_edge.wire import topics
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.messages.base import decode_velocity
from fasaco_edge.wire.messages.battery import BatteryState, Power, encode_battery
from fasaco_edge.wire.messages.maps import encode_occupancy_grid
from fasaco_edge.wire.messages.paths import decode_path
from fasaco_edge.wire.messages.poses import decode_pose, encode_pose_stamped

log = logging.getLogger(__name__)

Driver = Literal["ideal", "follow"]

# Longest time that the loop runs ticks before it looks for a new path [s].
CYCLE_S = 0.02
# Shortest wait, to bound the wake-ups of a fast simulation [s].
WAIT_S = 0.004
# Largest delay of a simulation that cannot keep up [s].
DEBT_S = 0.1
# A robot without a new pose for this real time is no longer an obstacle [s].
CARRIED_AWAY_S = 10.0
REPORT_EVERY_S = 0.5
# A simulation faster than real time waits for the next velocity once the last one is this old
# [simulated s], for up to this real time [s].
ANSWER_S, PATIENCE_S = 0.1, 0.5


class Pace:
    """Schedules ticks, so that ``speed`` simulated seconds pass in a second.

    A computer that cannot keep up falls behind by ``DEBT_S`` at most: the simulation slows down
    instead of catching up later.

    Args:
        speed: simulated seconds per second, above 0.
        tick_s: simulated length of a tick [s].
        now_s: reading of a monotonic clock [s]; the first tick is due then.
    """

    def __init__(self, speed: float, tick_s: float, now_s: float) -> None:
        self._interval_s, self._due_s = tick_s / speed, now_s

    def behind_s(self, now_s: float) -> float:
        """Return how long the next tick has been due [s]; negative before it is due."""
        return now_s - self._due_s

    def note_tick(self, now_s: float) -> None:
        """Note that a tick was run."""
        self._due_s = max(self._due_s + self._interval_s, now_s - DEBT_S)


class Progress(NamedTuple):
    """Progress of a simulation, besides the state of its world.

    Attributes:
        refused: number of paths or velocities that were malformed, or in another frame.
        speed: simulated seconds per second, since the last report.
    """

    refused: int
    speed: float


def run_simulation(
    world: World,
    keys: Keys,
    settings: BusSettings,
    *,
    speed: float = 1.0,
    driver: Driver = "ideal",
    meets_others: bool = False,
    waits: bool = False,
    should_stop: Callable[[], bool] = lambda: False,
    report: Callable[[Progress], None] = lambda _progress: None,
) -> Progress | None:
    """Run the robot of ``world`` on the bus until it has to stop.

    It publishes its map (latched) and its pose with simulated time as the stamp, and drives along
    the newest path, or by velocities. In the main thread, SIGINT and SIGTERM end it, too. At the
    end it publishes its last map and pose, and returns its last progress; None if it was stopped
    before it had joined the bus.

    Args:
        world: the building and the robot.
        keys: keys of the robot.
        settings: settings of the session.
        speed: simulated seconds per second, above 0; a computer that cannot keep up runs slower.
        driver: "ideal": it follows paths itself; "follow": velocities drive it.
        meets_others: whether other robots on the bus are obstacles.
        waits: whether the robot waits until a process listens at the endpoint.
        should_stop: called some fifty times a second.
        report: called about twice a second, and at the end.

    Raises:
        BusUnavailable: the bus cannot be joined, and ``waits`` is False.
    """
    with ExitStack() as stack:
        stop = stack.enter_context(stop_event())
        joined = join(settings, stop) if waits else open_bus(settings)
        if joined is None:
            return None
        bus = stack.enter_context(joined)
        robot = SimulatedRobot(world, keys, bus, driver)
        if meets_others:
            bus.subscribe(keys.of_all(topics.POSE), robot.meet)
        robot.drive(speed, lambda: stop.is_set() or should_stop(), report)
        robot.publish(world.emission())
        report(last := robot.progress(time.monotonic()))
    return last


class SimulatedRobot:
    """The robot of a world on a bus: publishes its messages, and follows the newest path, or the
    newest velocity."""

    def __init__(self, world: World, keys: Keys, bus: Bus, driver: Driver = "ideal") -> None:
        self._world = world
        self._reported = time.monotonic(), world.stamp_ns * 1e-9
        self._refused = 0
        self._map = bus.advertise(keys, topics.MAP)
        self._pose = bus.advertise(keys, topics.POSE)
        self._battery = bus.advertise(keys, topics.BATTERY)
        self._keys = keys
        self._met_at: dict[str, float] = {}
        self._newest: LatestSlot[Sample] = LatestSlot()
        self._is_driven = driver == "follow"
        self._took_at = time.monotonic()
        self._take = self._follow if driver == "ideal" else self._move
        bus.listen(keys, topics.PATH if driver == "ideal" else topics.CMD_VEL, self._newest.put)

    def drive(
        self,
        speed: float,
        should_stop: Callable[[], bool],
        report: Callable[[Progress], None] = lambda _progress: None,
    ) -> None:
        """Let time pass until the robot has to stop; arguments as in ``run_simulation``."""
        world = self._world
        pace = Pace(speed, world.config.tick_s, time.monotonic())
        patience_s = PATIENCE_S if self._is_driven and speed > 1.0 else 0.0
        while not should_stop():
            now_s = time.monotonic()
            behind_s = pace.behind_s(now_s)
            waits_s = CYCLE_S if self._waits(now_s, patience_s) else -behind_s
            self._take_newest(0.0 if waits_s <= 0.0 else min(max(waits_s, WAIT_S), CYCLE_S))
            cycle_ends_s = time.monotonic() + CYCLE_S
            while pace.behind_s(now_s := time.monotonic()) >= 0.0 and now_s < cycle_ends_s:
                if self._waits(now_s, patience_s):
                    break
                self.publish(world.tick())
                pace.note_tick(now_s)
            if now_s - self._reported[0] >= REPORT_EVERY_S:
                self._drop_silent(now_s)
                report(self.progress(now_s))

    def publish(self, emission: Emission) -> None:
        """Publish map, pose and battery, if present."""
        # The map comes first, so that it shows the place of the pose.
        if emission.map is not None:
            self._map.put(encode_occupancy_grid(emission.map))
        if emission.pose is not None:
            self._pose.put(encode_pose_stamped(emission.pose))
        if emission.battery is not None:
            power: Power = "charging" if emission.battery.is_charging else "discharging"
            state = BatteryState(emission.battery.level, power, "", self._world.stamp_ns)
            self._battery.put(encode_battery(state))

    def meet(self, sample: Sample) -> None:
        """Take in another robot's pose; on a Zenoh thread."""
        name = self._keys.robot_of(sample.key)
        if name in ("", self._keys.robot):
            return
        try:
            pose = decode_pose(sample.payload, sample.schema).pose
        except MalformedMessage:
            return
        self._met_at[name] = time.monotonic()
        self._world.others = {**self._world.others, name: (pose.x, pose.y)}

    def _drop_silent(self, now_s: float) -> None:
        """Drop other robots without new poses: they are no longer obstacles."""
        places, met_at = self._world.others, self._met_at
        here = {name: at for name, at in places.items() if now_s - met_at[name] < CARRIED_AWAY_S}
        if len(here) < len(places):
            self._world.others = here

    def _waits(self, now_s: float, patience_s: float) -> bool:
        """Return whether simulated time is stopped until a velocity arrives."""
        is_late = self._world.unanswered_s >= ANSWER_S - 1e-9
        return is_late and now_s - self._took_at < patience_s

    def _take_newest(self, timeout_s: float) -> None:
        """Wait for a path or a velocity; a malformed one is counted and dropped."""
        sample = self._newest.take(timeout_s)
        if sample is None:
            return
        self._took_at = time.monotonic()
        try:
            self._take(sample)
        except (MalformedMessage, WrongFrame) as error:
            self._refused += 1
            log.warning("refused: %s", error)

    def _follow(self, sample: Sample) -> None:
        path = decode_path(sample.payload)
        if path.frame != self._world.frame:
            raise WrongFrame(
                f"path in frame {path.frame!r}, map in {self._world.frame!r}",
                hint="let the daemon plan on the map of this robot",
            )
        self._world.follow(path.xy)

    def _move(self, sample: Sample) -> None:
        velocity = decode_velocity(sample.payload, sample.schema)
        self._world.move(velocity.speed_m_s, velocity.turn_rad_s)

    def progress(self, now_s: float) -> Progress:
        """Return the progress, with the speed achieved since the last call."""
        (before_s, before_sim_s), sim_s = self._reported, self._world.stamp_ns * 1e-9
        self._reported = now_s, sim_s
        return Progress(self._refused, (sim_s - before_sim_s) / max(now_s - before_s, 1e-9))
