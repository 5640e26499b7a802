"""A live mission in a terminal: samples off the bus in, lines of text out."""
