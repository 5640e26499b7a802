"""Report of a recorded fleet: its figures, its text and its picture."""
