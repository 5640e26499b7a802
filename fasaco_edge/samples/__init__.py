"""Samples of the bus as bytes: the file format of recorded inputs."""
