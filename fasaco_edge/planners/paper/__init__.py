"""Planners of Carr and Wang 2022: the colony, and the baselines it is compared with."""
