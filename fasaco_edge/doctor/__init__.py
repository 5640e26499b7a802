"""What ``fasaco-edge doctor`` looks at: each check one function, all in ``table.CHECKS``."""
