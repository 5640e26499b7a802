"""Planners of the user's own: how one is loaded, what it is given, how its walk is checked."""
