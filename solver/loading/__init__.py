"""A loading history, walked in increments that are halved where they fail."""
