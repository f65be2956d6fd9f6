"""Loading walked in increments: each one solved, cut where it fails, repeated to the end."""
