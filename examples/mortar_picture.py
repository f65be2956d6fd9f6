"""Draw the gap between two meshes under the hat function of one vertex; check it by sampling.

Run it with ``python examples/mortar_picture.py``; it writes ``mortar.png``. Units are mm.
"""

import numpy as np
from matplotlib.figure import Figure

from solver import Body, ContactPair, Material, Model
from solver.contact.geometry import end_normals, pair
from solver.contact.system import System
from solver.mesh import grid

STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3)
VERTEX = 3


def block(name, x, y, bent, held):
    """Return a block of linear elements, bent along a parabola."""
    mesh = grid(x, y)
    mesh = type(mesh)(mesh.p + np.array([[0.0], [bent]]) * mesh.p[0] ** 2, mesh.t, mesh.boundaries)
    return Body(name=name, mesh=mesh, material=STEEL, element="quad4", supports={held: "xy"})


above = block("above", np.linspace(-3, 3, 6), np.linspace(0.5, 1.7, 3), 0.12, "top")
below = block("below", np.linspace(-4, 4, 10), np.linspace(-1.2, 0, 3), -0.02, "bottom")
contact = ContactPair(slave=("above", "bottom"), master=("below", "top"), sliding="finite")
(interface,) = System(Model(bodies=(above, below), contacts=(contact,))).interfaces
slave, master = interface.slave_surface, interface.master_surface
found = pair(slave, np.zeros_like(slave.X), master, np.zeros_like(master.X))

# Sample the two edges at the vertex, and project each point along the normal on the master.
start, end = end_normals(slave.X, slave)[..., VERTEX - 1 : VERTEX + 1].transpose(1, 0, 2)
corners = slave.X[:, slave.vertices[VERTEX - 1 : VERTEX + 2]]
share = (np.arange(400) + 0.5) / 400
points, feet, hats = [], [], []
profile = master.X[:, master.vertices]
profile = profile[:, np.argsort(profile[0])]
for edge in (0, 1):
    point = corners[:, edge, None] * (1 - share) + corners[:, edge + 1, None] * share
    normal = start[:, edge, None] * (1 - share) + end[:, edge, None] * share
    normal /= np.linalg.norm(normal, axis=0)
    distance = point[1].copy()
    for _ in range(50):  # until the foot lies on the master
        foot = point + distance * normal
        distance += foot[1] - np.interp(foot[0], *profile)
    points.append(point), feet.append(point + distance * normal)
    hats.append(share if edge == 0 else 1 - share)
point, foot, hat = np.hstack(points), np.hstack(feet), np.concatenate(hats)
lengths = np.repeat(np.linalg.norm(np.diff(corners), axis=0), len(share))
gap = np.average(np.linalg.norm(foot - point, axis=0), weights=hat * lengths)
print(f"mean gap under the hat: {gap:.5f} mm by sampling, {found.gap[VERTEX]:.5f} mm by segments")
assert np.isclose(gap, found.gap[VERTEX], rtol=1e-4)

figure = Figure(figsize=(7, 4.4), layout="constrained")
axes = figure.add_subplot(aspect="equal", xlabel="$x$ [mm]", ylabel="$y$ [mm]")
for body in (above, below):
    for ends in body.mesh.p[:, body.mesh.facets].transpose(2, 0, 1):
        axes.plot(*ends, color="0.75", linewidth=0.8)
axes.fill(*np.hstack([point, foot[:, ::-1]]), color="tab:blue", alpha=0.25, label="gap")
axes.plot(*(point + np.stack([0 * hat, 0.5 * hat])), color="tab:red", label="hat of a vertex")
for k in range(0, len(hat), 80):
    axes.plot(*np.stack([point[:, k], foot[:, k]], axis=1), color="tab:blue", linewidth=0.8)
axes.plot(*slave.X[:, slave.vertices], "o-", color="black", label="slave")
axes.plot(*profile, "s-", color="0.4", label="master")
axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, fontsize=8, frameon=False)
figure.savefig("mortar.png", dpi=150)
