"""Steady passes in space: a load rolls over a prism, solved in the frame of the load.

x points along the prism, the load moves along +x; y points up and z across, x, y, z right-handed.
Stations lie downstream of the first one, ``x_c = x_0 - c h``.
"""
