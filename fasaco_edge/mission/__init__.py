"""What is covered, what changed, when to replan: events in, decisions out."""
