"""Fleet as an observer sees it: its robots, their cells and shares, from their messages."""
