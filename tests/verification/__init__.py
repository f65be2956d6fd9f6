"""Closed forms, rates of convergence, and the physics of the named scenes."""
