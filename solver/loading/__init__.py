"""A loading history, solved in increments; an increment that fails is halved."""
