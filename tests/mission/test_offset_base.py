"""What a mission claims to be swept by a base that drives beside its line."""

from __future__ import annotations

import pytest

from fasaco_edge.mission.core.events import State
from tests.mission.offset_base import bare_room, driven

# The most that a claim may be above the truth.
CLAIM = 0.02


@pytest.mark.parametrize("left_m", [0.05, 0.12])
def test_floor_beside_a_base_that_drives_beside_its_line_is_not_called_swept(left_m):
    outcome = driven(bare_room(), left_m=left_m)
    assert outcome.mission.state is State.DONE
    assert outcome.claimed <= outcome.swept + CLAIM
    assert outcome.claimed <= outcome.known + CLAIM


@pytest.mark.parametrize("at", [(0.0, 0.0), (0.013, 0.0088)])
def test_strips_in_which_only_the_rasters_differ_are_not_driven_to(at):
    outcome = driven(bare_room(*at))
    assert outcome.mission.state is State.DONE
    assert outcome.swept > 0.995
    assert outcome.seconds < 120.0
    assert abs(outcome.claimed - outcome.known) < 0.005
