"""Studies over HTTP: submit, watch, and fetch results."""
