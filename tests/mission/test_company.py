"""A robot alone: its mission loads nothing of a fleet, and keeps what a fleet has told it."""

import subprocess
import sys

import pytest

from fasaco_edge.mission.company import Company
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.coverage.others_cells import OthersCells
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


@pytest.mark.parametrize("forgets", ["record_forgotten", "clear", "reset"])
def test_cells_of_others_are_kept_until_this_robot_forgets_cells(forgets):
    ledger = MissionLedger(0.3, 0.3)
    ledger.shared.restore(b"of a fleet")
    assert ledger.snapshot().fleet == b"of a fleet"
    assert isinstance(ledger.shared, OthersCells)
    getattr(ledger.shared, forgets)()
    assert ledger.snapshot().fleet == b""
