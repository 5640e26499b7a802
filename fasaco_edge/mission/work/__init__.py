"""Work of an order: the cells left, the part that comes next, and the end of the order."""
