"""``fasaco-edge follow`` as a process of its own, on a real bus."""

import subprocess
import time
from contextlib import nullcontext
from pathlib import Path

import pytest
import yaml

from fasaco_edge.bus.session import open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.cli import _parser
from fasaco_edge.cli.follow import settings_of
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.follow.estimate import VelocityCommand
from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.host.processes import cpu_seconds, own_mb
from fasaco_edge.wire import schemas, topics
from fasaco_edge.wire.messages.base import decode_velocity
from fasaco_edge.wire.messages.poses import encode_pose_stamped
from tests.campaigns import stop_tries
from tests.campaigns.raw_messages import transform
from tests.follow.seeing import Disc, plain_map, scan_at
from tests.support.driven_base import DrivenBase, follower_process
from tests.support.processes import ENVIRONMENT, PROGRAM, free_endpoint
from tests.support.waiting import meanwhile, until

# Memory of its own at most, without pages of files [MB].
FOLLOW_MB = 17.0

AHEAD = ((0.0, 0.0), (3.0, 0.0), (3.0, 3.0))


@pytest.fixture
def base():
    base = DrivenBase()
    yield base
    base.close()


@pytest.mark.parametrize(
    ("scale", "words", "pace"),
    [(1, (), 1.0), (1, ("--speed", "2"), 2.0), (5, ("--speed", "5"), 5.0), (5, (), None)],
)
def test_only_an_option_gives_it_another_time(tmp_path, scale, words, pace):
    """A scale left over in a real robot's configuration did, too."""
    config = tmp_path / "robot.yaml"
    config.write_text(f"robot: {{time_scale: {scale}}}")
    given = ["follow", "--config", str(config), *words]
    args = _parser(given).parse_args(given)
    with nullcontext() if pace else pytest.raises(BadConfiguration, match="time_scale is 5"):
        assert settings_of(args).pace == pace


def test_it_drives_twenty_times_a_second_and_stays_small(base, tmp_path):
    base.plans()
    base.send_path(*AHEAD)
    log = tmp_path / "log"
    with follower_process(base.endpoint, log) as process:
        base.wait_until_it_moves()
        begun, count = time.monotonic(), len(base.heard)
        before, ticks = cpu_seconds(process.pid), 0
        # What this computer gives to a process that wants to run twenty times a second.
        while time.monotonic() - begun < 4.0:
            time.sleep(0.05)
            ticks += 1
        seconds = time.monotonic() - begun
        assert 0.7 * ticks / seconds < (len(base.heard) - count) / seconds < 23.0
        own = own_mb(process.pid)
        print(f"follow: {own:.1f} MB")
        assert own < FOLLOW_MB
        assert (cpu_seconds(process.pid) - before) / seconds < 0.05
        mapped = Path(f"/proc/{process.pid}/maps").read_text()
        assert not any(name in mapped for name in ("numpy", "numba", "msgspec"))
    assert process.returncode == 0
    assert base.heard[-1][1] == VelocityCommand()
    assert "driving" in log.read_text()


def test_it_stops_in_time_after_any_failure():
    """The campaign's short form: each cause once."""
    done = stop_tries.run_tries(len(stop_tries.CAUSES), seed=0, each=True)
    assert {name for name, _ in done} == {cause.__name__ for cause in stop_tries.CAUSES}
    # On a machine that is busy with much else, or slow, a turn of 50 ms may come late.
    assert [one for one in done if one[1] > 10 * stop_tries.LIMIT_S] == []


def test_it_waits_for_the_bus_and_logs_that(tmp_path):
    late = DrivenBase()
    endpoint = late.endpoint
    late.close()
    log = tmp_path / "log"
    with follower_process(endpoint, log) as process:
        until(lambda: f"waiting for the bus at {endpoint}" in log.read_text())
        bus = open_bus(BusSettings(mode="router", connect=(), listen=(endpoint,)))
        try:
            until(lambda: "no daemon" in log.read_text())
        finally:
            process.terminate()
            process.wait(30)
            bus.close()


def test_it_starts_without_standard_input_and_ends_quietly(tmp_path):
    log = tmp_path / "log"
    words = ["sh", "-c", 'exec "$@" <&-', "sh", *PROGRAM, "follow", "--connect", free_endpoint()]
    with (
        log.open("wb") as stderr,
        subprocess.Popen(words, stderr=stderr, env=ENVIRONMENT) as process,
    ):
        until(lambda: process.poll() is not None or "waiting for the bus" in log.read_text())
        process.terminate()
    assert process.returncode == 0
    assert len(log.read_text().splitlines()) == 1


def config_file(folder, **sections):
    config = folder / "config.yaml"
    config.write_text(yaml.safe_dump({name: held for name, held in sections.items() if held}))
    return config


def test_limits_names_and_topics_come_from_the_configuration(base, tmp_path):
    """Under ROS 2 by rmw_zenoh: its key, its attachment, its tokens."""
    config = config_file(
        tmp_path,
        robot={"name": "robot", "speed_m_s": 0.11, "turn_deg_s": 90.0},
        bus={"listen": [], "connect": [base.endpoint], "mode": "client"},
        ros2={"kind": "rmw_zenoh", "domain": 7, "pose": schemas.POSE_STAMPED},
    )
    heard = []
    base.bus.subscribe("7/cmd_vel/**", heard.append)
    poses = base.bus.publisher("7/pose/geometry_msgs::msg::dds_::PoseStamped_/RIHS01_0", "")
    words = [*PROGRAM, "follow", "--config", str(config), "--stamped"]
    base.plans()
    base.send_path(*AHEAD)
    with subprocess.Popen(words, env=ENVIRONMENT) as process:
        try:
            sent = encode_pose_stamped(StampedPose(Pose2D(0.0, 0.0)))
            until(lambda: poses.put(sent) or any(velocity(one).speed_m_s > 0.1 for one in heard))
            tokens = base.bus.alive("@ros2_lv/7/**")
        finally:
            process.terminate()
    assert max(velocity(one).speed_m_s for one in heard) == pytest.approx(0.11)
    assert velocity(heard[0]).frame == "base_link"
    assert "geometry_msgs::msg::dds_::TwistStamped_" in heard[0].key
    assert len(heard[0].attachment) == 33
    assert {"NN", "MP"} <= {part for token in tokens for part in token.split("/")}
    assert base.heard == []


@pytest.mark.parametrize(
    ("silent", "most_s", "said"),
    [("odom", 2.5, "transform of 'odom' in 'map'"), ("base_link", 1.0, "pose too old")],
)
def test_a_robot_whose_localiser_or_odometry_is_silent_stands(base, tmp_path, silent, most_s, said):
    """Poses from transforms: the other one goes on, and what it says changes."""
    ros2 = {"kind": "rmw_zenoh", "domain": 7, "pose": "tf"}
    config = config_file(tmp_path, robot={"name": "robot", "speed_m_s": 0.05}, ros2=ros2)
    log = tmp_path / "log"
    tf = base.bus.publisher("7/tf/tf2_msgs::msg::dds_::TFMessage_/RIHS01_0", "")
    heard = []
    base.bus.subscribe("7/cmd_vel/**", heard.append)
    links = {"odom": "map", "base_link": "odom"}

    def drives(and_says):
        count = len(heard)
        for child in and_says:
            shift = 0.001 * (count % 2)
            event = {"frame": links[child], "child": child, "stamp": time.time_ns()}
            tf.put(transform(event | {"x": shift, "y": 0.0, "yaw": 0.0}))
        time.sleep(0.05)
        speeds = [decode_velocity(one.payload, schemas.TWIST).speed_m_s for one in heard[count:]]
        return any(speed > 0.0 for speed in speeds)

    base.plans()
    base.send_path(*AHEAD)
    with follower_process(base.endpoint, log, "--config", str(config)):
        until(lambda: drives(links))
        begun = time.monotonic()
        until(lambda: not drives(links.keys() - {silent}) and said in log.read_text(), 10.0)
        assert time.monotonic() - begun < most_s + 0.5
        until(lambda: drives(links))


def velocity(sample):
    return decode_velocity(sample.payload, schemas.TWIST_STAMPED)


def test_it_takes_scans_and_compares_them_with_the_map(base, tmp_path):
    """Somebody stands in the way, and goes; the process stays small, and stops without scans."""
    config = config_file(tmp_path, scan={"lost_s": 1.0})
    maps, scans = (base.bus.advertise(base.keys, topic) for topic in (topics.MAP, topics.SCAN))
    person = [Disc(1.0, 0.0)]
    base.plans()
    base.send_path(*AHEAD)
    log = tmp_path / "log"
    with follower_process(base.endpoint, log, "--config", str(config)) as process:
        until(lambda: "no scan: no map to compare scans with" in log.read_text())
        maps.put(plain_map())
        with meanwhile(lambda: scans.put(scan_at(base.pose, person)), 0.1):
            until(lambda: "obstacle ahead" in log.read_text())
            assert 0.3 < base.pose.x < 0.7
            mapped = Path(f"/proc/{process.pid}/maps").read_text()
            assert not any(name in mapped for name in ("numpy", "numba", "msgspec"))
            person.clear()
            until(lambda: base.pose.x > 1.0)
        until(lambda: "no scan: for 1." in log.read_text())
        until(lambda: base.newest() in (None, VelocityCommand()))
