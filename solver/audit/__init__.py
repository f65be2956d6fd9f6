"""Checks of a solution, computed independently of the solver.

`plain` evaluates bodies without the solver's operators, `surfaces` measures contact on the
deformed bodies; `bodies`, `pairs` and `links` compute the figures from these, and
`report` compares them with their limits. The audit reads states and declarations.

It takes from the solver, without a check, meshes, supports, the edges of contact surfaces, and the
displacements of condensed bodies.
"""
