"""Define a model, a pad pressed on a plate and released; check and draw the result.

Run it with ``python examples/own_model.py``; it writes ``own_model.png``. Units are N, mm, MPa;
tension is positive.
"""

import numpy as np
from matplotlib.figure import Figure
from skfem import MeshQuad

from solver import Body, ContactPair, Material, Model, solve

# The material yields at 350 MPa and then hardens: beyond yield its curve in tension has 2.4 % of
# its elastic slope.
steel = Material(
    youngs_modulus=2e5,
    poisson_ratio=0.3,
    yield_stress=350.0,
    hardening="isotropic",
    hardening_ratio=0.024,
)

# A mesh is any scikit-fem mesh of quadrilaterals or triangles with named boundaries. `MeshFile` of
# studies.scenes.meshfile reads files of gmsh, Abaqus and others. Here x = 0 is a line of symmetry,
# so half of each body is enough.
pad_mesh = MeshQuad.init_tensor(np.linspace(0, 10, 21), np.linspace(0, 10, 11)).with_boundaries(
    {"axis": lambda x: x[0] == 0, "foot": lambda x: x[1] == 0, "top": lambda x: x[1] == 10}
)
plate_mesh = MeshQuad.init_tensor(np.linspace(0, 30, 31), np.linspace(-20, 0, 21)).with_boundaries(
    {"axis": lambda x: x[0] == 0, "base": lambda x: x[1] == -20, "top": lambda x: x[1] == 0}
)

# A support names the components of displacement that are zero on a boundary. The pad has no support
# along y: contact holds it.
pad = Body(
    name="pad",
    mesh=pad_mesh,
    material=steel,
    supports={"axis": "x"},
    pressure={"top": 450.0},  # at load factor 1, positive in compression
)
plate = Body(name="plate", mesh=plate_mesh, material=steel, supports={"axis": "x", "base": "y"})

# The slave is the body whose surface ends at a corner: here the pad.
contact = ContactPair(slave=("pad", "foot"), master=("plate", "top"), friction=0.3)
model = Model(bodies=(pad, plate), contacts=(contact,))

# `solve` increases the load in increments, removes it, separates the bodies, and returns the states
# under load and after unloading. If it fails, it raises LimitLoad or NotConverged.
solution = solve(model)

# The audit checks the result by independent means.
audit = solution.audit()
assert audit.passed, audit.violations

# Under load contact carries the force on the pad: 450 MPa on 10 mm, per mm of thickness.
acting = solution.contact()
where, pressure, shear = acting.X, acting.pressure, acting.shear
order = np.argsort(where[0])
force = np.trapezoid(pressure[order], where[0, order])
assert np.isclose(force, 450.0 * 10.0, rtol=0.01), force

# Residual stress at the nodes: components xx, yy, zz, xy.
x, y = solution.nodes("plate")
along_x = solution.stress("plate")[0]
print(f"the contact carried {force:.0f} N per mm")
print(f"residual stress along x: {along_x.min():.0f} to {along_x.max():.0f} MPa")
assert along_x.min() < -10.0, "the plate has yielded, and keeps compression"
assert along_x.max() > 10.0, "and tension"

# Draw it along the surface of the plate.
top = np.flatnonzero(np.isclose(y, 0.0))
top = top[np.argsort(x[top])]
figure = Figure(figsize=(6, 3.5), layout="constrained")
axes = figure.add_subplot(xlabel="x [mm]", ylabel="residual stress xx [MPa]")
axes.axhline(0.0, color="0.7", linewidth=0.8)
axes.plot(x[top], along_x[top], label="surface of the plate")
axes.axvline(10.0, color="0.7", linestyle=":", label="edge of the pad")
axes.legend()
figure.savefig("own_model.png", dpi=150)
