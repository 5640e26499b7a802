"""Output formats of a review: rows, tables, charts, pictures, an HTML page."""
