"""A robot with a battery and a dock."""

from dataclasses import replace

from fasaco_edge.mission.config import BatteryPolicy, Dock
from fasaco_edge.mission.events import BatteryReceived, MapReceived, State
from tests.mission.world import CELL, CONFIG, Drive, building, pose_at, with_policy

ROOM = ("........",) * 6
WALLED = ("##########", *("#" + row + "#" for row in ROOM), "##########")
DOCK = Dock(x_m=0.5 * CELL, y_m=5.5 * CELL, approach_m=0.0)
AT_DOCK = (5, 0)
POLICY = BatteryPolicy()


class Battery(Drive):
    """A robot whose battery says once a tick how full it is."""

    def __init__(
        self, level, cell=(0, 0), order_state=None, battery=POLICY, rows=ROOM, drain=0, **policy
    ):
        at = (-1, -1) if "#" in rows[0] else (0, 0)
        config = replace(with_policy(CONFIG, **{"dock": DOCK} | policy), battery=battery)
        self.level, self.power = level, "discharging"
        events = MapReceived(building(*rows, at=at)), pose_at(*cell)
        super().__init__(cell, *events, config=config, order_state=order_state)
        # As if it had been seen to drain so much a second.
        self.mission.charging.gauge._drains.extend([drain] * 5 if drain else [])

    def tell(self, *events, after=1.0):
        heard = [] if self.level is None else [BatteryReceived(self.level, self.power)]
        return super().tell(*heard, *events, after=after)

    def charge(self, to):
        while self.mission.state is State.CHARGING and self.level < to:
            self.level, self.power = min(self.level + 0.02, 1.0), "charging"
            self.go()
