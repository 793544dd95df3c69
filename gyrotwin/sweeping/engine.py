"""A sweep on Dask: batches go to workers, rows come back in any order and are on disk as soon as they do."""

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread
from typing import Any, Final

from gyro_model.errors import InputError
from gyro_model.progress import Progress
from gyrotwin import __version__
from gyrotwin.sweeping import rows
from gyrotwin.sweeping.plan import Point
from gyrotwin.sweeping.scale import LARGEST_BATCH
from gyrotwin.sweeping.work import Done, Job, work

LOGGER = logging.getLogger("gyrotwin")

BATCH_SECONDS: Final = 0.5
"""A batch is to last so long: a hundred times what the scheduler takes for it."""
AHEAD: Final = 2
"""Batches a worker has at hand, so that none waits for the scheduler."""

LONELY_S, LOOKS = 40.0, 10
"""So long [s] a cluster may have no worker, and looks meanwhile: a nanny starts one anew within seconds."""


@contextmanager
def cluster(workers: int | None, scheduler: str | None) -> Iterator[Any]:
    """A client of the cluster at the address ``scheduler``, or of one on this machine with so many processes.

    Raises InputError where Dask is missing, there are no processes, nobody answers, or workers have another version of
    this package.
    """
    check_dask()
    if workers is not None and workers < 1:
        raise InputError(f"--workers {workers}: give 1 or more")
    from distributed import Client, LocalCluster

    logging.getLogger("distributed").setLevel(logging.ERROR)
    local = None
    if scheduler is None:
        LOGGER.info("starting workers ...")
        local = LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0", protocol="tcp://",
            host="127.0.0.1", silence_logs=logging.CRITICAL,
        )  # fmt: skip
    try:
        client = Client(local if local is not None else scheduler, timeout="20s")
    except (OSError, ValueError) as error:
        raise InputError(f"--scheduler {scheduler}: {error}") from None
    try:
        _check_versions(client)
        with _kept_alive(local, len(client.ncores())):
            yield client
    finally:
        client.close()
        if local is not None:
            local.close()


@contextmanager
def _kept_alive(local: Any, workers: int) -> Iterator[None]:
    """Gives a ``local`` cluster new workers where all are gone and do not come back: a nanny whose new worker does not
    start in time, as on a machine with much else to do, gives up, and a sweep would wait for ever."""
    ended = Event()

    def watch() -> None:
        alone, patience = 0, LOOKS
        while not ended.wait(LONELY_S / LOOKS):
            alone = 0 if local.scheduler_info["workers"] else alone + 1
            if alone == patience:
                LOGGER.info("all workers are gone: starting new ones ...")
                local.scale(0)
                local.scale(workers)
                # Where they are slow to start the next ones have longer, or none would ever be up.
                alone, patience = 0, 2 * patience

    watcher = Thread(target=watch, daemon=True)
    if local is not None:
        watcher.start()
    try:
        yield
    finally:
        ended.set()
        if local is not None:
            watcher.join()


def _check_versions(client: Any) -> None:
    for address, version in client.run(_version).items():
        if version != __version__:
            raise InputError(f"worker {address}: has gyrotwin {version}, this is {__version__}; install the same there")


def _version() -> str:
    return __version__


def check_dask() -> None:
    """Raises InputError where Dask is missing."""
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise InputError('sweep: needs Dask; install it by `pip install "gyrotwin[sweep]"`') from None


def sweep(client: Any, job: Job, points: Sequence[Point], folder: Path, progress: Progress | None = None) -> None:
    """Works off ``points``; their rows are added to ``folder`` as they come."""
    from distributed import as_completed

    waiting = iter(points)
    finished, seconds = 0, 0.0
    size = 1
    running = as_completed()
    batches: dict[str, list[Point]] = {}
    suspects: list[Point] = []

    def submit(batch: list[Point]) -> None:
        future = client.submit(work, job, list(batch), pure=False)
        batches[future.key] = batch
        running.add(future)

    cores = max(sum(client.ncores().values()), 1)
    for batch in _some(waiting, AHEAD * cores, size):
        submit(batch)
    for future in running:
        batch = batches.pop(future.key)
        if future.status != "finished":
            # Each alone, when nothing else runs: then it shows which of them ends its worker.
            suspects += batch
            continue
        done: list[Done] = future.result()
        rows.add(folder, done)
        finished += len(done)
        seconds += sum(d.seconds for d in done)
        size = min(max(int(BATCH_SECONDS * finished / max(seconds, 1e-9)), 1), LARGEST_BATCH)
        if progress is not None:
            progress(finished, len(points))
        for batch in _some(waiting, 1, size):
            submit(batch)
    for k, point in enumerate(suspects, 1):
        rows.add(folder, _alone(client, job, point))
        if progress is not None:
            progress(finished + k, len(points))


def _alone(client: Any, job: Job, point: Point) -> list[Done]:
    future = client.submit(work, job, [point], pure=False)
    try:
        done: list[Done] = future.result()
    except Exception as error:  # dask's own, or what it could not send
        done = [Done(point, {}, f"worker died: {error}".splitlines()[0], 0.0)]
    return done


def _some(waiting: Iterator[Point], count: int, size: int) -> Iterator[list[Point]]:
    for _ in range(count):
        batch = [point for _, point in zip(range(size), waiting, strict=False)]
        if batch:
            yield batch
