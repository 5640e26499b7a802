"""What the doctor finds on computers and on a bus, with and without a daemon."""

from __future__ import annotations

import os
import socket
import sys
import time
from pathlib import Path

import pytest

from fasaco_edge.bus.session import open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.config.config import DaemonConfig, MetricsConfig, MissionPolicyConfig
from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.config.security import BusConfig
from fasaco_edge.doctor import computer, report, security, session
from fasaco_edge.doctor.finding import Check, CheckContext, Finding, Level, Unit, find_unit
from fasaco_edge.kernels import manifest
from fasaco_edge.kernels.folder import wanted_folder
from fasaco_edge.planners.stages import STAGES
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.topics import QOS
from tests.kernels.harm import HARMS
from tests.kernels.installations import fill_with
from tests.support.outsider import Outsider, joined_daemon
from tests.support.processes import daemon_process, free_endpoint
from tests.support.rooms import map_bytes, pillared_room, pose_bytes
from tests.support.waiting import meanwhile

MEMINFO = "MemTotal:        3884328 kB\nMemFree: 100000 kB\nMemAvailable:    {} kB\n"
V1_OFF = "#subsys_name\thierarchy\tnum_cgroups\tenabled\nmemory\t0\t70\t0\n"


def with_files(root: Path, **files: str) -> CheckContext:
    """Return a computer whose root folder holds these files, / written as __ in their names."""
    for name, text in files.items():
        file = root / name.replace("__", "/")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return CheckContext(DaemonConfig(), root=root)


def at(
    *listen: str, connect: tuple[str, ...] = (), mode: str = "peer", name="robot"
) -> CheckContext:
    bus = BusConfig(listen=listen, connect=connect, mode=mode)
    return CheckContext(DaemonConfig(bus=bus, robot=RobotConfig(name=name)))


@pytest.mark.parametrize(
    ("metrics", "where"),
    [
        (MetricsConfig("[::1]:9465", open_to_everyone=True), "this computer"),
        (MetricsConfig("10.0.0.7:9465", open_to_everyone=True), "other computers"),
    ],
)
def test_readers_of_the_metrics_are_listed(metrics, where):
    details = security.endpoints(CheckContext(DaemonConfig(metrics=metrics))).details
    assert details[-1] == (
        f"http://{metrics.listen}/metrics: figures, from {where}, without password"
    )


def test_a_pi_without_a_memory_controller_gets_instructions(tmp_path):
    files = {
        "sys__fs__cgroup__cgroup.controllers": "cpuset cpu io pids\n",
        "proc__meminfo": MEMINFO.format(3_000_000),
        "proc__cgroups": V1_OFF,
        "boot__firmware__cmdline.txt": "console=tty1 root=PARTUUID=1 rootwait\n",
    }
    pi = with_files(tmp_path, **files)
    found = computer.memory(pi)
    assert found.level is Level.WARN
    assert found.found.startswith("3072 MB of 3978 MB free; the memory controller is off")
    assert found.to_do == (
        "add cgroup_enable=memory to the one line of /boot/firmware/cmdline.txt, and reboot"
    )
    limited = CheckContext(pi.config, unit=Unit({"MemoryMax": "536870912"}), root=tmp_path)
    assert "limits of the unit are not enforced" in computer.memory(limited).found


@pytest.mark.parametrize(
    ("files", "version"),
    [
        ({"sys__fs__cgroup__cgroup.controllers": "cpuset cpu memory pids\n"}, 2),
        (
            {
                "sys__fs__cgroup__memory__memory.limit_in_bytes": "1",
                "proc__cgroups": V1_OFF.replace("\t0\n", "\t1\n"),
            },
            1,
        ),
        ({"sys__fs__cgroup__memory__tasks": "", "proc__cgroups": V1_OFF}, None),
        ({}, None),
    ],
)
def test_both_versions_of_control_groups_are_known(tmp_path, files, version):
    with_files(tmp_path, **files)
    assert computer.controller(tmp_path) == version


@pytest.mark.parametrize(
    ("free_kb", "limit", "level"),
    [(3_000_000, "infinity", "ok"), (100_000, "infinity", "warn"), (3_000_000, "1000000", "warn")],
)
def test_memory_is_short_or_limited(tmp_path, free_kb, limit, level):
    files = {
        "sys__fs__cgroup__cgroup.controllers": "memory",
        "proc__meminfo": MEMINFO.format(free_kb),
    }
    pc = with_files(tmp_path, **files)
    found = computer.memory(CheckContext(pc.config, unit=Unit({"MemoryMax": limit}), root=tmp_path))
    assert found.level == level
    assert bool(found.to_do) == (level == "warn")


def test_a_board_is_called_by_its_name(tmp_path):
    files = {
        "proc__device-tree__model": "Raspberry Pi 4 Model B Rev 1.4\0",
        "etc__os-release": 'PRETTY_NAME="Debian GNU/Linux 12 (bookworm)"\nID=debian\n',
    }
    found = computer.system(with_files(tmp_path, **files))
    assert found.found.startswith("Raspberry Pi 4 Model B Rev 1.4, ")
    assert found.details[0].startswith("Debian GNU/Linux 12 (bookworm), kernel ")


def test_this_computer_has_a_clock():
    is_synchronised, error_s = computer.kernel_clock()
    assert isinstance(is_synchronised, bool)
    assert error_s >= 0.0


def test_a_reset_clock_fails_the_check(monkeypatch):
    monkeypatch.setattr(time, "time", lambda: 4.0)
    found = computer.clock(CheckContext(DaemonConfig()))
    assert found.level is Level.FAIL
    assert "the clock was reset" in found.found


def test_units_are_asked_only_where_systemd_is_at_work(tmp_path):
    assert find_unit(tmp_path) is None
    told = {
        "MainPID": "0",
        "Environment": 'A=1 "B=two words" NUMBA_CACHE_DIR=/var/cache/fasaco-edge/numba',
        "StateDirectory": "fasaco-edge",
        "MemoryMax": "infinity",
    }
    unit = Unit(told)
    assert unit.pid is None
    assert unit.environ["NUMBA_CACHE_DIR"] == "/var/cache/fasaco-edge/numba"
    assert unit.environ["B"] == "two words"
    assert unit.environ["STATE_DIRECTORY"] == "/var/lib/fasaco-edge"
    assert (unit.limit("MemoryMax"), unit.limit("MemoryHigh")) == (None, None)


def test_folders_and_who_may_write_there(tmp_path):
    state = tmp_path / "state"
    state.mkdir(mode=0o700)
    file = tmp_path / "config.yaml"
    file.touch(mode=0o644)
    config = DaemonConfig(
        mission=MissionPolicyConfig(state_dir=str(state)),
        bus=BusConfig(connect=("tcp/127.0.0.1:1#key=secret",)),
    )
    context = CheckContext(config, file, recordings=tmp_path / "later" / "recordings")
    disk = computer.disk(context)
    assert disk.level is Level.OK
    assert [line.partition(":")[0] for line in disk.details] == [
        "state",
        "kernel cache",
        "recordings",
    ]
    assert computer.permissions(context).level is Level.WARN
    assert "secret" not in computer.permissions(context).found
    file.chmod(0o640)
    assert computer.permissions(context).level is Level.OK
    state.chmod(0o777)
    assert computer.permissions(context).to_do == f"chmod o-w {state}"
    file.chmod(0o666)
    both = computer.permissions(context)
    assert both.level is Level.FAIL
    assert len(both.details) == 2
    # Nothing was made.
    assert sorted(path.name for path in tmp_path.iterdir()) == ["config.yaml", "state"]


def test_a_read_only_disk_fails_the_check(tmp_path):
    config = DaemonConfig(mission=MissionPolicyConfig(state_dir="/proc/x"))
    read_only = next(
        (
            line.split()[4]
            for line in Path("/proc/self/mountinfo").read_text().splitlines()
            if line.split()[5].startswith("ro,")
        ),
        None,
    )
    assert computer.disk(CheckContext(config)).level is not Level.OK
    if read_only is None:
        pytest.skip("nothing is mounted read-only here")
    config = DaemonConfig(mission=MissionPolicyConfig(state_dir=f"{read_only}/x"))
    assert "read-only" in computer.disk(CheckContext(config)).found


def test_a_file_in_place_of_the_state_folder_fails_the_check(tmp_path):
    (tmp_path / "file").write_text("not a folder")
    config = DaemonConfig(mission=MissionPolicyConfig(state_dir=str(tmp_path / "file" / "in")))
    found = computer.disk(CheckContext(config))
    assert found.level is Level.FAIL
    assert f"{tmp_path / 'file'} is not a folder" in found.found


def test_a_link_in_place_of_the_lock_fails_the_check(tmp_path):
    config = DaemonConfig(mission=MissionPolicyConfig(state_dir=str(tmp_path)))
    assert computer.disk(CheckContext(config)).level is Level.OK
    lock = tmp_path / "robot.ledger.lock"
    lock.symlink_to("nowhere")
    found = computer.disk(CheckContext(config))
    assert found.level is Level.FAIL
    assert found.found == f"no progress is written: a link lies in place of {lock}"
    assert found.to_do == f"remove {lock}"


def test_missing_or_foreign_kernels_are_reported(tmp_path, monkeypatch):
    told = {"Environment": f"NUMBA_CACHE_DIR={tmp_path}", "DynamicUser": "yes"}
    context = CheckContext(DaemonConfig(), unit=Unit(told | {"CacheDirectory": "fasaco-edge"}))
    found = computer.kernels(context)
    assert found.level is Level.WARN
    assert found.found.startswith("not compiled for this version")
    # As root it would make a folder that the daemon does not trust.
    assert found.to_do == (
        "systemd-run --wait -p DynamicUser=yes -p User=fasaco-edge -p CacheDirectory=fasaco-edge "
        f"-E NUMBA_CACHE_DIR={tmp_path} {Path(sys.executable).with_name('fasaco-edge')} warmup"
    )
    assert list(tmp_path.iterdir()) == []
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    folder = wanted_folder()
    folder.mkdir(0o700)
    assert "never compiled" in computer.kernels(context).found
    folder.chmod(0o770)
    found = computer.kernels(CheckContext(DaemonConfig()))
    assert found.level is Level.WARN
    assert found.found.startswith(f"{folder} may be written by its group: the daemon takes no")
    folder.chmod(0o700)
    if os.geteuid() != 0:
        return
    os.chown(folder, 4242, 4242)
    found = computer.kernels(CheckContext(DaemonConfig()))
    assert found.found.startswith(f"{folder} belongs to user 4242: the daemon takes no")


def test_kernels_that_are_damaged(tmp_path, monkeypatch):
    folder = fill_with(tmp_path, 3, stages=STAGES)
    file = folder / "1.nbc"
    before = file.read_bytes()
    monkeypatch.setattr(computer, "wanted_folder", lambda environ: folder)
    for harm in HARMS.values():
        monkeypatch.setattr(manifest, "_COMPARED", {})
        harm(file)
        found = computer.kernels(CheckContext(DaemonConfig()))
        assert found.level is Level.WARN
        assert found.found.startswith(f"{file.name} ")
        assert found.to_do == "fasaco-edge warmup"
        file.write_bytes(before)
    assert computer.kernels(CheckContext(DaemonConfig())).level is Level.OK


def test_an_empty_bus_is_reported():
    endpoint = free_endpoint()
    alone = at(endpoint)
    assert session.session(alone).details == (f"{endpoint}: free",)
    assert session.peers(alone).found.startswith("neither a daemon nor a router answers")
    away = session.session(at(endpoint, connect=("tcp/127.0.0.1:1",)))
    assert away.level is Level.WARN
    assert "the daemon waits for it" in away.found
    client = session.session(at(connect=("tcp/127.0.0.1:1",), mode="client"))
    assert client.level is Level.WARN
    assert "the daemon waits for it" in client.found


def test_an_address_that_is_not_this_computers():
    found = session.session(at("tcp/192.0.2.1:7447"))
    assert found.level is Level.FAIL
    assert "Cannot assign requested address" in found.found


def test_maps_under_other_names_are_named(tmp_path):
    """With the wrong robot, namespace or domain nothing is heard, though the map is there."""
    token = "@ros2_lv/7/abc/0/3/MP/%/%robot1/slam/%robot1%map/{}/RIHS01_0/::,:,:,:,,"
    with (
        daemon_process(tmp_path) as daemon,
        Outsider(daemon.endpoint),
        open_bus(BusSettings("client", (daemon.endpoint,))) as bus,
    ):
        bus.advertise(Keys("moritz"), topics.MAP).put(map_bytes(pillared_room()))
        bus.publisher("robot2/map", topics.MAP.schema, topics.MAP.qos).put(b"")
        bus.token(token.format("nav_msgs::msg::dds_::OccupancyGrid_"))
        bus.token(token.replace("%map", "%costmap").format("nav_msgs::msg::dds_::OccupancyGrid_"))
        found = session.peers(at(daemon.endpoint))
    assert [line for line in found.details if "elsewhere" in line] == [
        "a map elsewhere: ROS_DOMAIN_ID 7, topic /robot1/map",
        "a map elsewhere: key fasaco/@v1/moritz/map",
        "a map elsewhere: key robot2/map",
    ]
    assert "ros2.namespace" in found.to_do


def test_a_daemon_that_loads_lacks_nothing_yet():
    assert session.lacking_inputs(Status(state="loading")) == []
    assert session.lacking_inputs(Status(state="waiting for map")) == ["map", "pose"]


def test_a_daemon_is_found_with_what_it_lacks(tmp_path):
    with joined_daemon(tmp_path) as (daemon, outsider):
        context = at(daemon.endpoint)
        met = session.session(context)
        assert met.level is Level.OK
        assert met.details == (f"{daemon.endpoint}: a program listens there",)
        lacking = session.peers(context)
        assert lacking.level is Level.WARN
        assert lacking.found == (
            "the daemon runs: waiting for map, no map yet; it has no map and pose"
        )
        assert "fasaco/@v1/robot/map" in lacking.to_do
        other = session.peers(at(daemon.endpoint, name="second"))
        assert other.found.startswith("no daemon of robot 'second'; no maps and no poses received")
        assert "other robots: robot" in other.details
        # What comes and is refused is no lack: the reason says what is wrong with it.
        with meanwhile(lambda: [outsider.put(kind, b"\0") for kind in ("map", "pose")], 0.1):
            outsider.wait_status(lambda status: "newest map was refused" in status["reason"])
            refused = session.peers(context)
        assert "; the newest map was refused: nav_msgs/msg/OccupancyGrid: " in refused.found
        assert refused.to_do.startswith("correct what comes on fasaco/@v1/robot/map, ")
        outsider.put("map", map_bytes(pillared_room()))
        outsider.wait_status(lambda status: "newest pose was refused" in status["reason"])
        outsider.put("pose", pose_bytes(1.0, 1.0))
        status = outsider.wait_status(lambda status: status["state"] == "covering")
        assert "refused" not in status["reason"]
        assert session.peers(context).level is Level.OK
        assert session.peers(context).found.startswith("the daemon runs: covering, path ")
        client = session.session(at(connect=(daemon.endpoint,), mode="client"))
        assert client.found == f"{daemon.endpoint}: a program listens there"
        # What is both reason and trouble is said once.
        outsider.wait_status(lambda status: status["state"] == "degraded")
        said = session.peers(context).found.removeprefix("the daemon runs: degraded, ").split("; ")
        assert len(said) == len(set(said)) > 0


def test_a_listener_is_only_claimed_where_it_was_looked_for():
    """Of endpoints without TCP it said so, too."""
    client = session.session(at(connect=("udp/127.0.0.1:7999",), mode="client"))
    only = "only a connection shows whether a program listens there"
    assert (client.level, client.found) == (Level.OK, f"udp/127.0.0.1:7999: {only}")


def test_publishers_are_found_without_a_daemon(tmp_path):
    with (
        daemon_process(tmp_path) as other,
        Outsider(other.endpoint),  # there as soon as the daemon is
        open_bus(BusSettings(connect=(other.endpoint,))) as bus,
    ):
        prefix = "fasaco/@v1/second"
        # Latched, and said before anybody listened; and now and then.
        bus.publisher(f"{prefix}/map", qos=QOS["map"]).put(map_bytes(pillared_room()))
        poses = bus.publisher(f"{prefix}/pose", qos=QOS["pose"])
        with meanwhile(lambda: poses.put(pose_bytes(1.0, 1.0)), 0.1):
            found = session.peers(at(other.endpoint, name="second"))
    assert found.found == "no daemon of robot 'second'; maps and poses received"
    assert f"map: 1 in {session.LISTEN_S} s" in found.details


def test_a_silent_program_does_not_block_the_report():
    """Something listens and never answers: the report is there in time all the same."""
    with socket.socket() as mute:
        mute.bind(("127.0.0.1", 0))
        mute.listen()
        context = at(f"tcp/127.0.0.1:{mute.getsockname()[1]}")
        slow = Check("slow", lambda _: session.session(context))
        began = time.monotonic()
        told = dict(report.findings(None, (slow,)))
        assert time.monotonic() - began < report.PATIENCE_S + 30.0
    assert told["slow"].level in (Level.WARN, Level.FAIL)


def test_a_crashing_check_fails_only_its_own_line():
    def stumble(_: CheckContext) -> Finding:
        raise KeyError("what")

    fine = Check("fine", lambda _: Finding(Level.OK, "fine"))
    told = dict(report.findings(None, (Check("stumbles", stumble), fine)))
    assert told["fine"].found == "fine"
    assert told["stumbles"].level is Level.WARN
    assert "KeyError" in told["stumbles"].found
