"""The execution of a study: its missing runs are computed in parallel."""
