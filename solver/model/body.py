"""Declaration of a deformable body: mesh, element, material, supports, loads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Literal

import numpy as np
from skfem import Mesh

from solver.errors import ModelError
from solver.materials import Law, PlaneStress
from solver.mesh.check import check_mesh
from solver.mesh.elements import element_type
from solver.mesh.opening import faces_of
from solver.mesh.rounding import with_zeros
from solver.model.amplitude import Amplitude
from solver.model.loads import Displacement, Kinematics, Load, Pressure
from solver.model.pairs import Link
from solver.parameters import Thickness, check
from solver.tensors import AXES

Held = Literal["x", "y", "z", "xy", "xz", "yz", "xyz"]
"""Components that a support may hold; those with z in space alone."""
_CRACKED = {
    "element": ("quad8", "tri6"), "kinematics": ("plane_strain", "plane_stress"),
    "strain": ("small",),
}  # fmt: skip
"""What a body with cracks may have: elements whose strain grows towards the tip as 1/sqrt(r), and
what stress intensities are computed for."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Body:
    """A deformable body.

    Attributes
    ----------
    name : unique in its model
    mesh : scikit-fem mesh with named boundaries [mm], of quadrilaterals or triangles, or in space
        of hexahedra or tetrahedra
    material : material law, a `Material` or a law of your own (`solver.materials.Law`)
    kinematics : ``plane_strain``, ``plane_stress`` or ``axisymmetric`` (x is the radius); left out
        for bodies in space
    element : ``quad8`` (default), ``quad9``, ``quad4``, ``tri6``, ``tri3``, in space ``hex8`` or
        ``tet10``, or one of your own
    full_integration : whether to integrate by the element's ``full_order``: ``quad8`` with 3x3
        points instead of 2x2
    thickness : thickness of plane bodies [mm]
    supports : boundary name -> supported displacement components, ``x``, ``y`` or ``xy``; in space
        also with ``z``
    pressure : boundary name -> pressure at load factor one, positive when it pushes [MPa]
    amplitude : load factor of the pressures over time; by default the time itself
    loads : further loads, each with an amplitude of its own (`solver.model.loads`)
    condense : whether to reduce the body to its contact surfaces if its material is elastic
    axle : makes an elastic body a wheel, which its supports connect to the hub
    strain : ``small``, or ``large``: logarithmic strain and equilibrium in the deformed body
    large_region : name of the region of the mesh that alone has large strain, so that increments
        are solved in windows; by default the whole body has it
    cracks : names of the cracks of the mesh (`solver.mesh.opened`), whose faces lie on one another
    """

    name: str
    mesh: Mesh
    material: Law
    kinematics: Kinematics = "plane_strain"
    element: str = "quad8"
    full_integration: bool = False
    thickness: Thickness = 1.0
    supports: Mapping[str, Held] = field(default_factory=dict)
    pressure: Mapping[str, float] = field(default_factory=dict)
    amplitude: Amplitude | None = None
    loads: tuple[Load, ...] = ()
    condense: bool = True
    axle: Axle | None = None
    strain: Literal["small", "large"] = "small"
    large_region: str = ""
    cracks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check(self)
        element = element_type(self.element)
        shapes = element.element.refdom, self.mesh.elem.refdom
        if shapes[0] is not shapes[1]:
            needed, has = (f"{s.nnodes} corners" + " in space" * (s.dim() == 3) for s in shapes)
            raise ModelError(
                "element", self.element, f"needs cells with {needed}; the mesh of body "
                f"{self.name!r} has {has}; a mesh file with triangles gives no others",
            )  # fmt: skip
        sides = (faces_of(crack) for crack in self.cracks)
        cracks = [(self.facets(a, "cracks"), self.facets(b, "cracks")) for a, b in sides]
        check_mesh(self.mesh, self.name, element, cracks)
        if self.cracks:
            self._check_cracked()
        if self.dim == 3:
            self._check_solid()
        if self.kinematics == "axisymmetric" and self.mesh.p[0].min() < 0:
            object.__setattr__(self, "mesh", with_zeros(self.mesh))
            if self.mesh.p[0].min() < 0:
                raise ModelError("mesh", self.mesh.p[0].min(), "an axisymmetric body needs x >= 0")
        for boundary, held in self.supports.items():
            self.facets(boundary, "supports")
            if self.dim == 2 and "z" in held:
                raise ModelError(f"supports.{boundary}", held, "must be x, y or xy in a plane body")
        for load in self.every_load:
            load.check(self.kinematics)
            for axis in load.components.keys() - set(range(self.dim)):
                name = ".".join((load.name, *load.boundaries, AXES[axis]))
                raise ModelError(name, load.components[axis], "must be left out in a plane body")
            for boundary in load.boundaries:
                self.facets(boundary, load.name, outer=load.outside)
            if load.removes:
                self.region(load.removes, f"{load.name}.region")
        if self.axle is not None and not self.material.elastic:
            raise ModelError("axle", self.name, "a wheel must be elastic: leave out yield_stress")
        if self.large:
            self._check_large()
        elif self.large_region:
            allowed = f'must be left out: the strain of body {self.name!r} is "small"'
            raise ModelError("large_region", self.large_region, allowed)
        for load in self.every_load if self.axle is not None else ():
            raise ModelError(load.name, load.boundaries, "must not be given on a body with an axle")

    @property
    def large(self) -> bool:
        """Whether its strain is large."""
        return self.strain == "large"

    @cached_property
    def large_elements(self) -> np.ndarray:
        """Which elements (n_elements,) have large strain."""
        large = np.full(self.mesh.nelements, self.large)
        if self.large_region:
            large[:] = False
            large[self.region(self.large_region, "large_region")] = True
        large.flags.writeable = False
        return large

    def turns(self, load: Load) -> bool:
        """Whether a load follows the displacements of what it acts on, where strain is large."""
        return self.large and load.follows and bool(self.large_elements[self._under(load)].any())

    def turned_by(self, link: Link) -> bool:
        """Whether a link of which it is the slave turns with its rigid body, by large angles."""
        return self.large and link.rigid is not None and link.master is None

    def _under(self, load: Load) -> np.ndarray:
        """Return the elements on which a load acts: those at its boundaries, or all."""
        facets = [self.facets(boundary) for boundary in load.boundaries]
        return (
            self.mesh.f2t[0, np.concatenate(facets)] if facets else np.arange(self.mesh.nelements)
        )

    @property
    def of_small_strain(self) -> list[str]:
        """Names of what it has and bodies of large strain do not have yet."""
        loads = (load.name for load in self.every_load if load.removes or load.moves)
        return [*(["axle"] if self.axle is not None else []), *loads]

    def _check_large(self) -> None:
        """Refuse what bodies of large strain do not have yet."""
        for name in self.of_small_strain:
            allowed = f'must be left out of body {self.name!r}, or its strain must be "small"'
            raise ModelError(name, "given with large strain", allowed)
        large = self.large_elements
        for load in filter(self.turns, self.every_load):
            if not large[self._under(load)].all():
                allowed = f"must push inside or outside of region {self.large_region!r}, not both"
                if not load.boundaries:
                    allowed = f"must be left out, or large_region: it acts on all of {self.name!r}"
                raise ModelError(load.name, load.boundaries, allowed)

    def _check_cracked(self) -> None:
        """Refuse what bodies with cracks do not have."""
        for name, allowed in _CRACKED.items():
            if (given := getattr(self, name)) not in allowed:
                words = f"must be {' or '.join(allowed)} in body {self.name!r}, which has a crack"
                raise ModelError(name, given, words)

    @property
    def dim(self) -> int:
        """Number of axes: 2 of a plane or axisymmetric body, 3 of one in space."""
        return element_type(self.element).dim

    def _check_solid(self) -> None:
        """Refuse what bodies in space have not yet: all but supports and displacements."""
        plane = ("kinematics", "thickness", "pressure", "axle", "strain")
        defaults = {each.name: each.default for each in fields(self)} | {"pressure": {}}
        given = {name: getattr(self, name) for name in plane}
        given |= {
            load.name: load.boundaries for load in self.loads if not isinstance(load, Displacement)
        }
        for name, value in given.items():
            if value != defaults.get(name):
                allowed = f"must be left out: bodies of {self.element} do not have it yet"
                raise ModelError(name, value, allowed)

    @cached_property
    def law(self) -> Law:
        """The material law in the kinematics of the body."""
        if self.kinematics != "plane_stress":
            return self.material
        return PlaneStress(self.material)

    @property
    def box(self) -> np.ndarray:
        """Sides (2,) of the bounding box [mm]."""
        return np.ptp(self.mesh.p, axis=1)

    @cached_property
    def every_load(self) -> tuple[Load, ...]:
        """All loads, the pressures first."""
        each = self.pressure.items()
        pushing = (Pressure(boundary=b, value=p, amplitude=self.amplitude) for b, p in each)
        return (*pushing, *self.loads)

    def region(self, name: str, field: str = "region") -> np.ndarray:
        """Return the element numbers of a named part of the body.

        ``field`` is the input that an error names.
        """
        known = self.mesh.subdomains or {}
        if name not in known:
            listed = ", ".join(known) or "it has none"
            raise ModelError(
                field, name, f"must name a region of the mesh that is not all of it: {listed}"
            )
        elements, count = np.unique(np.asarray(known[name])), self.mesh.nelements
        if not len(elements):
            raise ModelError(field, name, "must have elements; this region of the mesh is empty")
        if elements.dtype.kind not in "iu" or elements[0] < 0 or elements[-1] >= count:
            raise ModelError(field, name, f"must have whole numbers of elements, 0 to {count - 1}")
        if len(elements) == count:
            raise ModelError(field, name, "must not be all of the body")
        return elements

    def facets(self, boundary: str, field: str = "boundary", outer: bool = False) -> np.ndarray:
        """Return the facet numbers of a named boundary.

        With ``outer`` they must lie on the outside of the body, as pressure and contact require;
        supports may hold facets inside. ``field`` is the input that an error names.
        """
        known = self.mesh.boundaries or {}
        if boundary not in known or len(known[boundary]) == 0:
            allowed = "must name a boundary of the mesh: " + (", ".join(known) or "it has none")
            raise ModelError(field, boundary, allowed)
        facets = np.asarray(known[boundary])
        count = self.mesh.nfacets
        if facets.dtype.kind not in "iu" or facets.min() < 0 or facets.max() >= count:
            allowed = f"must be a boundary of facet numbers from 0 to {count - 1}"
            raise ModelError(field, boundary, allowed)
        if len(np.unique(facets)) < len(facets):
            raise ModelError(field, boundary, "must be a boundary that lists each facet once")
        inside = facets[self.mesh.f2t[1, facets] != -1] if outer else facets[:0]
        if len(inside):
            first, second = self.mesh.f2t[:, inside[0]]
            allowed = (
                f"must lie on the outside of body {self.name!r}; {len(inside)} of its facets are "
                f"inside, one between elements {first} and {second}"
            )
            raise ModelError(field, boundary, allowed)
        return facets


@dataclass(frozen=True, slots=True, kw_only=True)
class Axle:
    """Makes an elastic body a wheel that rotates about ``centre``.

    Attributes
    ----------
    centre : (x, y) of the hub in the mesh [mm]
    radius : radius of the rim [mm]
    force : vertical force on the axle, positive downwards [N]
    moment : moment on the axle, positive counter-clockwise [N mm]
    position : displacement of the axle along x from its place in the mesh [mm]
    rotation : prescribed rotation of the hub, instead of the moment [rad]
    turned : rotation at the start, so that the fine part of the rim reaches the track [rad]
    """

    centre: tuple[float, float]
    radius: float
    force: Amplitude
    moment: Amplitude
    position: Amplitude
    rotation: Amplitude | None = None
    turned: float = 0.0
