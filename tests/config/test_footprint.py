"""Outlines of robots that are no discs, and the disc that is planned with."""

import math

import msgspec
import pytest
import yaml

import fasaco_edge as fe
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.config.loading import inspect_config
from fasaco_edge.config.robot import FootprintConfig
from fasaco_edge.daemon.loop.answers import config_document
from fasaco_edge.offline.plan import checked
from tests.support.processes import fasaco_edge

SCRUBBER = {"width_m": 0.5, "length_m": 0.6}


def inspected(tmp_path, **robot):
    file = tmp_path / "robot.yaml"
    file.write_text(yaml.safe_dump({"robot": robot}))
    return inspect_config(file)


@pytest.mark.parametrize(
    ("footprint", "radius_m"),
    [
        (SCRUBBER, math.hypot(0.25, 0.3)),
        (SCRUBBER | {"ahead_m": 0.5}, math.hypot(0.25, 0.5)),
        (SCRUBBER | {"ahead_m": 0.0}, math.hypot(0.25, 0.6)),
        ({"polygon": [[0.4, 0.0], [-0.2, 0.3], [-0.2, -0.3]]}, 0.4),
    ],
)
def test_the_disc_around_it_is_planned_with(tmp_path, footprint, radius_m):
    config, faults = inspected(tmp_path, footprint=footprint)
    assert faults == []
    assert config.robot.radius_m == pytest.approx(radius_m)
    assert f"of radius {radius_m:.3g} m" in config.robot.assumed


def test_plans_from_python_take_it():
    for robot in (fe.Robot(), fe.Robot(footprint=FootprintConfig(**SCRUBBER))):
        assert checked(robot) == robot


def test_a_disc_assumes_nothing(tmp_path):
    config, _ = inspected(tmp_path, radius_m=0.3)
    assert config.robot.assumed == ""


def test_a_shown_footprint_can_be_read_again(tmp_path):
    config, _ = inspected(tmp_path, footprint=SCRUBBER)
    again = msgspec.convert(config_document(config), DaemonConfig)
    assert again.robot == config.robot


@pytest.mark.parametrize(
    ("robot", "said"),
    [
        ({"footprint": {}}, "robot.footprint: must have width_m and length_m, or a polygon"),
        ({"footprint": {"width_m": 0.5}}, "must have width_m and length_m"),
        ({"footprint": SCRUBBER | {"ahead_m": 0.7}}, "ahead_m: must be at most length_m, 0.6"),
        ({"footprint": SCRUBBER | {"polygon": [[0, 0], [1, 0], [1, 1]]}}, "not both"),
        ({"footprint": {"polygon": [[0, 0], [1, 0]]}}, "polygon: must have 3 corners, got 2"),
        ({"footprint": {"polygon": [[0, 0]] * 3}}, "corners apart from each other"),
        ({"footprint": {"polygon": [[0, 8]] * 3}}, "robot.footprint.polygon[0][1]"),
        ({"footprint": {"width": 1}}, "robot.footprint.width: unknown key"),
        ({"footprint": SCRUBBER, "radius_m": 0.3}, "robot.radius_m: must be left out"),
    ],
)
def test_mistakes_are_named(tmp_path, robot, said):
    config, faults = inspected(tmp_path, **robot)
    assert config is None
    assert any(said in str(fault) for fault in faults), faults


def test_init_check_config_doctor_name_the_assumption(tmp_path):
    file = tmp_path / "robot.yaml"
    words = ("--robot-size", "0.5x0.6", "--tool-width", "0.45", "--map-by", "zenoh", "--no-try")
    made = fasaco_edge("init", file, *words)
    assert yaml.safe_load(file.read_text())["robot"]["footprint"] == SCRUBBER
    assert "assumed:    the robot is planned with the disc around its footprint" in made.out
    assert "narrower than 0.781 m are left out" in fasaco_edge("check-config", file).out
    assert "of radius 0.391 m" in fasaco_edge("doctor", "--config", file).out
    wrong = fasaco_edge("init", tmp_path / "other.yaml", "--robot-size", "0.5", *words[2:])
    assert "must be like 0.5x0.6, got '0.5'" in wrong.err
