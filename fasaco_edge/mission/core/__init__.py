"""The mission itself: events in, decisions out."""
