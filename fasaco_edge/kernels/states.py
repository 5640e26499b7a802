"""What is known of a cell of the lattice. Free of the compiler, for those who only read maps."""

UNKNOWN, BLOCKED, COVERABLE = 0, 1, 2
