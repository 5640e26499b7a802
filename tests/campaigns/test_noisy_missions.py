"""Some of the missions under noise, and that the judge of them sees what does not hold."""

from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.follow.estimate import VelocityCommand

pytest.importorskip("scipy", reason="needs the extra 'lab'")

from tests.campaigns.lab.halls import hall
from tests.campaigns.lab.judge import Ending
from tests.campaigns.lab.known_floor import FloorAccount
from tests.campaigns.lab.mission import COLUMNS, Trace, run_mission
from tests.campaigns.lab.own import OwnBase
from tests.campaigns.lab.settings import LabSettings
from tests.campaigns.noisy_missions import NoisyMission, building_of, outcome_of, stayed_s


@pytest.mark.parametrize(
    "mission",
    [
        NoisyMission("small", "usual", 0.03),
        NoisyMission("small", "late", pose_hz=5.0, seed=2),
        NoisyMission("small", "jumps", 0.03, seed=3),
        NoisyMission("small", "drift", 0.03, pose_hz=1.0, seed=2),
    ],
    ids=str,
)
def test_missions_under_noise_have_no_faults(mission):
    found = outcome_of(mission)
    assert not found.faults
    assert found.figures.pose_error_median_m > 0.004
    assert found.figures.state == "done"
    # Other claims, and other endings, would be faults.
    for wrong in (
        replace(found, account=replace(found.account, claimed=found.account.claimed + 0.05)),
        replace(found, account=replace(found.account, closed=0.05 + found.account.told_closed)),
        replace(found, figures=replace(found.figures, ending=Ending.LIMIT)),
        replace(found, figures=replace(found.figures, claimed_share=1.06)),
        replace(found, stayed_s=21.0),
    ):
        assert len(wrong.faults) == 1


def test_a_wait_that_is_announced_is_no_stay():
    trace = Trace(states=[(0.0, "covering", "", ""), (10.0, "blocked", "tried again", "")])
    for now in range(50):
        row = dict.fromkeys(COLUMNS, 0.0) | {"t": float(now), "x": 0.2 * min(now, 5)}
        trace.rows.append(tuple(row.values()))
    assert stayed_s(trace) == 4.0
    trace.states[1] = (10.0, "covering", "", "")
    assert stayed_s(trace) == 44.0


def test_a_mission_under_noise_is_had_again_bit_for_bit():
    settings = LabSettings(seed=3, own="rough", seconds=12.0)
    digests = [run_mission(building_of("small"), settings).trace.digest() for _ in range(2)]
    other = run_mission(building_of("small"), replace(settings, seed=4))
    assert digests[0] == digests[1] != other.trace.digest()


def test_the_scans_of_its_base_are_those_of_a_lidar():
    base = OwnBase(hall(4.0, 1.0), LabSettings(own="usual", noise_m=0.01))
    ranges = base.scan()
    # Behind, to the right, ahead, to the left, of 0.5, 0.5; walls begin a pixel off.
    assert ranges[[0, 60, 120, 180, 240]] == pytest.approx([0.5, 0.5, 3.5, 0.5, 0.5], abs=0.05)
    assert np.abs(ranges[[0, 60, 120, 180]] - [0.5, 0.5, 3.5, 0.5]).max() > 0.0005
    base.command(VelocityCommand(0.2, 0.0))
    for _ in range(40):
        base.tick()
    assert base.scan()[120] < ranges[120] - 0.05
    assert base.pose != base.truth


def test_an_account_is_of_shares():
    floor = FloorAccount(ever=4.0, closed=0.5, swept=3.0, claimed=3.1, told_closed=0.3)
    assert floor.overclaimed == pytest.approx(0.025)
    assert floor.untold == pytest.approx(0.05)
