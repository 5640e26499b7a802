"""Values to pictures: maps, walks, pheromone and finished missions, drawn with Pillow."""
