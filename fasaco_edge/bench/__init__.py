"""Benchmarks of the planner and the daemon: a file each, and one table of them."""
