"""Derivatives of results by parameters, through plasticity, contact and friction."""
