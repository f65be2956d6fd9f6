"""A refinement: runs only where the numbers of a study are not as expected."""
