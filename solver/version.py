"""The version of the project, where every module can read it."""

__version__ = "0.1.0"
