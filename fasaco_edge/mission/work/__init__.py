"""Work of an order: what is left of it, which part comes next, and how it ends."""
