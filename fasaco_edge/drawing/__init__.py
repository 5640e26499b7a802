"""Values to pictures: maps, walks and finished missions, drawn with Pillow."""

from fasaco_edge.drawing.mission import draw_mission
from fasaco_edge.drawing.walk import draw_walk

__all__ = ["draw_mission", "draw_walk"]
