"""Core of the mission: events in, decisions out."""
