"""Read, print and draw results."""
