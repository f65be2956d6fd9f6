"""The sharp corner of a flat punch, with relief grooves or none."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from solver.results.corner import Corner

if TYPE_CHECKING:
    from solver.results.run import FinishedRun, Values
    from solver.scenes.flat_punch import FlatPunch


class Cornered(Protocol):
    """Parameters of a scene whose contact ends at a corner, at the distance a from its middle."""

    mean_pressure: float
    half_width: float

    @property
    def geometry(self) -> FlatPunch:
        """Dimensions and elements [mm]."""


def corner(run: FinishedRun) -> Values:
    """Return what `Corner` finds of the stress; a groove is another feature."""
    parameters: Cornered = run.parameters
    geometry = parameters.geometry
    grooves = filter(None, (geometry.punch_groove, geometry.half_plane_groove))
    beside = geometry.half_plane_groove
    features = [groove.distance or groove.side for groove in grooves]
    return Corner(
        half_width=parameters.half_width,
        mean_pressure=parameters.mean_pressure,
        smallest_element=geometry.smallest,
        graded=geometry.graded,
        feature=min([parameters.half_width, *features]),
        flush=beside is not None and beside.distance == 0,
    )(run)


def lifted(run: FinishedRun) -> tuple[str, ...]:
    """Return a warning where the corner has lifted off."""
    width, _ = run.tractions.extent(run.loaded)
    if width >= run.parameters.half_width * (1 - 1e-9):
        return ()
    return (f"the corner has lifted off: contact ends at {width:.4g} mm, without a singularity",)
