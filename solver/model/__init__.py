"""Declarations of the user: bodies, loads, motions, contact pairs, links, and the model."""
