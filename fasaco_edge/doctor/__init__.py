"""Checks of a computer, its bus and a configuration, for ``fasaco-edge doctor``."""
