"""Values to pictures: maps, walks, pheromone and finished missions, drawn with Pillow."""

from fasaco_edge.drawing.comparison import LabelledWalk, draw_walks
from fasaco_edge.drawing.mission import draw_mission
from fasaco_edge.drawing.pheromone import draw_pheromone
from fasaco_edge.drawing.walk import draw_walk

__all__ = ["LabelledWalk", "draw_mission", "draw_pheromone", "draw_walk", "draw_walks"]
