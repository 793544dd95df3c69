"""The time that a diagnosis may take: how it is counted, and what an answer says that ran out of it."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest
from hidden_sets import MODEL, SHORT, made, names

from discrepancy.clock import Clock, OutOfTime
from discrepancy.diagnose import diagnose
from discrepancy.fit.simulate import Simulator
from discrepancy.name import exchange
from discrepancy.name import extend as extending
from discrepancy.name.begin import begin
from discrepancy.name.search import Given, Search, attempt

CUBIC = {"k3_x": 2e9, "k3_y": 2e9}


def work(seconds: float) -> None:
    """Keeps a core busy for as long by its own clock."""
    clock = Clock()
    while clock.now < seconds:
        pass


def test_waiting_is_no_work() -> None:
    # In a process of its own: threads that other tests left behind work on.
    waits = "from time import sleep; from discrepancy.clock import Clock; c = Clock(); sleep(0.2); print(c.now)"
    told = subprocess.run([sys.executable, "-c", waits], capture_output=True, text=True, check=True)
    # A process that sleeps takes less than a hundredth.
    assert float(told.stdout) < 0.02


@pytest.mark.parametrize(("parts", "counted"), [([0.2] * 4, 0.2), ([0.1] * 8, 0.2), ([0.2], 0.2), ([0.2, 0.05], 0.2)])
def test_work_side_by_side_counts_as_on_threads_that_have_a_core_each(parts: list[float], counted: float) -> None:
    alone, shared = Clock(4), Clock(4)
    with shared.side_by_side() as batch, ThreadPoolExecutor(1) as pool:
        list(pool.map(batch.part(work), parts))
    # Both see what else the process does.
    assert alone.now - shared.now == pytest.approx(sum(parts) - counted, abs=0.03)


@pytest.mark.parametrize(("callers", "counted"), [(1, 0.13), (4, 0.37)])
def test_a_part_that_works_side_by_side_itself(callers: int, counted: float) -> None:
    """Alone it has all threads; four that do so share them."""
    alone, shared = Clock(4), Clock(4)

    def nested(_: int) -> None:
        work(0.05)
        with shared.side_by_side() as batch, ThreadPoolExecutor(1) as inner:
            list(inner.map(batch.part(work), [0.08] * 4))

    with shared.side_by_side() as batch, ThreadPoolExecutor(1) as pool:
        list(pool.map(batch.part(nested), range(callers)))
    assert alone.now - shared.now == pytest.approx(callers * 0.37 - counted, abs=0.03)


def test_a_simulation_after_the_end_is_refused() -> None:
    record = made({}, samples=SHORT).records[0]
    with Simulator(MODEL, jobs=1) as simulator:
        simulator.clock.until = 0.0
        with pytest.raises(OutOfTime):
            simulator.run_all([(record, {})])


@pytest.mark.parametrize(
    ("owner", "part", "said", "hidden", "verdict"),
    [
        (extending, "look", "scores of all effects", {}, "unexplained"),
        (extending, "accept", "refit with cubic_stiffness", CUBIC, "unexplained"),
        (exchange, "_exchange_one", "rivals of cubic_stiffness", CUBIC, "partly explained"),
    ],
)
def test_what_was_not_done_is_said_and_no_verdict_claims_it(
    owner: object, part: str, said: str, hidden: dict[str, float], verdict: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def ends(search: Search, *_: object, **__: object) -> None:
        raise OutOfTime

    monkeypatch.setattr(owner, part, ends)
    found = diagnose(made(hidden, samples=SHORT), MODEL)
    assert found.verdict == verdict
    assert names(found) == ({"cubic_stiffness"} if verdict == "partly explained" else set())
    [doubt] = [doubt for doubt in found.doubts if "time_limit" in doubt]
    assert said in doubt


def test_a_step_that_does_not_end_is_undone() -> None:
    data, lines = made({}, samples=SHORT), list[str]()
    with Simulator(MODEL, jobs=1) as simulator:
        begun = begin(Given(data, lines.append), simulator)
        lines.clear()

        def half(search: Search) -> Search:
            search = replace(search, refused=frozenset({"cubic_stiffness"}), full=True)
            simulator.clock.until = 0.0
            simulator.run(data.records[0], {})
            return search

        assert attempt(begun, "all of it", half) == replace(begun, undone=("all of it",))
    assert lines == ["out of time: all of it"]


def test_what_is_short_and_without_which_all_was_in_vain_is_not_cut_off() -> None:
    clock = Clock()
    clock.until = -1.0
    with clock.unhurried():
        clock.check()
    with pytest.raises(OutOfTime):
        clock.check()
