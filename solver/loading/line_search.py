"""Line search: the share of a Newton step to take."""

from __future__ import annotations

from collections.abc import Callable

_EVALUATIONS = 10
_SLACK = 0.2


def search(slope: Callable[[float], float], start: float, end: float) -> float:
    """Return the share of a step, in (0, 1], at which the energy stops falling.

    In an increment of associated plasticity the energy is convex, and ``slope`` falls through zero
    along the step. A share is accepted if its slope is at most a fifth of ``start`` in magnitude,
    or at the end of the step if the energy still falls there. This is tighter than usual: in a
    perfectly plastic body close to its limit, a loose search makes Newton's method very slow.
    The search is an Illinois iteration.

    Parameters
    ----------
    slope : (share) -> minus the derivative of the energy along the step
    start, end : its values at share zero and one; the whole step is taken if the first is not
        positive
    """
    share = 1.0
    if start <= 0 or end >= -_SLACK * start:
        return share
    low, at_low, high, at_high = 0.0, start, 1.0, end
    for _ in range(_EVALUATIONS):
        ratio = at_low / (at_low - at_high)
        share = low + (high - low) * min(max(ratio, 0.1), 0.9)
        now = slope(share)
        if abs(now) <= _SLACK * start:
            break
        if now > 0:
            low, at_low, at_high = share, now, 0.5 * at_high
        else:
            high, at_low, at_high = share, 0.5 * at_low, now
    return share
