"""A scene before it is computed: the meshes of its bodies and their surfaces of contact, as SVG."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from solver.results.view import View
from solver.scenes import Scene
from solver.scenes.scene import by_increments

if TYPE_CHECKING:
    from skfem import Mesh

WIDTH, HIGHEST = 640.0, 520.0
"""Width, and largest height, of a picture [px]."""

MOST = 8_000
"""Largest number of elements of a body whose edges are drawn."""

LINE = 40
"""Length of a line of text."""

STYLE = """
text { font: 28px sans-serif; fill: #51606e; }
.body { fill: #e4eff7; stroke: #6f93ad; stroke-width: 0.7; }
.second { fill: #f7ebdc; stroke: #b39a78; }
.fine { stroke: none; }
.contact { fill: none; stroke: #c2543a; stroke-width: 2.6; stroke-linecap: round; }
.middle { stroke: #51606e; stroke-dasharray: 9 3 2 3; }
@media (prefers-color-scheme: dark) {
  text { fill: #9fb0be; } .middle { stroke: #9fb0be; }
  .body { fill: #1a3346; stroke: #6d9cc0; } .second { fill: #3a2e17; stroke: #a98d5e; }
  .contact { stroke: #f09a80; }
}
"""

Array = NDArray[np.float64]


def scene_svg(scene: Scene, parameters: Any) -> str:
    """Return a picture of what the maps of a scene show, with the meshes before loading.

    A scene without a model of meshes in a plane has a sentence instead.
    """
    own_path = type(scene).path is not Scene.path
    if own_path or (scene.method and scene.method(parameters) is not by_increments):
        return sentence("These runs are computed by a method of their own: no mesh is drawn.")
    model = scene.model(parameters)
    meshes = {body.name: body.mesh for body in model.bodies}
    if not meshes or any(mesh.p.shape[0] != 2 for mesh in meshes.values()):
        return sentence("The bodies of this scene are not in a plane: their mesh is not drawn.")
    view = scene.view(parameters)
    frame = _Sheet.of(view, meshes)
    surfaces: dict[str, set[str]] = {name: set() for name in meshes}
    for pair in model.contacts:
        for body, boundary in (pair.slave, pair.master):
            if body in surfaces:
                surfaces[body].add(boundary)
    parts = [
        part
        for k, (name, mesh) in enumerate(meshes.items())
        for part in _body(mesh, sorted(surfaces[name]), frame, k)
    ]
    content = "".join(parts)
    if view.symmetric:
        x = frame.at(np.zeros((2, 1)))[0, 0]
        content = (
            f'<g id="half">{content}</g><use href="#half" '
            f'transform="matrix(-1 0 0 1 {2 * x:.1f} 0)"/>'
            f'<line class="middle" x1="{x:.1f}" y1="0" x2="{x:.1f}" y2="{frame.height}"/>'
        )
    elements = sum(mesh.t.shape[1] for mesh in meshes.values())
    title = f"Mesh of {elements} elements: {', '.join(meshes)}"
    return _svg(frame.height, title, content)


def sentence(words: str) -> str:
    """Return a picture that says something."""
    lines = textwrap.wrap(words, LINE)
    text = "".join(
        f'<text x="10" y="{36 * (k + 1)}">{escape(line)}</text>' for k, line in enumerate(lines)
    )
    return _svg(36 * len(lines) + 20, words, text)


class _Sheet:
    """The part of the plane that is drawn."""

    def __init__(self, low: Array, high: Array) -> None:
        self.low, self.high = low, high
        self.scale = min(WIDTH / (high[0] - low[0]), HIGHEST / (high[1] - low[1]))
        self.height = round((high[1] - low[1]) * self.scale)
        self.left = (WIDTH - (high[0] - low[0]) * self.scale) / 2

    @classmethod
    def of(cls, view: View, meshes: dict[str, Mesh]) -> _Sheet:
        points = np.hstack([mesh.p for mesh in meshes.values()])
        low, high = points.min(axis=1), points.max(axis=1)
        if view.x.size and view.y.size and view.axis.along == (1.0, 0.0):
            seen = np.array([[each.min(), each.max()] for each in (view.x, view.y)])
            low, high = np.maximum(low, seen[:, 0]), np.minimum(high, seen[:, 1])
        if view.symmetric:
            low[0] = -high[0]
        margin = 0.02 * (high - low).max()
        return cls(low - margin, high + margin)

    def at(self, points: Array) -> Array:
        """Return places on the picture (2, n) [px]."""
        x = self.left + (points[0] - self.low[0]) * self.scale
        return np.array([x, (self.high[1] - points[1]) * self.scale])

    def meets(self, points: Array) -> NDArray[np.bool_]:
        """Tell which lines or elements (2, n_corners, n) come into the picture."""
        low, high = self.low[:, None], self.high[:, None]
        return np.asarray(((points.max(axis=1) >= low) & (points.min(axis=1) <= high)).all(axis=0))


def _body(mesh: Mesh, surfaces: list[str], frame: _Sheet, number: int) -> Iterator[str]:
    fine = " fine" if mesh.t.shape[1] > MOST else ""
    kind = f"body{' second' if number % 2 else ''}{fine}"
    yield _path(mesh.p[:, mesh.t], frame, kind, "Z")
    for name in surfaces:
        facets = mesh.facets[:2, np.asarray(mesh.boundaries[name])]
        yield _path(mesh.p[:, facets], frame, "contact")


def _path(points: Array, frame: _Sheet, kind: str, end: str = "") -> str:
    """Return what comes into the picture of lines or elements (2, n_corners, n)."""
    seen = points[:, :, frame.meets(points)]
    places = frame.at(seen.reshape(2, -1)).reshape(seen.shape).transpose(2, 1, 0)
    moves = ("M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in each) + end for each in places)
    return f'<path class="{kind}" d="{"".join(moves)}"/>'


def _svg(height: float, title: str, content: str) -> str:
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {height:g}" '
        f'width="{WIDTH:g}" height="{height:g}"><title>{escape(title)}</title>'
        f"<style>{STYLE}</style>{content}</svg>"
    )
