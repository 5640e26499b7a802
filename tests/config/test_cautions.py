"""Settings that are in order each, and do not go together: they are named."""

from __future__ import annotations

import json

import msgspec
import pytest
import yaml

from fasaco_edge.config.cautions import NEAR_SHARE, cautions
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.doctor.finding import Level
from fasaco_edge.doctor.report import findings
from fasaco_edge.grid.polygons import is_near
from fasaco_edge.planners import line
from tests.support.processes import fasaco_edge

SQUARE = [[2.0, 2.0], [4.0, 2.0], [4.0, 4.0], [2.0, 4.0]]
WIDE = {"robot": {"radius_m": 0.18, "tool_width_m": 0.6}}


def said(**sections):
    return cautions(msgspec.convert(sections, DaemonConfig))


@pytest.mark.parametrize(
    ("sections", "text"),
    [
        (WIDE, "the tool sticks 0.12 m out of the robot's disc, robot.radius_m 0.18"),
        ({"robot": {"tool_ahead_m": -0.1}}, "robot.tool_ahead_m -0.1: the tool sticks 0.07 m out"),
        ({"robot": {"speed_m_s": 8.0}}, "a pose comes at least 13 times a second"),
        ({"robot": {"turn_deg_s": 90.0, "quarter_turn_s": 2.0}}, "robot.quarter_turn_s has no"),
        ({"robot": {"steered_deg": 5.0}}, "robot.steered_deg has no effect"),
        ({"planner": {"name": "colony-search"}}, ""),
        ({"planner": {"name": "fasaco"}}, "planner.name fasaco is the paper's colony"),
        (
            {"planner": {"ants": 300, "visibility": "distance", "threads": 2}},
            "colony-search: planner.ants, planner.visibility, planner.threads",
        ),
        ({"planner": {"name": "aco", "ants": 300}}, ""),
        ({"planner": {"name": "zigzag", "ants": 300}}, "planner.name is zigzag: planner.ants"),
        ({"scan": {"x_m": 0.1}}, ""),
        ({"scan": {"x_m": 3.0, "y_m": 4.0}}, "the lidar is 5 m from the robot's middle"),
        ({"scan": {}, "ros2": {"kind": "bridge", "follow": "nav2"}}, "scan has no effect where"),
        (
            {
                "planner": {"line": "cells", "align": "axes", "swept": 0.99},
                "robot": {"overlap": 0.2},
            },
            "no effect where planner.line is cells: planner.align, planner.swept, robot.overlap",
        ),
        (
            {"planner": {"line": "cells"}, "robot": {"clearance_m": 0.1}},
            "no effect where planner.line is cells: robot.clearance_m",
        ),
        ({"robot": {"reverses": False}}, "robot.reverses has no effect without"),
        ({"robot": {"reverses": False, "turn_radius_m": 0.5}}, ""),
        (
            {"planner": {"line": "cells"}, "robot": {"turn_radius_m": 0.5}},
            "no effect where planner.line is cells: robot.turn_radius_m",
        ),
        ({"robot": {"clearance_m": 0.05}}, ""),
        ({"robot": {"clearance_m": 0.07}}, "is more than a fifth of robot.tool_width_m, 0.06"),
        (
            {"mission": {"keep_out": [SQUARE], "dock": {"x_m": 1.5, "y_m": 3.0}}},
            "",  # the place before it is half a metre west
        ),
        (
            {"mission": {"keep_out": [SQUARE], "dock": {"x_m": 4.5, "y_m": 3.0}}},
            "mission.keep_out[0] lies at mission.dock: the robot may not stand at the place",
        ),
        (
            {"mission": {"keep_out": [SQUARE], "home": {"x_m": 4.1, "y_m": 3.0}}},
            "mission.keep_out[0] lies at mission.home",
        ),
    ],
)
def test_settings_that_conflict_give_a_caution(sections, text):
    found = said(**sections)
    assert [text in one for one in found] == ([True] if text else [])


def test_the_defaults_and_a_tool_as_wide_as_the_robot_pass():
    assert said() == []
    assert said(robot={"radius_m": 0.3, "tool_width_m": 0.6}) == []


def test_the_warning_uses_the_clearance_share_of_the_lines():
    assert NEAR_SHARE == line.NEAR_SHARE


def test_near_a_polygon_is_inside_or_within_reach():
    square = tuple(map(tuple, SQUARE))
    assert is_near(square, (3.0, 3.0), 0.0)
    assert is_near(square, (1.9, 3.0), 0.11)
    assert not is_near(square, (1.9, 3.0), 0.09)
    assert is_near(square, (4.07, 4.07), 0.1)
    assert not is_near(square, (4.08, 4.08), 0.1)


def test_check_config_doctor_and_plan_say_so(tmp_path):
    file = tmp_path / "wide.yaml"
    file.write_text(yaml.safe_dump(WIDE))
    checked = fasaco_edge("check-config", file)
    assert (checked.code, "the tool sticks 0.12 m out" in checked.out) == (0, True)
    shown = json.loads(fasaco_edge("check-config", file, "--json").out)
    assert (shown["ok"], len(shown["cautions"])) == (True, 1)
    name, finding = next(iter(findings(file, checks=())))
    assert (name, finding.level) == ("configuration", Level.WARN)
    assert "the tool sticks 0.12 m out" in finding.to_do
    planned = fasaco_edge("plan", "flat", "--config", file, "--budget", "0.1")
    assert "the tool sticks 0.12 m out" in planned.err
