"""Pictures of maps, walks, pheromone and finished missions, drawn with Pillow."""
