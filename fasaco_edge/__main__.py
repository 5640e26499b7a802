"""``python -m fasaco_edge``."""

from fasaco_edge.cli import program

program()
