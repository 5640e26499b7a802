"""What happened in a recorded mission: figures, pictures, and two missions side by side."""
