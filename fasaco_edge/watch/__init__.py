"""Live view of a mission in a terminal: samples from the bus in, lines of text out."""
