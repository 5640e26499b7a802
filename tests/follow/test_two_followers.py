"""Of several followers of one robot one drives; the others send nothing and say why."""

import contextlib
import signal
import subprocess
import time

import pytest

from fasaco_edge.bus import access
from fasaco_edge.follow.daemons import NO_RIGHT
from fasaco_edge.follow.estimate import VelocityCommand
from fasaco_edge.wire import topics
from tests.campaigns.fault_links import Link
from tests.follow.test_process import AHEAD, config_file
from tests.support.driven_base import DrivenBase, follower_process
from tests.support.waiting import until

# As in a long hall, so that the robot drives through each test.
FAR = ((0.0, 0.0), (30.0, 0.0))
RMW = {"kind": "rmw_zenoh", "domain": 7, "pose": "geometry_msgs/msg/PoseStamped"}
SECOND = "standing, another follower drives: Zenoh id"


@pytest.fixture
def base():
    base = DrivenBase()
    base.plans()
    base.send_path(*FAR)
    yield base
    base.close()


def standing(base):
    return sorted(key.rpartition("/")[2] for key in base.bus.alive(base.keys.of(topics.DRIVER)))


def commands_a_second(base, seconds=1.5):
    count = len(base.heard)
    time.sleep(seconds)
    return (len(base.heard) - count) / seconds


@pytest.mark.parametrize(("ends", "ros2"), [(signal.SIGTERM, {}), (signal.SIGKILL, RMW)])
def test_the_second_waits_in_silence_and_takes_over(base, tmp_path, ends, ros2):
    if ros2:
        base.take_ros(7)
    bus = {"listen": [], "connect": [base.endpoint], "mode": "client"}
    config = config_file(tmp_path, bus=bus, ros2=ros2)
    first_log, second_log = tmp_path / "first", tmp_path / "second"
    with follower_process(base.endpoint, first_log, "--config", str(config)) as first:
        base.wait_until_it_moves()
        with follower_process(base.endpoint, second_log, "--config", str(config)):
            until(lambda: SECOND in second_log.read_text())
            assert standing(base) == ["drives", "waits"]
            assert commands_a_second(base) < 23.0
            assert all(command.speed > 0.0 for _, command in base.heard[-10:])
            first.send_signal(ends)
            first.wait(30)
            until(lambda: standing(base) == ["drives"])
            until(lambda: "this one drives" in second_log.read_text())
            base.wait_until_it_moves()
    assert base.heard[-1][1] == VelocityCommand()
    assert "Traceback" not in first_log.read_text() + second_log.read_text()


def test_the_end_of_a_waiting_follower_changes_nothing(base, tmp_path):
    first_log, second_log = tmp_path / "first", tmp_path / "second"
    with follower_process(base.endpoint, first_log):
        base.wait_until_it_moves()
        with follower_process(base.endpoint, second_log):
            until(lambda: SECOND in second_log.read_text())
            count = len(base.heard)
        time.sleep(1.0)
        assert all(command.speed > 0.0 for _, command in base.heard[count:])


def test_one_of_three_followers_started_together_drives(base, tmp_path):
    logs = [tmp_path / name for name in "abc"]
    with contextlib.ExitStack() as stack:
        for log in logs:
            stack.enter_context(follower_process(base.endpoint, log))
        base.wait_until_it_moves()
        until(lambda: standing(base) == ["drives", "waits", "waits"])
        assert commands_a_second(base) < 23.0
    assert sum("INFO fasaco_edge.follow.node: driving" in log.read_text() for log in logs) >= 1


def test_a_follower_frozen_for_long_yields_to_its_successor(base, tmp_path):
    """Its token has expired meanwhile, and it does not know."""
    logs = tmp_path / "first", tmp_path / "second"
    with follower_process(base.endpoint, logs[0]) as first:
        base.wait_until_it_moves()
        with follower_process(base.endpoint, logs[1]):
            until(lambda: SECOND in logs[1].read_text())
            first.send_signal(signal.SIGSTOP)
            until(lambda: "this one drives" in logs[1].read_text())
            base.wait_until_it_moves()
            first.send_signal(signal.SIGCONT)
            assert commands_a_second(base, 6.0) < 23.0
            until(lambda: standing(base) == ["drives", "yields"])


@pytest.mark.parametrize("first_is_cut", [True, False])
def test_two_followers_never_drive_together_after_a_partition(base, tmp_path, first_is_cut):
    """Both believe that they drive; the id decides which of them continues."""
    logs, links = (tmp_path / "first", tmp_path / "second"), [Link(base.endpoint) for _ in "ab"]
    try:
        with follower_process(links[0].endpoint, logs[0]):
            base.wait_until_it_moves()
            with follower_process(links[1].endpoint, logs[1]):
                until(lambda: SECOND in logs[1].read_text())
                links[0].cut()
                until(lambda: "this one drives" in logs[1].read_text())
                base.wait_until_it_moves()
                links[0].mend()
                if not first_is_cut:
                    # The other one, too, has to find its way back.
                    links[1].cut()
                    time.sleep(12.0)
                    links[1].mend()
                ends = time.monotonic() + 30.0
                while standing(base) != ["drives", "yields"]:
                    assert time.monotonic() < ends
                    assert commands_a_second(base, 1.0) < 23.0
                base.wait_until_it_moves()
    finally:
        for link in links:
            link.close()


@pytest.mark.parametrize("is_granted", [True, False], ids=["the right", "no right"])
def test_a_follower_drives_only_if_others_may_see_its_token(tmp_path, is_granted):
    grant = access.Grant("driver", ["x"], "fasaco/@v1/robot")
    rules = access.access_control([grant], "usernames")
    # To whoever connects.
    rules["subjects"] = [{"id": "driver"}]
    rules["policies"][0]["subjects"] = ["driver"]
    if not is_granted:
        # As templates of older releases have it.
        for rule in rules["rules"]:
            rule["key_exprs"] = [key for key in rule["key_exprs"] if "/driver/" not in key]
    base = DrivenBase({"access_control": rules})
    log = tmp_path / "log"
    try:
        base.plans()
        base.send_path(*AHEAD)
        with follower_process(base.endpoint, log):
            if is_granted:
                base.wait_until_it_moves()
            else:
                until(lambda: f"standing, no right to drive: {NO_RIGHT}" in log.read_text())
                time.sleep(1.0)
                assert base.heard == []
    finally:
        base.close()


def test_a_dry_run_claims_nothing(base, tmp_path):
    with follower_process(
        base.endpoint, tmp_path / "dry", "--dry-run", out=subprocess.PIPE
    ) as process:
        assert b"m/s" in process.stdout.readline()
        assert standing(base) == []
        assert base.heard == []
        with follower_process(base.endpoint, tmp_path / "log"):
            base.wait_until_it_moves()
            assert b"driving" in b"".join(process.stdout.readline() for _ in range(3))
        process.stdout.close()
