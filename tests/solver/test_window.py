"""Windows of bodies that yield: the same equilibrium, and the same result as without them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.contact.system import System
from solver.errors import LimitLoad
from solver.fem.window import Region, Windowed
from solver.linear.solvers import Singular
from solver.loading import narrowing, stepper
from solver.loading.increment import Increment
from solver.loading.outcome import IncrementFailed
from solver.loading.program import Control
from solver.loading.walker import Walker
from solver.rolling.scenes.rolling import ROLLING, RollingParameters
from solver.scenes.punch import PUNCH, PunchParameters

PRESSED = PunchParameters(accuracy="draft", friction=0.3, load_ratio=0.6)
ROLLED = RollingParameters(
    track=12.0, element_size=3.0, advance_step=3.0, growth=1.8, press_steps=2, unload_steps=1,
    traction=0.5, passes=1,
)  # fmt: skip


def corner(system):
    """The half-plane, and the region of its elements closest to the corner of the punch."""
    part = system.parts[1]
    near = np.hypot(part.points[0] - 50.0, part.points[1]).min(axis=1) < 2.0
    inner = Region(near, np.zeros(part.n, dtype=bool))
    return part, Region.around(part, system.surfaces[1], inner, 1)


def test_a_region_grows_by_its_neighbours_and_their_surface():
    system = System(PUNCH.model(PRESSED))
    part, region = corner(system)
    wider = Region.around(part, system.surfaces[1], region, 1)
    assert wider.has(region)
    assert not region.has(wider)
    assert 0 < region.elements.sum() < wider.elements.sum() < len(region.elements)
    touched = np.zeros(part.n, dtype=bool)
    touched[system.surfaces[1][0].dofs[40:44]] = True
    nothing = np.zeros_like(region.elements)
    around = Region.around(part, system.surfaces[1], Region(nothing, touched), 1)
    assert around.elements[touched[part.dofs].any(axis=1)].all()
    assert around.contact[touched].all()
    assert around.contact.sum() > touched.sum()


def test_contact_leaves_a_window_where_its_region_has_none():
    """Also on nodes of its elements: the operators of the window do not know forces there."""
    system = System(PUNCH.model(PRESSED))
    part, region = corner(system)
    surface = system.surfaces[1][0]
    at = np.flatnonzero(np.isin(surface.dofs, part.dofs[region.elements]))
    contact = np.zeros(part.n, dtype=bool)
    contact[surface.dofs[at[:-1]]] = True
    window = Windowed(part, Region(region.elements, contact), "auto")
    assert np.isin(surface.dofs[at], window.kept).all()
    for touched, left in ((at[:-1], False), (at, True)):
        block = np.zeros((1, len(surface.dofs)))
        block[0, touched] = 1.0
        if left:
            with pytest.raises(Singular, match="contact has left the window"):
                window.pull_back(surface, np.zeros(window.n), block, 1)
        else:
            dofs, rows = window.pull_back(surface, np.zeros(window.n), block, 1)
            assert (window.kept[dofs] == surface.dofs[touched]).all() and rows.all()


@pytest.mark.parametrize("element", ["quad8", "quad4", "tri3"])
@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("scale", [0.0, 1e-3])
def test_the_rest_of_a_body_is_in_equilibrium_with_its_window(scale, held, element):
    """Whatever the window's displacements; the rest has plastic strain and starts out of balance.

    At the expanded displacements the whole body has no out-of-balance force outside the window, and
    inside that of the window. Elements outside it may share held nodes alone with each other.
    """
    model = PUNCH.model(replace(PRESSED, element=element))
    half_plane = replace(model.bodies[1], supports={"left": "x", "bottom": "xy"})
    system = System(replace(model, bodies=(model.bodies[0], half_plane)))
    part, region = corner(system)
    if held:  # the elements above those at the bottom
        at_bottom = part.X[1] == part.X[1].min()
        lowest = at_bottom[part.dofs // 2].any(axis=1)
        touched = np.isin(part.dofs // 2, part.dofs[lowest] // 2).any(axis=1)
        region = Region(touched & ~lowest, np.zeros(part.n, dtype=bool))
    assert 0 < region.elements.mean() < 1
    random = np.random.default_rng(2)
    begin = np.stack([5e-5 * part.X[0], -3e-5 * part.X[1]], axis=1).ravel()
    plastic = part.virgin()
    plastic.plastic_strain[:3] += 1e-5 * random.standard_normal((3, len(part.volumes)))
    window = Windowed(part, region, "auto").at(begin, plastic, 1.0)
    u = begin[window.kept]
    u[window.free] += scale * random.standard_normal(len(window.free))
    every = window.expand(u, 1.0)
    assert np.abs(every[window.kept] - u).max() == 0
    # what is outside answers elastically, also where the random strains would yield
    response = window.respond(u, plastic.at(window.inside), 1.0)
    stress = part.body.law.stiffness(4) @ (part.strain(every) - plastic.plastic_strain)
    stress[:, np.repeat(window.elements, part.weights.shape[1])] = response.law.stress
    out = part.external(1.0) - part.undeformed.internal_force(stress)
    size = np.abs(out[window.kept]).max()
    inside = np.setdiff1d(part.free, window.kept)
    assert np.abs(out[inside]).max() < 1e-9 * size
    miss = out[window.kept] - window.residual(1.0, u, response)
    assert np.abs(miss[window.free]).max() < 1e-9 * size


@pytest.mark.solves
@pytest.mark.parametrize(("scene", "run"), [(PUNCH, PRESSED), (ROLLING, ROLLED)])
def test_windows_change_the_result_by_less_than_the_tolerance(scene, run, monkeypatch):
    used = []

    class Counted(Increment):
        def closed(self, found):
            used.append(found.iterations)
            for interface, gap in zip(self.system.interfaces, found.candidates.gaps, strict=True):
                np.testing.assert_array_equal(gap, interface.pairing(found.u, self.time).gap)
            return super().closed(found)

    monkeypatch.setattr(narrowing, "Increment", Counted)
    found = []
    for large in (narrowing._LARGE, 0.0):
        monkeypatch.setattr(narrowing, "_LARGE", large)
        system = System(scene.model(run))
        (outcome,) = Walker(system, Control()).walk([scene.program(run)])
        assert outcome.error is None
        found.append((outcome, len(used)))
    (windowed, some), (whole, all_used) = found
    assert 5 < some == all_used
    assert sum(windowed.tally.iterations) < 1.2 * sum(whole.tally.iterations)
    body = system.names[-1]
    stress = [system.state(body, o.points["unloaded"]).stress for o in (windowed, whole)]
    assert np.abs(stress[0] - stress[1]).max() < 1e-4


@pytest.mark.solves
@pytest.mark.parametrize("load_ratio", [0.6, 1.3])
def test_whole_bodies_follow_failed_windows_in_the_shortest_increment(load_ratio, monkeypatch):
    """The limit load is told even so."""
    failed, whole = [], set()

    class Fails(Increment):
        def approach(self):
            failed.append((self.start.time, self.time))
            raise IncrementFailed("does not converge")

    class Whole(Increment):
        def solve(self):
            whole.add((self.start.time, self.time))
            return super().solve()

    run = replace(PRESSED, load_ratio=load_ratio, smallest_element=0.1, growth=2.0)
    system = System(PUNCH.model(run))
    (plain,) = Walker(system, Control(increment_error=np.inf)).walk([PUNCH.program(run)])
    monkeypatch.setattr(narrowing, "Increment", Fails)
    monkeypatch.setattr(stepper, "Increment", Whole)
    (found,) = Walker(system, Control(max_cuts=2, increment_error=np.inf)).walk(
        [PUNCH.program(run)]
    )
    assert type(found.error) is type(plain.error)
    each: dict[float, list[float]] = {}
    for start, time in failed:
        each.setdefault(start, []).append(time)
    halved = [(start, *times) for start, times in each.items() if len(times) == 3]
    assert halved
    if found.error is None:
        for start, longest, half, shortest in halved:
            assert [(start, time) in whole for time in (longest, half, shortest)] == [0, 0, 1]
        body = system.names[-1]
        stress = [system.state(body, o.points["unloaded"]).stress for o in (plain, found)]
        assert np.abs(stress[0] - stress[1]).max() < 10  # other increments
    else:
        assert isinstance(found.error, LimitLoad)
        assert plain.error.reached == pytest.approx(found.error.reached, abs=0.03)  # a quarter step


@pytest.mark.solves
def test_a_longer_increment_leads_on_where_the_shortest_fails(monkeypatch):
    """Windows fail always, whole bodies in halved increments: only the longer ones are left."""
    tried = {}

    class Fails(Increment):
        def approach(self):
            tried.setdefault(self.start.time, self.time)
            raise IncrementFailed("does not converge")

    class Whole(Increment):
        def solve(self):
            if self.time != tried.get(self.start.time, self.time):
                raise IncrementFailed("does not converge")
            return super().solve()

    run = replace(PRESSED, smallest_element=0.1, growth=2.0)
    monkeypatch.setattr(narrowing, "Increment", Fails)
    monkeypatch.setattr(stepper, "Increment", Whole)
    (found,) = Walker(System(PUNCH.model(run)), Control(max_cuts=1)).walk([PUNCH.program(run)])
    assert tried and found.error is None
    assert found.tally.cuts >= 2 * len(tried)
