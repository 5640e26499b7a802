"""One walk for each of several robots that share a ground."""
