"""Checks of a solution, computed independently of the solver.

`plain` evaluates bodies without the solver's operators, `surfaces` measures contact on the
deformed bodies; `bodies`, `pairs`, `links` and `forces` compute the figures from these, and
`report` compares them with their limits. `steady` and `prism` check passes, whose material `flow`
follows. The audit reads states and declarations, and no code of `results`.

Taken from the solver without a check are meshes, supports, the edges of contact surfaces, and the
displacements of condensed bodies.
"""
