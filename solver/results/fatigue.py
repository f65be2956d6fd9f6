"""Fatigue of the bodies of a run: a criterion on the cycle that the run repeats.

The cycle at a point is the stress at named stages of the run, in their order, closed from the last
to the first. In a pass over a body without ends it is the stress along the row of the point, from
far ahead of the load to far behind it.

A criterion of elastic shakedown says nothing of a cycle that strains plastically, by more than a
thousandth of the largest range of strain: such points are NaN, the numbers too, and
`fatigue_applies` says so, with the plastic strain of a cycle.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from solver.errors import ModelError
from solver.fatigue.criteria import CRITERIA
from solver.fatigue.criterion import Assessment, Criterion
from solver.fatigue.dang_van import DangVan
from solver.fatigue.paths import Paths
from solver.results.fields import Passed, StressCycle
from solver.results.quantities import along_axes, declare, declare_along, placed
from solver.results.run import FinishedRun, Values
from solver.results.shakedown import CLOSED, QUIET
from solver.results.surface_crack import LEAST, SurfaceCrack
from solver.results.view import Places, View
from solver.tensors import AXES, to_tensor
from solver.typing import Array, Bools


class Applies(IntEnum):
    """Whether the criterion applies to all points, with its stored value."""

    NOT_APPLICABLE = 0
    APPLICABLE = 1


_WHAT = "fatigue utilisation: equivalent of a cycle over its limit"
MAP_UTILISATION = declare("map_fatigue_utilisation", _WHAT, dims=("y", "x"))
PROFILE_UTILISATION = declare(
    "fatigue_utilisation_profile", f"{_WHAT}, along depth", dims=("station", "depth")
)
LINE_UTILISATION = declare(
    "line_fatigue_utilisation", f"{_WHAT}, along the line", dims=("line", "fraction"),
    beside=placed("line", *AXES, "s"),
)  # fmt: skip
UTILISATION = declare("fatigue_utilisation", "largest fatigue utilisation, at integration points")
SAFETY = declare("fatigue_safety_factor", "smallest safety factor, one over fatigue utilisation")
PLACE = declare_along("fatigue_{}", "position along {} of the smallest safety factor", "mm")
PLANE = tuple(
    declare(f"fatigue_plane_{axis}", f"normal along {axis} of the critical plane there")
    for axis in AXES
)
STRAIN = declare("fatigue_plastic_strain", "largest plastic strain that a cycle accumulates")
INSTANT = declare("instant", "instant of a cycle", dims=("instant",), count=True)
PATH = tuple(
    declare(f"fatigue_path_{name}", f"{meaning} at the worst point", "MPa", dims=("instant",))
    for name, meaning in {
        "hydrostatic": "hydrostatic stress",
        "shear": "mesoscopic shear stress",
        "limit": "allowed shear stress at the hydrostatic stress",
    }.items()
)  # fmt: skip
"""Dang Van's diagram: a path and its limit."""
APPLIES = declare("fatigue_applies", "whether the fatigue criterion applies", flags=Applies)
CRACK_APPLIES = declare("crack_applies", "whether K of the initial crack is known", flags=Applies)


_SAME = 1e-9
"""Values with this relative difference are equal; the place is then that nearest to the middle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fatigue:
    """An output: a fatigue criterion and a surface crack in the cycle of a run.

    Attributes
    ----------
    criterion : the criterion with its constants, if one is asked for
    cycle : stages of the cycle; empty for all of a run in their order
    residual : whether stress that remains after release counts; without, it is subtracted
    bodies : bodies that are assessed by the criterion; empty for all
    crack : the crack, if one is asked for
    """

    criterion: Criterion | None
    cycle: tuple[str, ...] = ()
    residual: bool = True
    bodies: tuple[str, ...] = ()
    crack: SurfaceCrack | None = None

    @classmethod
    def of(
        cls, criterion: str | None, limits: Mapping[str, Any],
        crack: Mapping[str, Any] | None = None, **more: Any,
    ) -> Fatigue:  # fmt: skip
        """Return the output of a table.

        Raises
        ------
        ModelError
            if there is no such criterion, or it has other constants
        """
        held = None if crack is None else SurfaceCrack(**crack)
        if criterion is None:
            if held is None or limits:
                raise ModelError("criterion", None, "must be given, or crack alone")
            if more.get("bodies"):
                allowed = "belong to a criterion: leave them out for a crack alone"
                raise ModelError("bodies", more["bodies"], allowed)
            return cls(criterion=None, crack=held, **more)
        part, known = CRITERIA[criterion], CRITERIA.declared_by(criterion)
        for name in limits:
            if name not in known:
                allowed = f"must be one of {', '.join(known)}"
                raise ModelError(f"limits.{name}", limits[name], allowed)
        for name in known:
            if name not in limits and known[name]:
                raise ModelError(f"limits.{name}", None, f"is needed by {criterion}")
        try:
            made = part(**limits)
        except ModelError as error:
            raise ModelError(f"limits.{error.field}", error.value, error.allowed) from None
        return cls(criterion=made, crack=held, **more)

    def fits(self, _parameters: Any, view: Callable[[], View]) -> None:
        """Refuse what runs with a view cannot have: see `SurfaceCrack.fits`."""
        if self.crack is not None:
            self.crack.fits(view())

    def before(self, _parameters: Any, system: Any, view: View) -> None:
        """Refuse what a run cannot have, before its first increment: see `SurfaceCrack.sampler`."""
        if self.crack is not None:
            self.crack.sampler(system, view)

    def __call__(self, run: FinishedRun, lines: Mapping[str, Places] | None = None) -> Values:
        """Return the quantities of a run."""
        values: dict[Any, Any] = {}
        if self.crack is not None:
            cycle = self._cycle(run, run.view.profile_body)
            values |= self.crack.values(run, cycle, _strained(cycle)[1])
            values[CRACK_APPLIES] = Applies(int(np.isfinite(values[LEAST])))
            values[STRAIN] = float(np.nanmax(cycle.grown, initial=0.0))
        if self.criterion is None:
            return values
        names = self.bodies or run.system.names
        of_body = {name: self._assessed(run, name, self.criterion) for name in names}
        nodal = {
            name: run.samples.fields.recovered(name, each.found.utilisation)
            for name, each in of_body.items()
        }
        across, up = run.view.map_axes
        if all(grid.size for grid in run.view.map_grid):
            values[MAP_UTILISATION.at(up, across)] = run.samples.nodal_on_map(nodal)
        if run.view.depth.size and run.view.profile_body in nodal:
            values[PROFILE_UTILISATION] = run.samples.along_depth(nodal[run.view.profile_body])
        if lines:
            values[LINE_UTILISATION] = np.stack([
                run.system.sampler(line.body, line.X)(nodal[line.body])
                if line.body in nodal else np.full(line.X.shape[1], np.nan)
                for line in lines.values()
            ])  # fmt: skip
        return {**values, **self._numbers(run, of_body)}

    def _numbers(self, run: FinishedRun, of_body: Mapping[str, _OfBody]) -> Values:
        most = {name: np.nanmax(each.found.utilisation, initial=-np.inf)
                for name, each in of_body.items()}  # fmt: skip
        worst = max(most, key=lambda name: most[name])
        found, applies = of_body[worst].found, not any(each.void.any() for each in of_body.values())
        applies = applies and np.isfinite(most[worst])
        X, hidden = run.system.positions(worst), 1.0 if applies else np.nan
        same = found.utilisation >= most[worst] - _SAME * abs(most[worst])
        k = int(np.where(same, np.abs(run.view.axis.reached(X)), np.inf).argmin())
        path: dict[Any, Any] = {}
        if isinstance(self.criterion, DangVan):
            p, shear = (
                own[0] * hidden for own in self.criterion.path(Paths(of_body[worst].stress_at(k)))
            )
            allowed = self.criterion.limit - self.criterion.factor * p
            path = {INSTANT: np.arange(len(p)), **dict(zip(PATH, (p, shear, allowed), strict=True))}
        return {
            **path,
            APPLIES: Applies(int(applies)),
            STRAIN: max(
                float(np.nanmax(each.cycle.grown, initial=0.0)) for each in of_body.values()
            ),
            UTILISATION: float(found.utilisation[k]) * hidden,
            SAFETY: float(found.safety_factor[k]) * hidden,
            **along_axes(PLACE, (X[:, k] * hidden).tolist()),
            **dict(zip(PLANE, (found.plane[k] * hidden).tolist(), strict=True)),
        }

    def _assessed(self, run: FinishedRun, name: str, criterion: Criterion) -> _OfBody:
        cycle = self._cycle(run, name)
        known, void = _strained(cycle)
        if criterion.yielding:
            void &= cycle.net > CLOSED * cycle.grown
        asked = known & ~void
        value, used = np.full(len(known), np.nan), np.full(len(known), np.nan)
        plane = np.full((len(known), 3), np.nan)
        if asked.any():
            found = criterion.assess(Paths(cycle.stress[asked], cycle.strain[asked]))
            value[asked], used[asked], plane[asked] = found
        of = cycle.of
        return _OfBody(Assessment(value[of], used[of], plane[of]), void[of], cycle)

    def _cycle(self, run: FinishedRun, name: str) -> StressCycle:
        """Return the cycle at the points of a body; without residual stress if that is asked."""
        system, points = run.system, run.outcome.points
        stages = self.cycle or run.view.stages
        if other := [stage for stage in stages if stage not in points]:
            raise ModelError("cycle", other[0], f"must be one of {', '.join(points)}")
        if isinstance(system, Passed):
            cycle = system.cycle(run.loaded)
        else:
            each = [system.state(name, points[stage]) for stage in stages]
            grown = np.ptp([state.plastic.accumulated for state in each], axis=0)
            left = each[-1].plastic.plastic_strain - each[0].plastic.plastic_strain
            stress, strain = (
                np.stack([to_tensor(getattr(state, what)).T for state in each], axis=1)
                for what in ("stress", "strain")
            )
            net = np.sqrt(2 / 3 * (left**2).sum(axis=0))
            cycle = StressCycle(stress, strain, grown, net, np.arange(len(grown)))
        if self.residual:
            return cycle
        if not run.view.unloaded:
            raise ModelError("residual", False, "needs a last stage that releases the bodies")
        after = system.state(name, run.unloaded)
        _, first = np.unique(cycle.of, return_index=True)  # all points of a cycle keep the same
        return cycle._replace(
            stress=cycle.stress - to_tensor(after.stress[:, first]).T[:, None],
            strain=cycle.strain - to_tensor(after.strain[:, first]).T[:, None],
        )


def _strained(cycle: StressCycle) -> tuple[Bools, Bools]:
    """Return which cycles (n,) are known, and which of these strain plastically."""
    known = np.asarray(np.isfinite(cycle.stress).all(axis=(1, 2)))
    most = np.ptp(cycle.strain[known], axis=1).max(initial=0.0)
    return known, known & (cycle.grown > QUIET * most)


class _OfBody(NamedTuple):
    """What the criterion finds at points of a body, where it is void, and their cycles."""

    found: Assessment
    void: Bools
    cycle: StressCycle

    def stress_at(self, point: int) -> Array:
        """Return the cycle of stress (1, n_instants, n_components) at a point."""
        k = self.cycle.of[point]
        return self.cycle.stress[k : k + 1]
