"""Coverage: which cells and floor are covered, kept through loop closures and restarts."""
