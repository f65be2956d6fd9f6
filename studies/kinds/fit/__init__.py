"""A fit: the values of parameters with which runs come closest to what was measured."""
