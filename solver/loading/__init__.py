"""A loading history walked in increments: each one solved, cut where it fails, branched from."""
