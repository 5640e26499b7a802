"""A colony's configuration fails loudly: the key and the value are in the message."""

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.planners.paper.colony import ColonyConfig, parse_velocities


@pytest.mark.parametrize(
    ("given_values", "message"),
    [
        ({"velocities": ()}, "velocities: must name at least one, got ()"),
        ({"velocities": (4, 0)}, "velocities: must be in 1..64, got 0"),
        ({"ants": 7}, "ants: must be in 8..1000000, one for each cohort at least, got 7"),
        ({"ants": 1_000_001}, "ants: must be in 8..1000000, .* got 1000001"),
        ({"q0": 1.5}, r"q0: must be in \[0, 1\], got 1.5"),
        ({"q0": float("nan")}, r"q0: must be in \[0, 1\], got nan"),
        ({"alpha": 0.0}, r"alpha: must be in \(0, 1\], got 0.0"),
        ({"alpha": 1.1}, r"alpha: must be in \(0, 1\], got 1.1"),
        ({"tau0": 0.0}, r"tau0: must be in \[1e-12, 1e6\], got 0.0"),
        ({"tau0": float("inf")}, r"tau0: must be in \[1e-12, 1e6\], got inf"),
        ({"visibility": "far"}, "visibility: must be one of neighbour, .*, got 'far'"),
        ({"beta": -1.0}, r"beta: must be in \[0, 10\], got -1.0"),
        ({"seed": -1}, r"seed: must be in 0..2\^63 - 1, got -1"),
        ({"seed": 2**63}, r"seed: must be in 0..2\^63 - 1, got 9223372036854775808"),
    ],
    ids=str,
)
def test_an_impossible_value_is_named_with_its_key(given_values, message):
    with pytest.raises(BadConfiguration, match=message.replace("()", r"\(\)")) as caught:
        ColonyConfig(**given_values)
    assert caught.value.code == "bad_configuration"


def test_the_defaults_are_the_paper_s_third_group():
    config = ColonyConfig()
    assert (config.ants, config.velocities, config.q0) == (1000, (8, 7, 6, 5, 4, 3, 2, 1), 0.7)
    with pytest.raises(dataclasses.FrozenInstanceError):
        config.ants = 3


@given(st.integers(1, 1000), st.lists(st.integers(1, 64), min_size=1, max_size=30))
def test_cohorts_share_the_ants(ants, velocities):
    config = ColonyConfig(max(ants, len(velocities)), tuple(velocities))
    cohorts = config.cohorts()
    assert [cohort.velocity for cohort in cohorts] == velocities
    sizes = [cohort.ants for cohort in cohorts]
    assert sum(sizes) == config.ants
    assert max(sizes) - min(sizes) <= 1


@pytest.mark.parametrize(
    ("text", "velocities"),
    [
        ("8:1", (8, 7, 6, 5, 4, 3, 2, 1)),
        ("1:8", (1, 2, 3, 4, 5, 6, 7, 8)),
        ("4", (4,)),
        ("4:4", (4,)),
        ("8,4,1", (8, 4, 1)),
        (" 3 , 2 ", (3, 2)),
    ],
)
def test_velocities_from_text(text, velocities):
    assert parse_velocities(text) == velocities


@pytest.mark.parametrize(
    "text", ["", ":", "8,4:1", "8:4,1", "fast", "8:", "8:4:1", "1.5", "3,", "4;2"]
)
def test_a_text_that_names_no_velocities_is_quoted(text):
    with pytest.raises(BadConfiguration) as caught:
        parse_velocities(text)
    assert str(caught.value) == f"velocities: must look like 8:1, 1:8, 4 or 8,4,1, got {text!r}"


@pytest.mark.parametrize("text", ["0", "0:8", "8:0", "-1:3", "1:65", "8,65,1", "1:10000000000"])
def test_velocities_out_of_range_are_refused(text):
    with pytest.raises(BadConfiguration, match=r"velocities: must be in 1\.\.64, got"):
        parse_velocities(text)
