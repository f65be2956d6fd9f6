"""The command ``residua``."""
