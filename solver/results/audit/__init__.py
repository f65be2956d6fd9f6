"""Checks of a solution, computed independently of the solver.

`plain` evaluates bodies without the solver's operators, `law` repeats an increment in smaller
steps, `surfaces` measures contact on the deformed bodies; `bodies`, `pairs` and `forces` compute
the figures from these, and `report` compares them with their limits. `stored` and `named` compare
the stored results of a run with values that `values`, `tractions` and `sources` compute again.
Taken from the solver without a check are meshes, supports, the edges of contact surfaces, and the
displacements of condensed bodies.
"""
