"""The campaign of batteries: a mission that has to charge."""

from tests.campaigns.batteries import CHARGES, charge


def test_a_mission_of_three_charges_completes_and_is_never_empty():
    one = charge(cells=1000, seed=2)
    assert one.is_complete
    assert one.charges >= CHARGES
    assert one.lowest > 0.05
    assert one.way_s < one.bound_s < one.took_s < 1.25 * one.bound_s
