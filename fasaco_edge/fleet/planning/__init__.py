"""Planners for fleets: one walk for each of several robots that share a ground."""
