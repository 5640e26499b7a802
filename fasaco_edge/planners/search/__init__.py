"""Planner of missions: a search by colony and local search, and repair of a walk."""
