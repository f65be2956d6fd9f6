"""Solve a loading history in increments; halve an increment that fails."""
