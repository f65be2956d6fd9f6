"""Stress intensities at the tips of cracks.

Laws, elements and contact know nothing of it: a crack is two boundaries of a body, and its tips
differ from other places by the positions of nodes alone (`solver.mesh.opened`).
"""
