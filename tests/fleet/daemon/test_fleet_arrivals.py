"""Many robots, fleets and strangers on one bus: whom a robot hears of its own fleet."""

from __future__ import annotations

import json

import pytest

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.fleet.daemon.exchange import FORGOTTEN_S, LEAST_SPACING_S, FleetArrivals
from fasaco_edge.fleet.mission.frames import MOST_OTHERS
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.limits import MAX_JSON_BYTES


def from_robot(robot, fleet="hall"):
    payload = json.dumps({"version": 1, "fleet": fleet}).encode()
    return Sample(f"fasaco/@v1/{robot}/fleet", payload)


def garbage(robot, payload=b"x"):
    return Sample(f"fasaco/@v1/{robot}/fleet", payload)


@pytest.fixture
def arrivals():
    return FleetArrivals(Keys("me"), "hall")


def test_a_robot_that_floods_is_received_at_its_rate(arrivals):
    mate = from_robot("r2")
    taken = [at for at in range(1000) if arrivals.is_due(mate, 0.001 * at)]
    assert len(taken) == 1 / LEAST_SPACING_S


@pytest.mark.parametrize("stranger", [lambda name: from_robot(name, "yard"), garbage])
def test_messages_of_the_own_fleet_arrive_on_a_crowded_bus(arrivals, stranger):
    """The 64 places went to whoever was heard first: with a second fleet of 64 to nobody else."""
    heard = 0
    for second in range(100):
        for number in range(2 * MOST_OTHERS):
            arrivals.is_due(stranger(f"other{number}"), float(second))
        heard += arrivals.is_due(from_robot("r2"), second + 0.5)
    assert heard == 100
    assert arrivals.take_faults() == []


@pytest.mark.parametrize("robot", ["me", "*", "r$*"])
def test_messages_in_this_robots_name_are_dropped(arrivals, robot):
    assert not arrivals.is_due(from_robot(robot), 0.0)


def test_messages_of_other_fleets_are_dropped(arrivals):
    assert not any(arrivals.is_due(from_robot("other", "yard"), float(at)) for at in range(9))


def test_an_unreadable_fleet_message_is_a_fault_with_a_limit(arrivals):
    payloads = [b"x", b" " * (MAX_JSON_BYTES + 1), b"[" * 5000, b'{"version": 1}', b"\xff"]
    assert [arrivals.is_due(garbage(f"g{at}", of), at) for at, of in enumerate(payloads)] == (
        [True] * len(payloads)
    )
    passed = [arrivals.is_due(garbage(f"g{number}"), 10.0) for number in range(1000)]
    assert sum(passed) == 1
    # One of the fleet that breaks keeps its place.
    assert arrivals.is_due(from_robot("r2"), 20.0)
    assert arrivals.is_due(garbage("g1"), 20.0)
    assert arrivals.is_due(garbage("r2"), 20.0 + LEAST_SPACING_S)


def test_a_robot_too_many_is_reported_once(arrivals):
    for second in range(3):
        for number in range(MOST_OTHERS):
            assert arrivals.is_due(from_robot(f"r{number}"), float(second))
        assert not arrivals.is_due(from_robot("late"), float(second))
    (fault,) = arrivals.take_faults()
    assert str(fault) == "late: at most 64 others of fleet 'hall' are kept"
    for number in range(1, MOST_OTHERS):
        arrivals.is_due(from_robot(f"r{number}"), FORGOTTEN_S)
    # There is room once one is silent.
    assert arrivals.is_due(from_robot("late"), FORGOTTEN_S + 2.0)
    assert arrivals.take_faults() == []
