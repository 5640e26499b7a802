"""A robot alone: its mission loads nothing of a fleet, and keeps what a fleet has told it."""

import subprocess
import sys

import numpy as np
import pytest

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.mission.company import Company
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.coverage.loop_closure import Motion
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from tests.mission.world import CONFIG

LOADED = """
import sys
from fasaco_edge.mission.core.mission import Mission
from tests.mission.world import CONFIG
Mission(CONFIG)
print(*(name for name in sys.modules if name.startswith("fasaco_edge") and "fleet" in name))
"""


def test_the_mission_of_one_robot_loads_nothing_of_a_fleet():
    run = subprocess.run([sys.executable, "-c", LOADED], capture_output=True, text=True, check=True)
    assert run.stdout == "\n"


def test_a_single_robot_has_no_company():
    assert type(Mission(CONFIG).company) is Company


FORGETS = {
    "a cell": lambda ledger: ledger.open_again([]),
    "cells": lambda ledger: ledger.forget(lambda window, _: np.ones((window.rows, window.cols))),
    "all": lambda ledger: ledger.reset("map"),
    "another frame": lambda ledger: ledger.move_to("other"),
    "another building": lambda ledger: ledger.begin_elsewhere("map"),
    "a moved map": lambda ledger: ledger.forget_uncertain(Motion(Pose2D(0, 0), Pose2D(1, 0))),
}


@pytest.mark.parametrize("forgets", FORGETS)
def test_cells_of_others_are_kept_until_this_robot_forgets_cells(forgets):
    ledger = MissionLedger(0.3, 0.3)
    ledger.move_to("map")
    ledger.shared.restore(b"of a fleet")
    assert ledger.snapshot().fleet == b"of a fleet"
    FORGETS[forgets](ledger)
    assert ledger.snapshot().fleet == b""
