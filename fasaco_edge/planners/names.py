"""The planners' names, for those who only ask which there are: the table brings the compiler."""

PLANNER_NAMES = ("fasaco", "aco", "stc", "spiral-stc", "zigzag")
