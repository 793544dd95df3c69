"""What a sweep of many devices would cost on more cores than are here.

Measured are the time of a task and what a real scheduler needs for one batch, with a worker in this process that
claims as many threads as the cluster has cores and does nothing in each. The rest is arithmetic: work on all cores, but
no faster than the scheduler hands it out.
"""

import time
from typing import Any, Final, NamedTuple

LARGEST_BATCH: Final = 500
"""Points of a batch at most, however short a task is."""
CORES: Final = (2, 100, 1000)
DEVICES: Final = 10_000
BATCHES: Final = 2000
"""Stub batches by which the scheduler is measured."""


class Cost(NamedTuple):
    """On so many cores: hours of the wall, seconds a batch that the scheduler takes, and who limits."""

    cores: int
    hours: float
    scheduler_seconds: float
    limit: str


class Scale(NamedTuple):
    """Seconds of a task as measured, points in a batch, costs, and the cores beyond which the scheduler limits."""

    task_seconds: float
    batch: int
    costs: tuple[Cost, ...]
    scheduler_limit: int


def simulate(task_seconds: float, batch_seconds: float, devices: int = DEVICES) -> Scale:
    """The costs of ``devices`` points of ``task_seconds`` each in batches of ``batch_seconds``."""
    batch = min(max(round(batch_seconds / task_seconds), 1), LARGEST_BATCH)
    each = {cores: _scheduler_seconds(cores) for cores in CORES}
    batches = -(-devices // batch)
    costs = []
    for cores, seconds in each.items():
        by_work = -(-batches // cores) * batch * task_seconds
        by_scheduler = batches * seconds
        limit = "cores" if by_work >= by_scheduler else "scheduler"
        costs.append(Cost(cores, max(by_work, by_scheduler) / 3600, seconds, limit))
    return Scale(task_seconds, batch, tuple(costs), int(batch * task_seconds / each[CORES[-1]]))


def _scheduler_seconds(threads: int) -> float:
    """Seconds that a scheduler takes for a batch, with a worker in this process that claims ``threads``."""
    from distributed import Client, LocalCluster, wait

    with (
        LocalCluster(
            n_workers=1, threads_per_worker=threads, processes=False, dashboard_address="127.0.0.1:0"
        ) as cluster,
        Client(cluster) as client,
    ):
        client.gather(client.map(_stub, range(50), pure=False))
        start = time.perf_counter()
        futures: Any = client.map(_stub, range(BATCHES), pure=False)
        wait(futures)
        return (time.perf_counter() - start) / BATCHES


def _stub(number: int) -> int:
    return number
