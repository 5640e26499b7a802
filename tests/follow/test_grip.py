"""A base that pushes is told from one that moves, however its poses scatter, drift and come."""

import math
import random

import pytest

from fasaco_edge.follow.estimate import BaseLimits, PoseEstimate, VelocityCommand, moved
from fasaco_edge.follow.grip import Grip
from fasaco_edge.grid.geometry import Pose2D

TICK_S = 0.05
# It executes commands at once.
LIMITS = BaseLimits(1.0, 1e3, 2.0, 1e3, 0.02)
AHEAD, SLOWLY, TURNING = VelocityCommand(0.3), VelocityCommand(0.05), VelocityCommand(0.0, 0.8)


class Base:
    def __init__(self, command, share, noise_m=0.0, hz=20.0, drift_m_s=0.0, seed=0):
        self.grip, self.pushed_s, self.losses = Grip(), 0.0, 0
        self._estimate = PoseEstimate(LIMITS)
        self._command, self._share, self._drift_m_s = command, share, drift_m_s
        self._noise, self._hz, self._rng = noise_m, hz, random.Random(seed)
        self.pose, self._tick, self._is_lost = Pose2D(0.0, 0.0), 0, False

    def told(self):
        dx, dy, turn = (self._rng.gauss(0.0, self._noise) for _ in range(3))
        turn *= math.radians(2.0) / 0.04
        pose = self.pose
        return Pose2D(pose.x + dx, pose.y + dy, math.remainder(pose.yaw + turn, math.tau))

    def run(self, seconds):
        for _ in range(round(seconds / TICK_S)):
            now = self._tick * TICK_S
            if self._tick % round(1.0 / self._hz / TICK_S) == 0:
                self._estimate.take(self.told(), now)
            is_lost = self.grip.is_lost(self._estimate, 0.0, now)
            self.losses += is_lost and not self._is_lost
            self._is_lost = is_lost
            command = VelocityCommand() if is_lost else self._command
            self._estimate.sent(command, now)
            self.grip.sent(command, TICK_S)
            self.pushed_s += 0.0 if is_lost else TICK_S
            self.pose = moved(self.pose, command, self._share * TICK_S)
            x = self.pose.x + self._drift_m_s * TICK_S
            self.pose = Pose2D(x, self.pose.y, self.pose.yaw)
            self._tick += 1
        return self


@pytest.mark.parametrize("hz", [2.0, 20.0])
@pytest.mark.parametrize("noise_m", [0.0, 0.02, 0.08])
@pytest.mark.parametrize("drift_m_s", [0.0, 0.01])
def test_scatter_and_drift_of_poses_do_not_count_as_progress(noise_m, hz, drift_m_s):
    bases = [Base(AHEAD, 0.0, noise_m, hz, drift_m_s, seed).run(120.0) for seed in range(4)]
    mean_s = sum(base.pushed_s for base in bases) / len(bases)
    # Two looks in a try at worst, and at times one that looks like progress.
    assert mean_s < (6.1 if noise_m == 0.0 or (noise_m < 0.04 and hz > 2.0) else 15.0)


@pytest.mark.parametrize("command", [AHEAD, SLOWLY, TURNING])
@pytest.mark.parametrize(
    ("noise_m", "hz"), [(0.0, 1.0), (0.01, 1.0), (0.02, 5.0), (0.04, 5.0), (0.04, 20.0)]
)
def test_a_base_that_moves_is_not_held_up(command, noise_m, hz):
    assert [Base(command, 1.0, noise_m, hz, seed=s).run(120.0).losses for s in range(4)] == [0] * 4


def test_odometry_that_runs_on_while_wheels_slip_is_no_progress():
    assert Base(AHEAD, 0.13).run(120.0).pushed_s == pytest.approx(6.0, abs=0.2)


@pytest.mark.parametrize(
    ("noise_m", "hz", "far_m"), [(0.0, 20.0, 0.15), (0.04, 20.0, 0.4), (0.08, 2.0, 1.0)]
)
def test_a_robot_that_is_moved_by_hand_drives_on(noise_m, hz, far_m):
    base = Base(AHEAD, 0.0, noise_m, hz, seed=3).run(60.0)
    assert base.grip.is_lost(base._estimate, 0.0, 60.0)
    pushed_s = base.pushed_s
    for _ in range(20):
        base.pose = Pose2D(base.pose.x, base.pose.y + far_m / 20)
        base.run(0.1)
    base._share = 1.0
    base.run(30.0)
    assert base.pushed_s > pushed_s + 20.0


def test_it_says_that_its_poses_scatter():
    base = Base(AHEAD, 0.0)
    details = [base.run(0.5).grip.detail for _ in range(120)]
    assert list(dict.fromkeys(details))[-3:] == ["tried 1 time", "tried 2 times", "tried 3 times"]
    detail = Base(AHEAD, 0.0, 0.08).run(60.0).grip.detail
    assert detail.startswith("tried 3 times; poses scatter: goes on once moved by 0.")
