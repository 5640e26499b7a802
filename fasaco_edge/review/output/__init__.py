"""Output formats of a review: rows, tables, charts, pictures."""
