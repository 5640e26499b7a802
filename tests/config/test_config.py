"""The configuration: what is missing is the default, what is wrong is refused and named."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import msgspec
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.cli import main
from fasaco_edge.config.config import DaemonConfig, MissionPolicyConfig
from fasaco_edge.config.loading import decode_config, inspect_config, load_config
from fasaco_edge.config.ros import RosConfig, RosFrames
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.planners.registry import PLANNER_NAMES
from fasaco_edge.recording.write.quota import budget_of
from tests.support.examples import examples


@pytest.fixture
def load(tmp_path: Path) -> Any:
    def write_and_load(text: str) -> DaemonConfig:
        file = tmp_path / "config.yaml"
        file.write_text(text)
        return load_config(file)

    return write_and_load


@pytest.mark.parametrize("text", ["", "# nothing but a remark\n", "{}", "robot: {}\nplanner: {}"])
def test_missing_keys_have_their_defaults(load, text):
    assert load(text) == load_config(None) == DaemonConfig()


def test_the_defaults_are_reachable_from_this_computer_only():
    config = load_config(None)
    assert config.bus.listen == ("tcp/127.0.0.1:7447",)
    assert config.bus.connect == ()
    assert config.keys().prefix == "fasaco/@v1/robot"


def test_every_section_is_read(load):
    sections = {
        "robot": {"name": "mower-2", "radius_m": 0.25, "tool_width_m": 0.5},
        "bus": {
            "base": "site/north",
            "mode": "router",
            "listen": ["tcp/127.0.0.1:7001", "tcp/127.0.0.1:7002"],
            "connect": ["tcp/10.0.0.1:7447"],
        },
        "map": {"free_at_most": 10, "occupied_at_least": 90, "max_lattice_cells": 1000},
        "pose": {"schema": "nav_msgs/msg/Odometry"},
        "planner": {
            "name": "fasaco",
            "ants": 17,
            "velocities": "3,1",
            "q0": 0.5,
            "alpha": 1,
            "tau0": 2.5,
            "seed": 9,
            "budget_s": 3,
        },
        "mission": {"state_dir": "/var/lib/mower"},
    }
    config = load(yaml.safe_dump(sections))
    for name, section in sections.items():
        for key, value in section.items():
            got = getattr(getattr(config, name), key)
            assert got == (tuple(value) if isinstance(value, list) else value), (name, key)
    assert config.keys().prefix == "site/north/@v1/mower-2"


COLONY_SEARCH = (
    "for true write name: colony-search, or leave the name out; for false write name: fasaco"
)


@pytest.mark.parametrize(
    ("key", "value", "why", "hint"),
    [
        (
            *("own", "lab.mine:Deep", "the daemon plans with its own planners only"),
            "delete the key; `fasaco-edge plan --planner MODULE:NAME`",
        ),
        ("local_search", "true", "each planner has a name of its own", COLONY_SEARCH),
        ("local_search", "false", "each planner has a name of its own", COLONY_SEARCH),
    ],
)
def test_a_removed_key_is_an_error_that_says_what_to_do(load, key, value, why, hint):
    with pytest.raises(BadConfiguration) as caught:
        load(f"planner:\n  name: zigzag\n  {key}: {value}\n")
    assert f"line 3: planner.{key}: was removed in this version, {why}" in str(caught.value)
    assert hint in caught.value.hint


def test_a_removed_key_without_a_value_is_ignored(load):
    """Installers copied the example of that time whole, and an upgrade keeps their file."""
    assert load('planner:\n  name: zigzag\n  own: ""\n').planner.name == "zigzag"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("robots: {}", "robots: unknown key"),
        ("robot: {radius: 0.2}", "robot.radius: unknown key"),
        ("robot: {radius_m: 0}", "robot.radius_m: expected a number above 0, got 0"),
        ("robot: {radius_m: 10.5}", "robot.radius_m: expected a number of at most 10, got 10.5"),
        ("robot: {radius_m: .nan}", "robot.radius_m: expected a number above 0, got nan"),
        ("robot: {tool_width_m: 1e-300}", "robot.tool_width_m: must be in [1e-06, 1000] m, got"),
        ("robot: {radius_m: wide}", "robot.radius_m: expected a number, got 'wide'"),
        ("robot: {radius_m: true}", "robot.radius_m: expected a number, got true"),
        ("robot: {radius_m: }", "robot.radius_m: expected a number, got null"),
        ("robot: {clearance_m: -0.01}", "robot.clearance_m: expected a number of at least 0"),
        ("robot: {overlap: 0.9}", "robot.overlap: expected a number of at most 0.5, got 0.9"),
        ("robot: 3", "robot: expected a mapping, got 3"),
        ("mission: {home: 3}", "expected a mapping such as {x_m: ..., y_m: ...} or null, got 3"),
        ("mission: {keep_out: [[1, 1], [2, 1], [2, 2]]}", "mission.keep_out: expected a list:"),
        ("robot: {name: 3}", "robot.name: expected a text, in quotes, got 3"),
        ("robot: {name: a/b}", "robot.name: must be chunks of letters, digits, '_' and '-'"),
        ("robot: {name: ''}", "got ''"),
        (r'bus: {mode: "\ud800"}', "bus.mode: expected peer, client or router, got"),
        ("bus: {listen: 'tcp/0.0.0.0:1'}", "bus.listen: expected a list: write [ ] around it"),
        ("bus: {listen: [7447]}", "bus.listen[0]: expected a text, in quotes, got 7447"),
        ("bus: {listen: []}", "bus.listen: must not be empty if bus.connect is empty"),
        ("map: {free_at_most: 101}", "map.free_at_most: expected a whole number of at most 100"),
        ("fleet: {name: hall, x_m: 3}", "fleet.frame: expected the name of the frame that"),
        ("fleet: {name: hall, map_frame: floor1}", "fleet.map_frame: expected fleet.frame, too:"),
        ("map: {free_at_most: 65}", "map.free_at_most: must be below map.occupied_at_least"),
        (
            "pose: {schema: nav_msgs/msg/Path}",
            "pose.schema: expected geometry_msgs/msg/PoseStamped, "
            "geometry_msgs/msg/PoseWithCovarianceStamped or nav_msgs/msg/Odometry, "
            "got 'nav_msgs/msg/Path'",
        ),
        (
            "planner: {name: best}",
            f"planner.name: expected {', '.join(PLANNER_NAMES[:-1])} or {PLANNER_NAMES[-1]}, "
            "got 'best'",
        ),
        ("planner: {ants: 0}", "planner.ants: expected a whole number of at least 1, got 0"),
        ("planner: {ants: 1.5}", "planner.ants: expected a whole number, got 1.5"),
        ("planner: {ants: 1e7}", "planner.ants: expected a whole number, got 10000000.0"),
        ("planner: {q0: 1.1}", "planner.q0: expected a number of at most 1, got 1.1"),
        ("planner: {alpha: 0.0}", "planner.alpha: expected a number above 0, got 0.0"),
        ("planner: {tau0: .inf}", "planner.tau0: expected a number of at most 1000000, got inf"),
        ("planner: {seed: -1}", "planner.seed: expected a whole number of at least 0, got -1"),
        ("planner: {budget_s: .nan}", "planner.budget_s: expected a number above 0, got nan"),
        # Without quotes this is a number in YAML 1.1: 8 minutes 1 second.
        ("planner: {velocities: 8:1}", "planner.velocities: expected a text, in quotes, got 481"),
        ("mission: {state: /var}", "mission.state: unknown key"),
        ("mission: {state_dir: 3}", "mission.state_dir: expected a text, in quotes, got 3"),
        (r'mission: {state_dir: "a\0b"}', "mission.state_dir: must be a path"),
        ("mission: {zones: [{name: hall}]}", "mission.zones[0].polygon: missing"),
        (
            "mission: {zones: [{name: hall, polygon: [[0, 0], [1, a], [1, 1]]}]}",
            "mission.zones[0].polygon[1][1]: expected a number, got 'a'",
        ),
        (
            "mission: {zones: [{name: hall, polygon: [[0, 0], [1, 0], [1, 1]], floor: 3}]}",
            "mission.zones[0].floor: unknown key; there are name, polygon",
        ),
        (
            "mission: {dock: {x_m: 1, y_m: 2, yaw: 3}}",
            "mission.dock.yaw: unknown key; did you mean mission.dock.yaw_deg?",
        ),
        ("scan: {x: 1}", "scan.x: unknown key; did you mean scan.x_m?"),
        ("robot: {turn: 1}", "did you mean robot.turn_deg_s or robot.turn_deg_s2"),
        (
            "mission: {zones: [{name: a, polygon: [[0, 0], [1, 0], [1, 1]]}, "
            "{name: a, polygon: [[0, 0], [2, 0], [1, 1]]}]}",
            "mission.zones[1].name: there is a zone 'a' already",
        ),
        ("mission: {keep_out_mask: 'mask:{}'}", "mission.keep_out_mask: not a mask"),
        ("[1, 2]", "expected a mapping, got [1, 2]"),
        ("robot: {1: 2}", "robot: expected a text as key, got 1"),
        ("robot: {radius_m: 1, radius_m: 2}", "robot.radius_m: is given twice in line 1"),
        ("robot: {radius_m: 0,2}", "got 2; a number has a decimal point, no comma"),
        ("1: 2", "expected a text as key, got 1"),
        ("robot:\n  name: [unclosed\nbus: 1", "not plain YAML: line 3, column 4: expected ','"),
        ("robot:\n\tname: x", "line 2, column 1: a tab: indent by spaces"),
        ("robot:\n  name: a\n radius_m: 1", "line 3, column 2: indented differently from"),
        ("robot: {name: a\nbus: {}", "line 2, column 4: expected ',' or '}'"),
        ("robot: 2020-13-45", "not plain YAML: month must be in 1..12"),
        ("[" * 5000, "not plain YAML: line 1: nested deeper than 32 levels"),
        ("--- {}\n--- {}", "not plain YAML"),
        ("!!python/object/apply:os.getcwd []", "not plain YAML"),
        ("planner: {velocities: '8:x'}", "planner.velocities: must look like 8:1, 1:8, 4 or 8,4,1"),
        ("planner: {velocities: ''}", "velocities: must look like 8:1, 1:8, 4 or 8,4,1, got ''"),
        ("planner: {velocities: '0'}", "planner.velocities: must be in 1..64, got 0"),
        ("planner: {velocities: '8,-1,2'}", "planner.velocities: must be in 1..64, got -1"),
        ("planner: {ants: 7}", "planner.ants: must be in 8..1000000, one for each cohort"),
        ("planner: {ants: 2, velocities: '1,2,3'}", "planner.ants: must be in 3..1000000"),
        ("recording: {part_mb: 60, quota_mb: 100}", "recording.quota_mb: must be 0 or at least"),
    ],
)
def test_a_fault_is_named_with_its_file(load, tmp_path, text, said):
    with pytest.raises(BadConfiguration) as caught:
        load(text)
    assert said in str(caught.value)
    assert str(tmp_path / "config.yaml") in str(caught.value)


@pytest.mark.parametrize(
    ("document", "keys"),
    [
        (
            {"metrics": {"listen": "nonsense", "open_to_everyone": "perhaps"}},
            {"metrics.listen", "metrics.open_to_everyone"},
        ),
        (
            {"metrics": {"listen": "0.0.0.0:9465", "open_to_everyone": "perhaps"}},
            {"metrics.open_to_everyone"},
        ),
        (
            {"planner": {"ants": "many", "velocities": "fast"}},
            {"planner.ants", "planner.velocities"},
        ),
        ({"planner": {"ants": 2, "velocities": "fast"}}, {"planner.velocities"}),
        ({"planner": {"ants": 2, "velocities": 3}}, {"planner.velocities"}),
    ],
)
def test_faults_that_do_not_depend_on_each_other_come_together(tmp_path, document, keys):
    file = tmp_path / "robot.yaml"
    file.write_text(json.dumps(document))
    assert {fault.key for fault in inspect_config(file)[1]} == keys


def test_unreadable_files_are_named(tmp_path):
    with pytest.raises(BadConfiguration, match=r"missing\.yaml: No such file"):
        load_config(tmp_path / "missing.yaml")
    with pytest.raises(BadConfiguration, match="Is a directory") as caught:
        load_config(tmp_path)
    assert caught.value.hint == "name a file that can be read"
    binary = tmp_path / "binary.yaml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadConfiguration, match="not plain YAML"):
        load_config(binary)


@pytest.mark.parametrize(
    ("configured", "environ", "folder"),
    [
        ("/srv/state", {"STATE_DIRECTORY": "/var/lib/fasaco-edge"}, "/srv/state"),
        ("~/state", {}, "/home/pi/state"),
        ("", {"STATE_DIRECTORY": "/var/lib/a:/var/lib/b"}, "/var/lib/a"),
        ("", {"STATE_DIRECTORY": "", "XDG_STATE_HOME": "/x"}, "/x/fasaco-edge"),
        # The XDG specification: relative paths are to be ignored.
        ("", {"XDG_STATE_HOME": "x"}, "/home/pi/.local/state/fasaco-edge"),
        ("", {}, "/home/pi/.local/state/fasaco-edge"),
    ],
)
def test_the_state_folder_follows_settings_and_environment(
    monkeypatch, configured, environ, folder
):
    monkeypatch.setenv("HOME", "/home/pi")
    assert MissionPolicyConfig(state_dir=configured).state_folder(environ) == Path(folder)


def test_without_a_home_the_state_folder_must_be_given():
    with pytest.raises(BadConfiguration, match=r"mission\.state_dir: ~nobody-of-that-name"):
        MissionPolicyConfig(state_dir="~nobody-of-that-name/x").state_folder({})


VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=10),
    st.dates(),
    st.sampled_from(["8:1", "1:8", "4", "tcp/127.0.0.1:1", "robot", "peer"]),
    st.lists(st.text(max_size=5), max_size=3),
    st.dictionaries(st.one_of(st.text(max_size=5), st.integers()), st.integers(), max_size=2),
)
NAMES = {
    section: sorted((getattr(DaemonConfig(), section) or RosConfig).__struct_fields__)
    for section in DaemonConfig.__struct_fields__
}


@st.composite
def documents(draw: st.DrawFn) -> object:
    sections = draw(st.lists(st.sampled_from(sorted(NAMES)), max_size=2, unique=True))
    document: dict[object, object] = {
        section: {key: draw(VALUES) for key in draw(st.sets(st.sampled_from(NAMES[section])))}
        for section in sections
    }
    if draw(st.booleans()):
        document |= draw(st.dictionaries(st.sampled_from([*sorted(NAMES), "x", 1]), VALUES))
    return document


@examples(300)
@given(document=documents())
def test_any_document_is_a_configuration_or_is_refused(tmp_path_factory, document):
    file = tmp_path_factory.getbasetemp() / "any.yaml"
    file.write_text(yaml.safe_dump(document))
    try:
        config = load_config(file)
    except BadConfiguration:
        return
    planner, robot = config.planner, config.robot
    assert 0 < robot.radius_m <= 10
    assert 0 < robot.tool_width_m <= 10
    assert config.map.free_at_most < config.map.occupied_at_least
    assert math.isfinite(planner.q0 + planner.alpha + planner.tau0 + planner.budget_s)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("planner: {velocities: '8:x'}", "velocities: must look like 8:1, 1:8, 4 or 8,4,1"),
        ("planner: {ants: 3}", "ants: must be in 8..1000000"),
        ("robot: {radius: 0.2}", "robot.radius: unknown key"),
        (None, "No such file or directory"),
    ],
)
def test_the_command_ends_with_ex_config(tmp_path, capsys, text, said):
    """Exit code 78 tells the service manager not to try again (sysexits.h)."""
    file = tmp_path / "config.yaml"
    if text is not None:
        file.write_text(text)
    assert main(["run", "--config", str(file)]) == 78
    told = capsys.readouterr().err
    assert said in told
    assert str(file) in told
    assert f"hint: {'correct the named key' if text else 'name another file'}" in told


def test_ros_is_left_out_unless_it_stands_there(load):
    assert not load("").ros2
    config = load("ros2: {kind: bridge, namespace: /robot1, pose: nav_msgs/msg/Odometry}")
    assert config.ros2.inputs["map"].name == "/robot1/map"
    assert config.ros2.inputs["map"].latched
    assert {kind: topic.name for kind, topic in config.ros2.inputs.items()} == {
        "map": "/robot1/map",
        "map_update": "/robot1/map_updates",
        "battery": "/robot1/battery_state",
        "priority": "/robot1/floor_priority",
        "pose": "/robot1/pose",
    }
    inputs = load("ros2: {kind: rmw_zenoh}").ros2.inputs
    assert list(inputs)[2:] == ["battery", "priority", "tf_static", "pose"]


@pytest.mark.parametrize(
    ("block", "text"),
    [
        ("", "ros2: expected a mapping such as {kind: ...}, got null"),
        ("{}", "ros2.kind: missing"),
        ("{kind: dds}", "ros2.kind: expected bridge or rmw_zenoh, got 'dds'"),
        ("{kind: bridge, domain: 3}", "domain and node are for kind rmw_zenoh"),
        ("{kind: bridge, node: n}", "domain and node are for kind rmw_zenoh"),
        ("{kind: bridge, dock: nav2}", "ros2.dock: was removed in this version"),
        ("{kind: bridge, nav2: {action: x}}", "ros2.nav2.action: must be like /follow_path"),
        ("{kind: rmw_zenoh, node: a-b}", "ros2.node: must be letters, digits and _, got 'a-b'"),
        ("{kind: rmw_zenoh, namespace: r}", "ros2.namespace: must be / or like /robot1, got 'r'"),
        ("{kind: rmw_zenoh, namespace: /r/}", "ros2.namespace: must be / or like"),
        ("{kind: rmw_zenoh, topics: {map: map}}", "ros2.topics.map: must be like /robot1/map"),
        ("{kind: rmw_zenoh, topics: {tf: /a/*}}", "ros2.topics.tf: must be like /robot1/map"),
        ("{kind: rmw_zenoh, topics: {tf: /1a}}", "ros2.topics.tf: must be like /robot1/map"),
        (f"{{kind: rmw_zenoh, topics: {{tf: /{'a' * 247}}}}}", "ros2.topics.tf: must be like"),
        (
            "{kind: rmw_zenoh, topics: {pose: /map}}",
            "ros2.topics.pose: must differ from topics.map",
        ),
        ("{kind: rmw_zenoh, topics: {maps: /m}}", "ros2.topics.maps: unknown key"),
        ("{kind: rmw_zenoh, pose: Odometry}", "ros2.pose: expected tf, geometry_msgs/msg/Pose"),
        ("{kind: rmw_zenoh, frames: {map: ''}}", "ros2.frames.map: must be the name of a frame"),
        ('{kind: rmw_zenoh, frames: {map: "\\ud800"}}', "ros2.frames.map: must be the name of"),
        (
            "{kind: rmw_zenoh, frames: {robot: map}}",
            "ros2.frames.robot: must differ from frames.map",
        ),
    ],
)
def test_a_fault_in_the_block_ros2_is_named(load, block, text):
    with pytest.raises(BadConfiguration) as caught:
        load(f"ros2: {block}")
    assert text in str(caught.value)


def test_the_recorder_gets_its_settings_from_the_configuration(tmp_path):
    file = tmp_path / "config.yaml"
    file.write_text(
        "recording: {part_mb: 10, part_min: 2.5, quota_mb: 100, least_free_mb: 7}\n"
        "robot: {name: left}\npose: {schema: nav_msgs/msg/Odometry}\n"
        "planner: {tau0: 1.0e-12}\nros2: {kind: bridge, frames: {map: floor}}\n"
    )
    config = load_config(file)
    handed = decode_config(msgspec.json.encode(config))
    assert handed == config
    budget = budget_of(handed, tmp_path)
    assert (budget.part_bytes, budget.part_s) == (10_000_000, 150.0)
    assert (budget.robot, budget.quota_bytes) == ("left", 100_000_000)
    assert budget.least_free_bytes == 7_000_000
    assert handed.pose.schema == "nav_msgs/msg/Odometry"
    assert handed.ros2.frames == RosFrames(map="floor", robot="base_link")
    assert list(handed.ros2.inputs)[1:] == [
        *("map_update", "battery", "priority", "tf_static", "pose")
    ]
    with pytest.raises(BadConfiguration, match="unknown field `colour`"):
        decode_config(b'{"colour": 1}')


@pytest.mark.parametrize(
    ("text", "lattice_deg"),
    [
        ("planner: {align: axes}", 0.0),
        ("planner: {align: walls}", None),
        ("planner: {align: -12}", -12.0),
        # Cells that robots share, and centres of cells, keep to the axes.
        ("{planner: {align: walls}, fleet: {name: hall}}", 0.0),
        ("{planner: {align: 30}, fleet: {name: hall}}", 30.0),
        ("planner: {align: walls, line: cells}", 0.0),
    ],
)
def test_at_which_angle_cells_lie(load, text, lattice_deg):
    assert load(text).lattice_deg == lattice_deg
