"""The review of a recorded mission: figures, pictures, comparison of two missions."""
