"""A minimum: the parameters at which a number of the runs is least, under conditions."""
