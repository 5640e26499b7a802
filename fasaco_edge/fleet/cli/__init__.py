"""Commands of a fleet: orders to all, a report of all."""
