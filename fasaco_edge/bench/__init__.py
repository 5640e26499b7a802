"""Benchmarks of the planners and of the daemon, for ``fasaco-edge bench``."""
