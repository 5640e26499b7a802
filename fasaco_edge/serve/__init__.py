"""The web page of a mission: it shows samples from the bus in browsers, and sends their orders."""
