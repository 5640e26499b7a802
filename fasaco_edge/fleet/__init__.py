"""Wing of fleets: several robots that share one area. A robot alone needs nothing of it."""
