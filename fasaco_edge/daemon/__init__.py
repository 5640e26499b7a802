"""The machine around the mission: configuration, loop, service notification."""
