"""What a review is shown and written as: rows, tables, charts, pictures, an HTML page."""
