"""Commands of a fleet: plans for several robots, orders to all, a report of all."""
