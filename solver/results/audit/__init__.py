"""Checks of a solution by other means than those that solved it.

Taken from the solver without a check: meshes, supports, the chains of edges of contact surfaces,
the displacements of condensed bodies. `plain` evaluates bodies without the solver's operators,
`law` repeats an increment in smaller steps, `surfaces` measures contact on the deformed bodies;
`bodies`, `pairs` and `forces` make figures of these, and `report` compares them with their limits.
`stored` and `named` compare what a run stores with values that `values`, `tractions` and `sources`
compute anew.
"""
