"""The command ``residua``: it computes studies, shows their results, and starts the service."""
