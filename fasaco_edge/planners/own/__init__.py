"""Planners of the user's own: loading, input, and the check of the walk."""
