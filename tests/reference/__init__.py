"""Solutions that the solver is measured against, and that know nothing of it: numpy and scipy only.

Each module is one problem; each has a test of its own that proves it.
"""
