"""States as files of other programs: VTU for ParaView."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np

from solver.errors import ModelError
from solver.results.nodal import nodal_fields
from solver.tensors import COMPONENTS

if TYPE_CHECKING:
    from collections.abc import Mapping

    import meshio
    from numpy.typing import NDArray

    from solver.contact.state import Converged
    from solver.contact.system import System

    Array = NDArray[np.float64]

_CELLS = {
    "quad4": "quad",
    "quad8": "quad8",
    "quad9": "quad9",
    "tri3": "triangle",
    "tri6": "triangle6",
}
"""Element -> cell of meshio. Corners, mid-sides and the middle have the same order in both."""


def write_vtu(system: System, states: Mapping[str, Converged], folder: Path) -> Path:
    """Write a .vtu for each stage and the .pvd that holds them together; return the latter.

    All bodies are in one mesh, told apart by the cell field ``body`` (their number). Displacement
    has three components for ParaView's *Warp By Vector*; the names of the components of stress are
    in its own fields ``stress_xx`` and so on. Numbers are in N, mm, MPa.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise ModelError("folder", str(folder), "must be a folder, or not exist yet") from None
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    stages = ElementTree.SubElement(root, "Collection")
    for number, (name, at) in enumerate(states.items()):
        file = folder / f"{number}-{''.join(c if c.isalnum() else '-' for c in name)}.vtu"
        _mesh(system, at).write(file)
        ElementTree.SubElement(
            stages, "DataSet", timestep=repr(float(number)), name=name, file=file.name
        )
    path = folder / "stages.pvd"
    ElementTree.ElementTree(root).write(path, xml_declaration=True, encoding="utf-8")
    return path


def _mesh(system: System, at: Converged) -> meshio.Mesh:
    import meshio  # only who writes needs it

    points, cells, numbers, fields = [], [], [], []
    first = 0
    for number, name in enumerate(system.names):
        whole = system.full(name)
        points.append(np.pad(whole.X.T, ((0, 0), (0, 1))))
        connected = _turned_left(whole.basis.element_dofs.T, whole.X)
        cells.append((_CELLS[whole.body.element], first + connected))
        numbers.append(np.full(len(connected), number))
        fields.append(nodal_fields(system, name, at))
        first += whole.X.shape[1]
    together = {name: np.hstack([each[name] for each in fields]) for name in fields[0]}
    moved, stress = together.pop("displacement"), together.pop("stress")
    return meshio.Mesh(
        np.vstack(points),
        cells,
        point_data={
            "displacement": np.pad(moved.T, ((0, 0), (0, 1))),
            **{f"stress_{c}": values for c, values in zip(COMPONENTS, stress, strict=True)},
            **together,
        },
        cell_data={"body": numbers},
    )


def _turned_left(cells: NDArray[np.int64], X: Array) -> NDArray[np.int64]:
    """Return the nodes of cells (n, k) counterclockwise, as VTK has them."""
    corners = 4 if cells.shape[1] in (4, 8, 9) else 3
    (x, y), ahead = X[:, cells[:, :corners]], np.roll(X[:, cells[:, :corners]], -1, axis=2)
    right = (x * ahead[1] - y * ahead[0]).sum(axis=1) < 0
    order = np.arange(cells.shape[1])
    order[1:corners] = order[1:corners][::-1]
    order[corners : 2 * corners] = order[corners : 2 * corners][::-1]
    return np.where(right[:, None], cells[:, order], cells)
