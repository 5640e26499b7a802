"""``init`` writes size, tool and what is no default, refuses faults, and says what it received."""

from __future__ import annotations

import io
import json

import pytest

from fasaco_edge.cli import main
from fasaco_edge.cli.console import terminal
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.config.loading import load_config
from tests.support.processes import free_endpoint
from tests.support.ros_robot import GRID, Naming, ros_robot, ros_router

GIVEN = ["--robot-radius", "0.2", "--tool-width", "0.3", "--map-by", "zenoh"]


def init(file, *words):
    return main(["init", str(file), "--no-try", *words])


def test_it_has_size_and_tool_and_else_what_is_no_default(tmp_path, capsys):
    file = tmp_path / "robot.yaml"
    assert init(file, *GIVEN, "--clearance", "0") == 0
    described = ["robot:", "  radius_m: 0.2", "  tool_width_m: 0.3"]
    assert file.read_text().splitlines()[1:] == described
    printed = capsys.readouterr().out
    assert "\n  robot:\n    radius_m: 0.2\n" in printed
    assert f"fasaco-edge run --config {file}" in printed
    default = ["--robot-radius", "0.18", "--tool-width", "0.3", "--map-by", "zenoh"]
    default += ["--clearance", "0"]
    assert init(file, *default, "--force") == 0
    # What was given is there to be read, also where it is the default.
    assert "radius_m: 0.18\n" in file.read_text()
    assert load_config(file) == DaemonConfig()


def test_a_name_like_a_number_is_written_in_quotes(tmp_path, capsys):
    file = tmp_path / "robot.yaml"
    assert init(file, *GIVEN, "--name", "2e1") == 0
    assert load_config(file).robot.name == "2e1"
    capsys.readouterr()
    assert main(["check-config", str(file), "--show"]) == 0
    file.write_text(capsys.readouterr().out)
    assert load_config(file).robot.name == "2e1"


def test_ros_and_a_router(tmp_path, capsys):
    file = tmp_path / "robot.yaml"
    words = ["--robot-radius", "0,18", "--tool-width", "0.4", "--map-by", "rmw_zenoh"]
    words += ["--domain", "7", "--namespace", "/left", "--connect", "tcp/127.0.0.1:7447"]
    assert init(file, *words, "--json") == 0
    config = load_config(file)
    assert (config.ros2.kind, config.ros2.domain, config.ros2.namespace) == (
        *("rmw_zenoh", 7, "/left"),
    )
    assert (config.bus.mode, config.bus.listen) == ("client", ())
    told = json.loads(capsys.readouterr().out)
    assert (told["file"], told["heard"]) == (str(file), None)
    assert told["config"]["robot"] == {
        "radius_m": 0.18,
        "clearance_m": 0.02,
        "tool_width_m": 0.4,
    }


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (GIVEN[:4], "--map-by must be given: there is no terminal for questions"),
        ([], "--robot-radius, --tool-width, --map-by must be given"),
        ([*GIVEN, "--domain", "7"], "--domain and --namespace are for maps from ROS 2"),
        (
            [*GIVEN, "--robot-radius", "20"],
            "--robot-radius: expected a number of at most 10, got 20",
        ),
        (
            [*GIVEN, "--clearance", "-1"],
            "--clearance: expected a number of at least 0, got -1.0",
        ),
        ([*GIVEN, "--name", "a/b"], "--name: "),
        ([*GIVEN, "--robot-size", "20x1"], "--robot-size: expected a number of at most 7"),
        ([*GIVEN, "--tool-width", "1e-300"], "--tool-width: must be in [1e-06, 1000] m"),
        ([*GIVEN, "--connect", "here"], "--connect: 'here': no protocol before the address"),
    ],
)
def test_an_invalid_value_is_refused_and_not_written(words, said, tmp_path, capsys):
    file = tmp_path / "robot.yaml"
    assert init(file, *words) == 78
    assert said in capsys.readouterr().err
    assert not file.exists()


def test_an_existing_file_is_kept(tmp_path, capsys):
    file = tmp_path / "robot.yaml"
    file.write_text("robot: {name: mine}\n")
    assert init(file, *GIVEN) == 78
    assert "already exists" in capsys.readouterr().err
    assert file.read_text() == "robot: {name: mine}\n"


@pytest.fixture
def typed(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    def type_in(text):
        console = terminal.err()
        monkeypatch.setattr("sys.stdin", Terminal(text))
        monkeypatch.setattr("fasaco_edge.cli.init.err", lambda: console)
        monkeypatch.setattr(type(console), "is_terminal", property(lambda _: True))

    return type_in


def test_at_a_terminal_it_asks(tmp_path, typed):
    typed("0.25\n\nbridge\n\n")
    file = tmp_path / "robot.yaml"
    assert init(file) == 0
    config = load_config(file)
    assert (config.robot.radius_m, config.robot.tool_width_m) == (0.25, 0.3)
    assert (config.ros2.kind, config.bus.mode) == ("bridge", "peer")


def test_a_typing_error_is_asked_for_again(tmp_path, typed, capsys):
    typed("O,25\n25\n0,25\nO.3\n0.3\nzeno\nzenoh\n127.0.0.1:7447\ntcp/127.0.0.1:7447\n")
    file = tmp_path / "robot.yaml"
    assert init(file) == 0
    config = load_config(file)
    assert (config.robot.radius_m, config.robot.tool_width_m) == (0.25, 0.3)
    assert config.bus.connect == ("tcp/127.0.0.1:7447",)
    asked = capsys.readouterr().err
    for said in (
        "must be a number such as 0.25, got 'O,25'",
        "]: expected a number of at most 10, got 25.0",
        "must be a number such as 0.25, got 'O.3'",
        "must be zenoh, rmw_zenoh, bridge, got 'zeno'",
        "]: '127.0.0.1:7447': no protocol before the address (an endpoint is ",
    ):
        assert said in " ".join(asked.split()) + " "
    assert asked.count("Radius of the disc") == 3


def test_an_invalid_option_is_refused_before_a_question(tmp_path, typed, capsys):
    typed("0.3\n")
    assert init(tmp_path / "robot.yaml", "--robot-radius", "20") == 78
    asked = capsys.readouterr().err
    assert "--robot-radius: expected a number of at most 10, got 20.0" in " ".join(asked.split())
    assert "Width of the" not in asked


def test_without_an_answer_no_file_is_written(tmp_path, typed, capsys):
    typed("0.25\n")
    file = tmp_path / "robot.yaml"
    assert init(file) == 78
    assert "no answer to: Width of its tool [m]" in capsys.readouterr().err
    assert not file.exists()


def test_it_names_the_maps_that_it_received(tmp_path, capsys):
    file, naming = tmp_path / "robot.yaml", Naming(3)
    words = [*GIVEN[:4], "--map-by", "rmw_zenoh", "--json", "--listen", "6", "--force"]
    endpoint = free_endpoint()
    words += ["--connect", endpoint]
    with ros_router(endpoint), ros_robot(endpoint, naming) as robot:
        robot.put("map", GRID, b"any", latched=True)
        assert main(["init", str(file), *words, "--domain", "3"]) == 0
        heard = json.loads(capsys.readouterr().out)["heard"]
        assert heard["found"] == "no daemon of robot 'robot'; maps received"
    assert main(["init", str(file), *words[:-1], free_endpoint()]) == 0
    heard = json.loads(capsys.readouterr().out)["heard"]
    assert heard["found"] == "neither a daemon nor a router answers"
