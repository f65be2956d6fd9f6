"""Figures: maps and lines of one run, numbers of all runs over the sweep."""
