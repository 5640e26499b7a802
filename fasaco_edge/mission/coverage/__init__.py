"""Coverage: what has been covered, progress, and what stays uncovered."""
