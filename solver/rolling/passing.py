"""One steady pass: strains under and behind a moving load, by Newton's method.

In the frame of the load nothing changes in time. Let e be the strains that the pass adds, at the
points of the window, and ep(e) the plastic strain of material that has flowed along the rows with
these strains. Equilibrium is the fixed point

    e = Phi(e) = S load(u),   u = K^-1 f(ep(e) - ep before)

with the elastic stiffness K, the same for every pass, and the nodal forces f equivalent to plastic
strain. ``load(u)`` are the displacements with the load, given those without it, and S gives their
strains. Newton's equation (I - Phi') d = Phi(e) - e is solved by GMRES; Phi' comes from the
derivative of the flow along the rows.

K. Dang Van, M.H. Maitournam, J. Mech. Phys. Solids 41 (1993) 1691-1710.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from solver.errors import LimitLoad, NotConverged, Runaway, TooLong, WindowTooSmall
from solver.linear.iterative import gmres
from solver.materials.law import Law
from solver.materials.state import PlasticState
from solver.rolling.flow import PARTS
from solver.rolling.load import AppliedLoad, FlowPast, PassedBody, PassingLoad, S
from solver.typing import Array

TOLERANCE = 1e-4
"""Tolerance of a pass: largest deviatoric strain of the residual times 2 G, over the yield
stress."""

EXACT = 1e-11
"""Tolerance of a pass of which differences of 1e-6 are taken."""

_FORCING, _EXACTLY = 0.1, 1e-3
"""Relative residual to which GMRES solves Newton's equation, also with the tolerance `EXACT`."""
_KRYLOV, _MOST_KRYLOV = 60, 240
"""Largest number of GMRES iterations for a Newton step: at first, and after some were too few."""
_STALLED = 0.98
"""A Newton step that GMRES did not solve has stalled if the residual falls to more than this
share."""
_FAR_FROM = 0.01
"""A pass is far from convergence while its residual is above this share of the first one."""
_STEPS = 40
"""Largest number of Newton steps; no pass of the seeded scenes that was found took more than 29."""
_SHORTEST = 1 / 32
"""Smallest share of a Newton step in the line search."""
_AWAY = 3.0
"""Largest ratio of the residual after a whole step to that before."""
_FLOWS, _RUNS = 0.1, 1.0
"""Plastic strains above which a stalled solve, or any solve, counts as a limit load. A material
that hardens has no limit load: Newton's method has then diverged."""
_SOLVES, _POINTS = 10_000, 20_000
"""Largest number of solves with the stiffness for one pass; a pass takes 50 to 2100. In a window of
more points than the second number, and than the first window, a solve counts by its points."""
_PATIENCE, _PROGRESS = 14, 0.7
"""Number of steps, and the share of the residual to which it must fall in them; otherwise the
search for the pass ends."""


class SolveBudget:
    """Counts the solves with the stiffness of all attempts to find a pass, in all windows."""

    def __init__(self, most: int = _SOLVES) -> None:
        self._most, self.solves, self._counted, self._few = most, 0, 0.0, 0

    def solve(self, points: int) -> None:
        """Count one in a window of so many points; raise `TooLong` above the largest number."""
        self._few = self._few or max(points, _POINTS)
        if self._counted >= self._most:
            raise TooLong(
                f"no steady pass was found in {self._most} solves with the stiffness (fewer in "
                "larger windows); with larger elements, a lighter load or more hardening it is "
                "easier to find"
            )
        self.solves, self._counted = self.solves + 1, self._counted + max(1.0, points / self._few)

    def renew(self) -> None:
        """Count from zero: a pass is found."""
        self.solves, self._counted, self._few = 0, 0.0, 0


@dataclass(frozen=True, slots=True)
class Pass(Generic[S]):
    """A steady pass.

    Attributes
    ----------
    law : law of the material
    parts : number of increments between two points of a row
    before, after : state of the body, in the frame in which the load moves along +x
    strain : (n_rows, n_columns, n_components) strain that the pass adds at the points, Mandel
    states : internal variables (..., n_rows, n_columns) at these points
    ago : internal variables at the beginning of the last increment before each point
    surface : internal variables (..., n, n_columns) at the surface above the n uppermost rows
    loading : the load on the track
    left_over : largest deviatoric strain of the residual
    steps, solves : number of Newton steps, and of solves with the stiffness
    direction : 1 if the load moves along +x, -1 if along -x, which it does in the plane alone
    """

    law: Law
    parts: int
    before: S
    after: S
    strain: Array
    states: PlasticState
    ago: PlasticState
    surface: PlasticState
    loading: AppliedLoad
    left_over: float
    steps: int
    solves: int
    direction: int = 1

    @property
    def plastic_strain(self) -> Array:
        """Plastic strain (n_rows, n_columns, n_components), Mandel."""
        return np.moveaxis(self.states.plastic_strain, 0, 2)

    @property
    def accumulated(self) -> Array:
        """Accumulated plastic strain (n_rows, n_columns)."""
        return self.states.accumulated

    @property
    def most_added(self) -> float:
        """Largest accumulated plastic strain that the pass adds at a point."""
        return float((self.accumulated - self.before.accumulated[:, None]).max())

    @property
    def left(self) -> S:
        """The state behind the pass, in the coordinates of the track: mirrored for direction -1."""
        after: Any = self.after
        return after if self.direction == 1 else after.mirrored


def passing(
    track: PassedBody[S],
    material: Law,
    load: PassingLoad,
    before: S,
    guess: Array | None = None,
    *,
    start: Any = None,
    parts: int | None = None,
    tolerance: float = TOLERANCE,
    budget: SolveBudget | None = None,
) -> Pass[S]:
    """Return the steady pass of a load over a body.

    Parameters
    ----------
    track : the body
    material : its law
    load : load that passes along +x
    before : state by depth before the pass
    guess : strains (n_rows, n_columns, n_components) to start from, for instance of a similar pass
    start : first guess for the contact, for instance that of the pass before
    parts : number of increments between two points of a row, `PARTS` if None
    tolerance : largest deviatoric strain of the residual, times 2 G / yield stress
    budget : counts the solves, those of earlier attempts included

    Raises
    ------
    TooLong
        if that takes too many solves
    LimitLoad
        if plastic strain grows without bound in a material that does not harden
    WindowTooSmall
        if points yield in the first column of the window, or in its deepest row
    NotConverged
        if Newton's method does not converge
    """
    parts = parts or PARTS
    scale, rough = np.sqrt(track.weights)[..., None], track.rough
    double_shear = 2 * material.elasticity.shear_modulus
    budget, krylov = budget or SolveBudget(), _KRYLOV
    forcing = _FORCING if tolerance > EXACT else _EXACTLY
    before_it, last = budget.solves, start

    def at(added: Array, elastic: AppliedLoad | None = None) -> _At[S]:
        nonlocal last
        budget.solve(track.weights.size)
        flow = track.flow(material, before, added, parts)
        if elastic is not None and not flow.force.any():  # nothing yields
            return _At(added, flow, elastic, np.zeros_like(added), 0.0)
        last = loading = load.on(track.solve(flow.force), before, last)
        residual = track.strain(loading.u) - added
        return _At(added, flow, loading, residual, float(np.linalg.norm(scale * residual)))

    if guess is None:
        last = elastic = load.on(track.at_rest, before, last)
        here = at(track.strain(elastic.u), elastic)
    else:
        here = at(guess)
    first, sizes, shape = here.size, [here.size], here.added.shape
    for step in range(_STEPS):
        left_over, flow = deviation(here.residual), here.flow
        level = material.yield_stress
        if not flow.force.any():  # the stress may be far below
            level = min(level, double_shear * deviation(here.added))
        if left_over * double_shear <= tolerance * level:
            if flow.beyond:
                raise WindowTooSmall(f"the window is too small {flow.beyond} for a steady pass")
            surface, after = flow.left()
            return Pass(
                law=material,
                parts=parts,
                before=before,
                after=after,
                strain=here.added,
                states=flow.states,
                ago=flow.ago,
                surface=surface,
                loading=here.loading,
                left_over=left_over,
                steps=step,
                solves=budget.solves - before_it,
            )

        def newton(scaled: Array, here: _At[S] = here) -> Array:
            budget.solve(track.weights.size)
            change = scaled.reshape(shape) / scale
            made = rough.strain(here.loading.along(rough.solve(here.flow.along(change))))
            return np.asarray((scale * (change - made)).ravel())

        right = (scale * here.residual).ravel()
        found, solved = gmres(newton, right, forcing, krylov)
        change = found.reshape(shape) / scale

        def moved(share: float, here: _At[S] = here, change: Array = change) -> _At[S]:
            return at(here.added + share * change)

        there = searched(moved, here.size)
        most_added = there.flow.most_added
        stalled = krylov == _MOST_KRYLOV and not solved and there.size > _STALLED * here.size
        unsolved = here.size > _FAR_FROM * first
        if most_added > _RUNS or (stalled and unsolved and most_added > _FLOWS):
            raise _diverged(material, most_added)
        if not solved:
            krylov = min(2 * krylov, _MOST_KRYLOV)
        here = there
        sizes.append(here.size)
        earlier = min(sizes[:-_PATIENCE], default=np.inf)
        if unsolved and min(sizes[-_PATIENCE:]) > _PROGRESS * earlier:
            break
    raise NotConverged(f"no steady pass was found in {len(sizes) - 1} steps of Newton's method")


class _Sized(Protocol):
    @property
    def size(self) -> float:
        """Norm of the residual."""


Sized = TypeVar("Sized", bound=_Sized)


@dataclass(frozen=True, slots=True)
class _At(Generic[S]):
    """An iterate of Newton's method: strains, flow and load with them, residual and its norm."""

    added: Array
    flow: FlowPast[S]
    loading: AppliedLoad
    residual: Array
    size: float


def searched(at: Callable[[float], Sized], size: float, shortest: float = _SHORTEST) -> Sized:
    """Return the iterate after a Newton step, or after the share that lowers the residual.

    The residual has kinks where points begin to yield, open, close or slip. Shares are halved until
    one lowers the residual, and on as long as the next one lowers it further: a share that barely
    does lies beyond kinks, where plastic strain may run away. If no share lowers it, the whole step
    is taken to leave the kink, unless the residual grows by more than `_AWAY`.

    Parameters
    ----------
    at : (share of the step) -> iterate with ``size``, the norm of its residual; it may raise
        `NotConverged`
    size : norm of the residual before the step
    shortest : smallest share that is tried
    """
    tried: list[Sized] = []
    best: Sized | None = None
    share = 1.0
    while share >= shortest:
        try:
            there = at(share)
        except TooLong:
            raise
        except NotConverged as error:  # no contact was found for this shape of the surface
            failure = error
        else:
            tried.append(there)
            if best is not None and there.size >= best.size:
                break
            if there.size < (1 - 1e-4 * share) * size:
                best = there
                if share == 1.0:
                    break
        share /= 2
    if best is not None:
        return best
    if not tried:
        raise failure
    return tried[0] if tried[0].size < _AWAY * size else min(tried, key=lambda a: a.size)


def _diverged(material: Law, most_added: float) -> NotConverged:
    """Return the error for a pass whose plastic strain became too large in Newton's method."""
    if not material.hardens:
        return LimitLoad("plastic strain grows without bound in a steady pass")
    return Runaway(
        f"no steady pass was found up to a plastic strain of {most_added:.0%}, "
        "far beyond small strains; the material hardens, this is not its limit"
    )


def deviation(strain: Array) -> float:
    """Return the largest norm of the deviators of Mandel strains (..., n_components)."""
    mean = strain[..., :3].mean(axis=-1)
    square = (strain**2).sum(axis=-1) - 3 * mean**2
    return float(np.sqrt(np.maximum(square.max(), 0.0)))
