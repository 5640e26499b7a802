"""Checks of a computer, its bus and a configuration: ``fasaco-edge doctor``."""
