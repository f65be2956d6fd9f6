"""Scenes in which something rolls."""
