"""Steady passes: rolling on a track without ends, solved in the frame of the load.

A long track under a constant load is steady in the frame of the load. There are no increments:
material flows along rows of integration points through a fixed mesh, and each pass is the solution
of one nonlinear system. Before and after a pass the state is a function of depth alone.
"""
