"""Elastic-plastic bodies in frictional contact, and the residual stress they keep."""

__version__ = "0.1.0"
