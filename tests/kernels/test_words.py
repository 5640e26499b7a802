"""Words lead to their goals, and no other way of arcs and straights is shorter."""

import math

import numpy as np
import pytest

from fasaco_edge.kernels.floor import words
from fasaco_edge.kernels.floor.words import MOST_WORDS, PIECES
from tests.support.inner import entry

find_words = entry(words.find_words)

GOALS = np.random.default_rng(0).uniform((-4, -4, -math.pi), (4, 4, math.pi), (400, 3)).tolist()
STRAIGHT_AHEAD = [(2.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 2.0, math.pi), (0.0, 4.0, math.pi)]


def words_to(goal, *, reverses):
    """Sides and lengths of all words, both (n, 5)."""
    sides, lengths = np.zeros((MOST_WORDS, PIECES), np.int8), np.zeros((MOST_WORDS, PIECES))
    count = find_words(*goal, reverses, sides, lengths)
    return sides[:count], lengths[:count]


def shortest(goal, *, reverses):
    return np.abs(words_to(goal, reverses=reverses)[1]).sum(axis=1).min()


def end_of(sides, lengths):
    """The pose after a word, by small steps of the car's equations of motion."""
    x = y = yaw = 0.0
    for side, length in zip(sides, lengths, strict=True):
        centre_x, centre_y = x - side * math.sin(yaw), y + side * math.cos(yaw)
        if side:
            yaw += side * length
            x, y = centre_x + side * math.sin(yaw), centre_y - side * math.cos(yaw)
        else:
            x, y = x + length * math.cos(yaw), y + length * math.sin(yaw)
    return x, y, yaw


@pytest.mark.parametrize("reverses", [False, True])
@pytest.mark.parametrize("goal", [*STRAIGHT_AHEAD, *GOALS[:60]])
def test_each_word_ends_at_its_goal(goal, reverses):
    sides, lengths = words_to(goal, reverses=reverses)
    assert len(sides) >= 1
    assert reverses or (lengths >= 0.0).all()
    for word in zip(sides.tolist(), lengths.tolist(), strict=True):
        x, y, yaw = end_of(*word)
        assert (x, y) == pytest.approx(goal[:2], abs=1e-6)
        assert math.remainder(yaw - goal[2], math.tau) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("goal", "ahead", "both"),
    [
        ((2.0, 0.0, 0.0), 2.0, 2.0),
        ((0.0, 2.0, math.pi), math.pi, math.pi),
        ((-1.0, 0.0, 0.0), None, 1.0),
        # Two half circles about as far apart: Dubins' bulb; a turn in three moves.
        ((0.0, 0.0, math.pi), 7.0 / 3.0 * math.pi, math.pi),
        ((4.0, 4.0, math.pi / 2), math.pi / 2 + math.sqrt(18.0), math.pi / 2 + math.sqrt(18.0)),
    ],
)
def test_known_shortest_words_are_found(goal, ahead, both):
    if ahead is not None:
        assert shortest(goal, reverses=False) == pytest.approx(ahead)
    assert shortest(goal, reverses=True) == pytest.approx(both)


@pytest.mark.parametrize("reverses", [False, True])
def test_no_other_way_of_arcs_and_straights_is_shorter(reverses):
    """Random ways: their ends are goals to which there must be a word as short."""
    rng = np.random.default_rng(1)
    for _ in range(3000):
        sides = rng.integers(-1, 2, 6)
        lengths = rng.uniform(-2.0 if reverses else 0.0, 2.0, 6)
        ours = shortest(end_of(sides, lengths), reverses=reverses)
        assert ours <= np.abs(lengths).sum() + 1e-6, (sides, lengths)
