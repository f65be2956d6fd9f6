"""The frictional contact problem on a dense compliance, against its own conditions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.contact import complementarity
from solver.contact.complementarity import solve_contact
from solver.contact.given_bound import given_bound, lemke
from solver.contact.links import solve_linked
from solver.contact.problem import BACKWARD, FORWARD, OPEN, STICK, ContactProblem
from solver.model.friction import BoundLines


def half_plane_compliance(n, coupling, seed):
    """A compliance like that of n neighbouring points: logarithmic, normal and slip coupled."""
    rng = np.random.default_rng(seed)
    x = np.sort(rng.uniform(0.0, 1.0, n)) + 0.02 * np.arange(n)
    distance = np.abs(x[:, None] - x[None, :])
    flexible = np.log(4.0 / (distance + 0.05))
    sign = coupling * np.sign(x[:, None] - x[None, :])
    return x, np.block([[flexible, sign], [sign.T, flexible]])


def instance(seed, friction, *, rigid=0, frictional=True, n=12, coupling=0.3):
    rng = np.random.default_rng(seed)
    x, W = half_plane_compliance(n, coupling, seed)
    W += 1e-3 * np.eye(2 * n)
    gap = rng.uniform(-1.0, 1.0, n) if not rigid else rng.uniform(0.0, 1.0, n)
    m = 2 * n if frictional else n
    offset = np.concatenate([gap, 0.5 * rng.standard_normal(n)])[:m]
    A = np.zeros((2 * n, 2))
    A[:n, 0] = 1.0  # approach
    A[:n, 1] = x - x.mean()  # tilt
    balance = np.array([-2.0 * n / 12, 0.02 * rng.standard_normal()])
    return ContactProblem(
        W=W[:m, :m],
        offset=offset,
        lines=lines(n, friction),
        A=A[:m, :rigid],
        balance=balance[:rigid],
    )


def lines(n, friction, cohesion=None, limit=np.inf):
    """Coulomb's bound at n points, with cohesion and a limit [N] of each."""
    of = [(friction, 0.0)]
    if cohesion is not None:
        of = [(friction + 1.0, 0.0), (friction, cohesion)]
    slope, level = zip(*[*of, (0.0, limit)], strict=True)
    return BoundLines(*(np.stack([np.broadcast_to(v, n) for v in each]) for each in (slope, level)))


def natural_residual(problem, solution):
    """Largest violation of the contact conditions and of the balance, relative."""
    n, F = problem.n, solution.forces
    motion = problem.offset + problem.W @ F + problem.turned @ solution.rigid
    stiffness = 1 / np.diag(problem.W)
    N = F[:n]
    worst = [np.abs(N - np.maximum(0.0, N - stiffness[:n] * motion[:n])).max()]
    if problem.frictional:
        slope, level = problem.lines
        bound = (slope * np.maximum(N, 0.0) + level).min(axis=0)
        wanted = np.clip(F[n:] - stiffness[n:] * motion[n:], -bound, bound)
        worst.append(np.abs(F[n:] - wanted).max())
    worst.append(np.abs(problem.balance + problem.A.T @ F).max(initial=0.0))
    return max(worst) / max(np.abs(F).max(), 1e-30)


@pytest.mark.parametrize("rigid", [0, 1, 2])
def test_frictionless_solutions_satisfy_the_contact_conditions(rigid):
    closed = 0
    for seed in range(60):
        problem = instance(seed, 0.0, rigid=rigid, frictional=False)
        solution = solve_contact(problem, np.full(problem.n, OPEN))
        assert solution is not None
        if solution.forces.any():
            closed += 1
            assert natural_residual(problem, solution) < 1e-8
    assert closed > 50


@pytest.mark.parametrize("rigid", [0, 1, 2])
@pytest.mark.parametrize("friction", [0.1, 0.4, 0.8])
def test_frictional_solutions_satisfy_coulombs_law(friction, rigid):
    seen = set()
    for seed in range(60):
        problem = instance(seed, friction, rigid=rigid)
        solution = solve_contact(problem, np.full(problem.n, OPEN))
        assert solution is not None
        assert natural_residual(problem, solution) < 1e-8
        seen |= set(solution.status.tolist())
    assert seen == {OPEN, STICK, FORWARD, BACKWARD}


@pytest.mark.parametrize("rigid", [0, 1, 2])
@pytest.mark.parametrize("friction", [0.1, 0.4, 0.8])
def test_frictional_solutions_keep_to_their_limits(friction, rigid):
    """Limits spread over points, so that one instance has points at them and points below."""
    at_limit = mixed = 0
    for seed in range(60):
        problem = instance(seed, friction, rigid=rigid)
        limit = np.random.default_rng(seed + 1000).uniform(0.01, 0.2, problem.n) * friction
        problem = replace(problem, lines=lines(problem.n, friction, limit=limit))
        solution = solve_contact(problem, np.full(problem.n, OPEN))
        assert solution is not None
        assert natural_residual(problem, solution) < 1e-8
        N, T = solution.forces[: problem.n], solution.forces[problem.n :]
        full = np.isclose(np.abs(T), limit) & (limit < friction * N)
        assert (solution.status[full] > STICK).all()
        below = (solution.status > STICK) & ~full
        at_limit += full.any()
        mixed += full.any() and below.any()
    assert at_limit > 25
    assert mixed > 15


@pytest.mark.parametrize("rigid", [0, 1, 2])
@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("limited", [False, True])
def test_frictional_solutions_keep_to_their_cohesion(friction, rigid, limited):
    seen, at_limit = set(), 0
    for seed in range(60):
        problem = instance(seed, friction, rigid=rigid)
        spread = np.random.default_rng(seed + 2000)
        cohesion = spread.uniform(0.01, 0.1, problem.n)
        limit = spread.uniform(0.02, 0.12, problem.n) if limited else np.inf
        problem = replace(problem, lines=lines(problem.n, friction, cohesion, limit))
        solution = solve_contact(problem, np.full(problem.n, OPEN))
        assert solution is not None
        assert natural_residual(problem, solution) < 1e-8
        N, T = solution.forces[: problem.n], solution.forces[problem.n :]
        assert not T[N <= 0].any()
        at_limit += limited and np.isclose(np.abs(T), limit).any()
        seen |= set(solution.status.tolist())
    assert seen == {OPEN, STICK, FORWARD, BACKWARD}
    assert at_limit > 15 or not limited


@pytest.mark.parametrize("rigid", [0, 1, 2])
def test_frictional_solutions_keep_to_a_bound_of_many_lines(rigid):
    """Tangents of 0.1 (1 - exp(-8 N)): points slip on several of them."""
    seen, on = set(), set()
    load = np.append(np.geomspace(0.01, 0.5, 8), np.inf)
    slope = np.append(0.8, 0.8 * np.exp(-8 * load))
    level = np.append(0.0, 0.1 - np.exp(-8 * load) * (0.1 + 0.8 * np.append(load[:-1], 0.0)))
    for seed in range(60):
        problem = instance(seed, 0.8, rigid=rigid)
        many = BoundLines(*(np.tile(of[:, None], problem.n) for of in (slope, level)))
        problem = replace(problem, lines=many)
        solution = solve_contact(problem, np.full(problem.n, OPEN))
        assert solution is not None
        assert natural_residual(problem, solution) < 1e-8
        seen |= set(solution.status.tolist())
        slips = solution.status > STICK
        on |= set(many.piece(solution.forces[: problem.n])[slips].tolist())
    assert seen == {OPEN, STICK, FORWARD, BACKWARD}
    assert len(on) > 5


def test_a_limit_that_is_not_reached_changes_no_number():
    for seed in range(40):
        problem = instance(seed, 0.4, rigid=seed % 3)
        start = np.full(problem.n, STICK)
        free = solve_contact(problem, start)
        limited = replace(problem, lines=lines(problem.n, 0.4, limit=1e3))
        limited = solve_contact(limited, start)
        assert np.array_equal(free.forces, limited.forces)
        assert np.array_equal(free.status, limited.status)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_the_answer_does_not_depend_on_where_the_active_sets_start(friction):
    """The solution is unique while normal and tangential motion are coupled weakly."""
    for seed in range(40):
        problem = instance(seed, friction, coupling=0.1)
        rng = np.random.default_rng(seed + 1000)
        answers = []
        for _ in range(8):
            solution = solve_contact(problem, rng.integers(0, 4 if friction else 2, problem.n))
            assert solution is not None
            answers.append(solution.forces)
        scale = np.abs(answers[0]).max()
        assert max(np.abs(a - answers[0]).max() for a in answers) < 1e-8 * scale


def test_the_fallback_satisfies_the_conditions_where_active_sets_cycle():
    pivoted = 0
    for seed in range(300):
        problem = instance(seed, 0.6, coupling=0.6)
        solution = solve_contact(problem, np.full(problem.n, STICK))
        if solution is not None and solution.pivoted:
            pivoted += 1
            assert natural_residual(problem, solution) < 1e-8
    assert pivoted >= 3


def test_a_load_that_pulls_a_floating_body_off_has_no_solution():
    problem = instance(0, 0.0, rigid=1, frictional=False)
    pulled = ContactProblem(
        W=problem.W,
        offset=problem.offset,
        lines=problem.lines,
        A=problem.A,
        balance=-problem.balance,
    )
    assert solve_contact(pulled, np.full(problem.n, STICK)) is None


def test_no_contact_points_balance_no_load_only():
    def empty(k):
        return ContactProblem(
            W=np.zeros((0, 0)),
            offset=np.zeros(0),
            lines=BoundLines.none(0),
            A=np.zeros((0, k)),
            balance=np.zeros(k),
        )

    nothing = np.zeros(0, dtype=int)
    solution = solve_contact(empty(0), nothing)
    assert solution is not None
    assert solution.forces.size == 0
    assert solve_contact(empty(1), nothing) is None


def test_the_data_given_are_not_changed():
    problem = instance(3, 0.4, rigid=2)
    start = np.full(problem.n, OPEN)
    before = [a.copy() for a in (problem.W, problem.offset, problem.A, problem.balance, start)]
    assert solve_contact(problem, start) is not None
    after = (problem.W, problem.offset, problem.A, problem.balance, start)
    assert all(np.array_equal(a, b) for a, b in zip(before, after, strict=True))


def test_lemke_solves_random_positive_definite_problems():
    rng = np.random.default_rng(5)
    for n in (1, 5, 30):
        X = rng.standard_normal((n, n))
        M, r = X @ X.T + 0.1 * np.eye(n), rng.standard_normal(n)
        z, solved = lemke(M, r, 100 * n)
        assert solved
        w = M @ z + r
        assert np.abs(np.minimum(w, z)).max() < 1e-9


def test_lemke_says_so_where_there_is_no_solution():
    _, solved = lemke(np.array([[0.0, 0.0], [0.0, 1.0]]), np.array([-1.0, 1.0]), 100)
    assert not solved


def test_a_point_that_friction_lifts_slips_the_way_it_moves_where_its_bound_was_zero():
    """Stick pulls, open overlaps, and passes hold a bound of zero and one that opens the point.

    A second point stays closed.
    """
    one = np.array([[1.0, 0.9], [0.9, 1.0]])
    problem = ContactProblem(
        W=np.kron(one, np.diag([1.0, 0.0])) + np.kron(np.eye(2), np.diag([0.0, 1.0])),
        offset=np.array([-1.0, -1.0, -5.0, 0.0]),
        lines=lines(2, 1.3),
        A=np.zeros((4, 0)),
        balance=np.zeros(0),
    )
    found = solve_contact(problem, np.array([STICK, STICK]))
    assert found is not None
    normal = 1 / (1 + 1.3 * 0.9)
    np.testing.assert_allclose(found.forces, [normal, 1.0, 1.3 * normal, 0.0], atol=1e-12)
    assert found.status.tolist() == [BACKWARD, STICK]


def test_two_points_at_one_place_do_not_hold_a_body_that_may_tilt():
    problem = ContactProblem(
        W=np.array(
            [[1.87780333174076, -1.373420995404054], [-1.373420995404054, 1.17402163736985]]
        ),
        offset=np.array([0.21327155, 0.45899312]),
        lines=BoundLines.none(2),
        A=np.full((2, 2), [1.0, 6.405920704482398]),
        balance=np.array([-1.0, -6.405920704482398]),
    )
    assert given_bound(problem, np.zeros(2)) is None


@pytest.mark.parametrize("seed", range(4))
def test_a_ring_between_plates_is_held_where_friction_alone_could_bear_the_load(seed):
    """Its points lean: with friction bounds that are given, forces along them may bear a plate."""
    n, radius, angle = 12, 5.4, np.array([-0.125, -0.075, -0.025, 0.025, 0.075, 0.125])
    c, s, one, none = np.cos(angle), np.sin(angle), np.ones(6), np.zeros(6)
    columns = [(s, -c, none, c), (-s, c, none, none), (-c, -s, one, s), (c, s, one, none)]
    A = np.vstack([np.stack(own, axis=1) for own in columns])  # ring: x, y, rotation; plate: y
    gap = radius * (angle**2 - 0.025**2) / 2 - 1.4e-5
    slip = 7e-5 - 5.6e-3 * angle
    B = np.eye(2 * n) + 0.1 * np.random.default_rng(seed).normal(size=(2 * n, 2 * n))
    problem = ContactProblem(
        W=4e-5 * B @ B.T,
        offset=np.concatenate([gap, gap, slip, slip]),
        lines=lines(n, 0.3),
        A=A,
        balance=np.array([0.0, 0.0, 0.0, -0.2115]),
    )
    found = solve_contact(problem, np.full(n, OPEN))
    assert found is not None
    assert found.forces[:6].sum() == pytest.approx(0.2115, rel=0.01)
    assert natural_residual(problem, found) < 1e-8


def ring_on_two_points(lean, rounding=0.0):
    """A ring between plates, on two points of each, that spread: all slip, and it may shift.

    Its points lean by an angle; the plates' gaps do not change as it shifts, but as it turns.
    """
    c, s, one, none = np.cos(lean), np.sin(lean), np.ones(2), np.zeros(2)
    way = np.array([-s, s])
    columns = [(way, -c * one, none, c * one), (-way, c * one, none, none),
               (-c * one, -way, one, way), (c * one, way, one, none)]  # fmt: skip
    A = np.vstack([np.stack(own, axis=1) for own in columns])  # ring: x, y, rotation; plate: y
    G = A.copy()
    G[:4] = np.array([[0.0, -1, -s, 1], [0, -1, s, 1], [0, 1, -s, 0], [0, 1, s, 0]]) / c
    near = np.full((2, 2), 0.9) + 0.1 * np.eye(2)
    return ContactProblem(
        W=2e-4 * np.kron(np.eye(4), near),
        offset=np.concatenate([
            np.full(4, -1e-6) + rounding * np.array([1, -1, -1, 1]),
            7e-6 * np.array([1, -1, 1, -1]),
        ]),
        lines=lines(4, 0.3),
        A=A,
        balance=np.array([0.0, 0.0, 0.0, -7.5e-3]),
        G=G,
    )  # fmt: skip


@pytest.mark.parametrize("rounding", [0.0, 2e-17, -2e-17])
def test_a_ring_that_slips_on_all_points_is_held_whatever_its_positions_round_to(rounding):
    """Nothing resists a shift: what rounding leaves of its balance must not move it."""
    problem = ring_on_two_points(0.025, rounding)
    start = np.array([FORWARD, BACKWARD, FORWARD, BACKWARD])
    found = solve_contact(problem, start)
    assert found is not None
    assert not found.pivoted
    assert np.array_equal(found.status, start)
    assert np.abs(problem.balance + problem.A.T @ found.forces).max() < 1e-12 * 7.5e-3
    assert natural_residual(problem, found) < 1e-8
    assert np.abs(found.rigid[0]) < 1e-9


def test_a_ring_that_turns_rests_on_both_points_again():
    """The gaps tell how far it has turned; along forces they tell nothing of a turn."""
    problem = ring_on_two_points(0.025)
    turned = replace(problem, offset=problem.offset + problem.turned @ np.array([0, 0, 2e-6, 0]))
    found = solve_contact(turned, np.array([FORWARD, BACKWARD, FORWARD, BACKWARD]))
    assert found is not None
    assert found.rigid[2] == pytest.approx(-2e-6, rel=1e-6)
    blind = solve_contact(replace(turned, G=None), found.status)
    assert blind is None or abs(blind.rigid[2] + 2e-6) > 1e-6


@pytest.mark.parametrize("push", [1e-6, -1e-6, 1e-4])
def test_a_ring_that_slips_on_all_points_is_pushed_until_one_sticks(push):
    problem = ring_on_two_points(0.025)
    problem = replace(problem, balance=problem.balance + np.array([push, 0, 0, 0]))
    start = np.array([FORWARD, BACKWARD, FORWARD, BACKWARD])
    found = solve_contact(problem, start)
    assert found is not None
    assert not found.pivoted
    assert (found.status == STICK).any()
    assert np.sign(found.rigid[0]) == np.sign(push)
    assert natural_residual(problem, found) < 1e-8


def test_a_round_body_without_friction_is_pressed_though_nothing_resists_its_turn():
    """Its gaps change as it turns, but no force does work: the split of forces is not unique."""
    problem = ContactProblem(
        W=1e-3 * (np.eye(2) + 0.5),
        offset=np.array([-1e-6, 3e-6]),
        lines=BoundLines.none(2),
        A=np.array([[1.0, 0.0], [1.0, 0.0]]),
        balance=np.array([-1.0, 0.0]),
        G=np.array([[1.0, -0.1], [1.0, 0.1]]),
    )
    touched = np.ones(2, dtype=bool)
    found = solve_linked(problem, np.zeros((0, 2)), touched, np.array([STICK, STICK]))
    assert found is not None
    assert natural_residual(problem, found) < 1e-8


@pytest.mark.parametrize(("lean", "times"), [(0.0, 1), (0.1, 2)])
def test_a_load_that_nothing_bears_is_tried_again_only_if_normals_lean(monkeypatch, lean, times):
    problem = instance(1, 0.4, rigid=2)
    pulled = replace(problem, balance=-problem.balance, G=problem.A + lean * np.eye(24, 2))
    tried = []
    monkeypatch.setattr(complementarity, "_lag_bound", tried.append)
    assert solve_linked(pulled, np.zeros((0, 2)), np.ones(2, dtype=bool), np.full(12, OPEN)) is None
    assert len(tried) == times


@pytest.mark.parametrize("aside", [1e-9, -0.3])
def test_a_body_tilts_about_its_only_point_until_the_next_one_closes(aside):
    x, none = np.array([-1.0, -0.5, 0.0, 0.5, 1.0]), np.zeros(5)
    gap = np.concatenate([np.ones(5), none])
    problem = ContactProblem(
        W=1e-3 * np.eye(10),
        offset=np.concatenate([0.02 * x**2, none]),
        lines=lines(5, 0.3),
        A=np.stack([gap, np.concatenate([x, none]), np.concatenate([none, np.ones(5)])], axis=1),
        balance=np.array([-1.0, -aside, 0.0]),
    )
    found = solve_contact(problem, np.array([OPEN, OPEN, STICK, OPEN, OPEN]))
    assert found is not None
    assert not found.pivoted
    assert (found.forces[:5] > 0).sum() == 2
    assert natural_residual(problem, found) < 1e-8
