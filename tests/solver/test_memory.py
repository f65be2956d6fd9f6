"""What a process keeps for its next runs is bounded in bytes, and freed."""

from __future__ import annotations

import gc
import resource
import sys
import weakref
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from scipy import sparse

from solver import SCENES, ModelError, memory
from solver.linear.solvers import SOLVERS, analyse
from solver.memory import bytes_in, bytes_of, kept, most_kept, release

MB = 1_000_000


class Held:
    """A value with an array."""

    def __init__(self, size: float) -> None:
        self.array = np.ones(round(size * MB / 8))


made: Counter[str] = Counter()


@kept
def hold(name: str, size: float) -> Held:
    made[name] += 1
    return Held(size)


@pytest.fixture(autouse=True)
def nothing_kept() -> Iterator[None]:
    release(0)
    made.clear()
    yield
    release(0)


@pytest.fixture
def ten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(memory.SETTING, "10MB")


def holding_much(bytes_free: int) -> int:
    """Hold 100 MB again and again in a process with so much address space."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    space = pages * resource.getpagesize() + bytes_free
    resource.setrlimit(resource.RLIMIT_AS, (space, space))
    for k in range(20):
        hold(f"{k}", 100)
        hold(f"{k}", 100)
    return made.total()


@pytest.mark.processes
def test_what_is_kept_leaves_room_in_a_small_address_space() -> None:
    """What is kept usually, 300 MB, would not fit."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        assert pool.submit(holding_much, 250 * MB).result() == 20


@pytest.mark.usefixtures("ten")
def test_a_value_is_made_once_while_it_fits() -> None:
    for _ in range(3):
        hold("a", 4)
        hold("b", 4)
    assert made == {"a": 1, "b": 1}


@pytest.mark.usefixtures("ten")
def test_what_was_used_longest_ago_goes_first() -> None:
    for name in ("a", "b", "a", "c", "a", "b"):
        hold(name, 4)
        release()
    assert made == {"a": 1, "b": 2, "c": 1}


@pytest.mark.usefixtures("ten")
def test_a_smaller_value_is_kept_beside_one_that_does_not_fit() -> None:
    for name, size in (("small", 1), ("large", 20), ("other", 1), ("small", 1), ("large", 20)):
        hold(name, size)
    assert made == {"small": 1, "large": 2, "other": 1}


@pytest.mark.usefixtures("ten")
def test_what_a_path_used_is_there_for_the_next_path_even_if_it_does_not_fit() -> None:
    for _ in range(2):
        hold("small", 1)
        hold("large", 20)
        release()
    assert made == {"large": 1, "small": 1}
    hold("other", 1)
    release()
    hold("large", 20)
    assert made["large"] == 2


@pytest.mark.usefixtures("ten")
def test_a_value_in_use_is_found_even_if_it_does_not_fit() -> None:
    own = hold("large", 20)
    release(0)
    assert hold("large", 20) is own
    gone = weakref.ref(own)
    del own
    release(0)
    assert gone() is None


@pytest.mark.usefixtures("ten")
def test_a_value_that_grows_is_measured_again() -> None:
    hold("a", 1).more = np.ones(2 * MB)  # type: ignore[attr-defined]
    hold("b", 1)
    hold("a", 1)
    assert made["a"] == 2


def test_a_value_without_weak_references_is_kept() -> None:
    @kept
    def numbers() -> tuple[int, ...]:
        made["numbers"] += 1
        return (1, 2)

    assert [numbers(), numbers()] == [(1, 2), (1, 2)]
    assert made["numbers"] == 1


def test_a_failure_is_not_kept() -> None:
    @kept
    def fails() -> Held:
        made["fails"] += 1
        raise ModelError("size", 1, "must be larger")

    for _ in range(2):
        with pytest.raises(ModelError):
            fails()
    assert made["fails"] == 2


def test_what_two_hold_counts_once_and_a_view_has_its_array() -> None:
    array = np.ones(MB)
    view, both = bytes_of({"of": array[:3]}, {"also": array})
    assert view == pytest.approx(8 * MB, rel=0.01)
    assert both < 1000


@pytest.mark.parametrize("name", SOLVERS)
def test_the_bytes_of_a_solver_include_its_factor(name: str) -> None:
    """A factor has more entries than its matrix; the dense triangle is an upper bound."""
    n = 60
    line = sparse.diags_array([2.0, -1.0], offsets=[0, 1], shape=(n, n))
    upper = sparse.csr_array(sparse.triu(sparse.kron(line, sparse.eye_array(n)) + sparse.kron(
        sparse.eye_array(n), line), format="csr"))  # fmt: skip
    upper.sort_indices()

    solver = analyse(upper, name)
    solver.factorise(upper.data)
    beside_the_matrix = bytes_of(upper, solver)[1]
    assert 8 * upper.nnz < beside_the_matrix < 8 * n**4


def factors(*, collected: bool = True) -> set[int]:
    """Return the factors that something holds; results of other tests may hold some."""
    from solver.linear.pardiso import Pardiso

    if collected:
        gc.collect()
    return {id(each) for each in gc.get_objects() if isinstance(each, Pardiso)}


def walk(scene: str, value: float) -> None:
    """Compute a run of a scene, and keep nothing of it."""
    known = SCENES[scene]
    for record in known.path(known.parameters(accuracy="draft"), [value], lambda share: None):
        del record


@pytest.mark.solves
@pytest.mark.parametrize("scene, passes", [("punch", 0.3), ("rolling", 1)])
def test_no_factor_outlives_a_path_and_what_is_kept(scene: str, passes: float) -> None:
    before = factors()
    walk(scene, passes)
    release(0)
    assert not factors() - before


@pytest.mark.solves
@pytest.mark.parametrize("scene", ["raceway", "rolling"])
def test_the_factors_of_a_pass_end_with_it(scene: str) -> None:
    """No circle of references holds them until the garbage collector comes by."""
    before = factors()
    gc.disable()
    try:
        walk(scene, 1)
        memory._evict(0)
        assert not factors(collected=False) - before
    finally:
        gc.enable()


@pytest.mark.parametrize(
    "text, size", [("500MB", 500 * MB), ("2 GiB", 2 << 30), ("1.5kB", 1500), ("0B", 0)]
)
def test_a_size_is_read(text: str, size: int) -> None:
    assert bytes_in(text) == size


@pytest.mark.parametrize("text", ["", "300", "MB", "-1MB", "3XB"])
def test_a_setting_that_is_no_size_is_refused(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(memory.SETTING, text)
    with pytest.raises(ModelError, match=f"{memory.SETTING} = .*must be a size such as 500MB"):
        most_kept()


@pytest.mark.skipif(sys.platform != "linux", reason="memory returns by itself elsewhere")
def test_free_memory_returns_to_the_system() -> None:
    def resident() -> int:
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096

    before = resident()
    each = [np.ones(1000) for _ in range(20_000)]  # smaller than what malloc maps apart
    last = np.ones(1000)
    del each
    release()
    assert resident() < before + 40 * MB
    del last


@pytest.mark.parametrize("before", ["kept", "held", "kept until then"])
def test_a_circle_of_references_is_freed_although_more_was_in_use_before(before: str) -> None:
    large = Held(160) if before == "held" else hold("large", 160)
    release()
    del large
    if before != "kept until then":
        release(0)
    one, other = Held(60), Held(1)  # more than is left alone, less than was in use
    one.other, other.other = other, one  # type: ignore[attr-defined]
    freed = weakref.ref(one)
    gc.disable()
    try:
        del one, other
        release(0)
        assert freed() is None
    finally:
        gc.enable()
