"""A goal: the value of a parameter at which a number of the runs passes a threshold."""
