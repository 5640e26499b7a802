"""Coverage path planning with fast-spanning ant colonies, for the small computer on a robot."""

__version__ = "0.1.0"
