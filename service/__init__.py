"""Studies over HTTP: submit, watch, and fetch what they found."""
