"""The fields of a body: name, meaning and unit of each, declared once for all results.

Lines, points, maps, requested numbers, fields at nodes, exported files and pictures read
`BODY_FIELDS`.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

from solver.tensors import AXES, components
from solver.typing import Array


class BodyValues(NamedTuple):
    """Fields of a body at n of its nodes, or at n places.

    Attributes
    ----------
    displacement : (n_axes, n) with two or three axes [mm]
    stress : (n_components, n) recovered, components xx, yy, zz, xy (, yz, zx) [MPa]
    mises : (n,) von Mises stress, recovered from its values at the integration points; computed
        from the recovered stress it would exceed the strength [MPa]
    plastic_strain : (n,) equivalent plastic strain, recovered
    plastic_tensor : (n_components, n) plastic strain, recovered, components as those of stress
    strain : (n_components, n) total strain (elastic, plastic, thermal), recovered; in plane stress
        zz is the strain of the thickness
    """

    displacement: Array
    stress: Array
    mises: Array
    plastic_strain: Array
    plastic_tensor: Array
    strain: Array


class BodyField(NamedTuple):
    """A field of a body.

    Attributes
    ----------
    long_name : meaning in words
    units : units in the notation of the CF conventions
    stem : its name in requests and in fields at nodes, without the component
    over : ``axis`` of a vector, ``component`` of a tensor, empty for a scalar
    """

    long_name: str
    units: str
    stem: str
    over: Literal["", "axis", "component"] = ""

    def parts(self, axes: int) -> tuple[str, ...]:
        """Return the names of its components in a body with ``axes`` axes; empty for a scalar."""
        return {"": (), "axis": AXES[:axes], "component": components(2 * axes)}[self.over]

    def numbers(self, axes: int) -> tuple[str, ...]:
        """Return the names at nodes: ``mises``, or of each component, as ``stress_xx``."""
        return tuple(f"{self.stem}_{part}" for part in self.parts(axes)) or (self.stem,)


BODY_FIELDS = {
    "stress": BodyField("stress", "MPa", "stress", "component"),
    "mises": BodyField("von Mises stress", "MPa", "mises"),
    "plastic_strain": BodyField("equivalent plastic strain", "1", "plastic_strain"),
    "plastic_tensor": BodyField("plastic strain", "1", "plastic_strain", "component"),
    "strain": BodyField("strain", "1", "strain", "component"),
    "displacement": BodyField("displacement", "mm", "displacement", "axis"),
}
"""Fields by their names in `BodyValues`."""
STORED = tuple(name for name in BODY_FIELDS if name != "displacement")
"""Fields stored on maps and along lines."""
