"""Conversions on Dask distributed: units of a job become tasks of any cluster that a client is connected to.

The package and the program are installed on all workers, in one version. Workers, and the client if it likes, see the
inputs, the output and the folder of the job under the same paths. Tasks start processes of the program; their results
are files in the folder of the job, so what Dask moves is a line per task.
"""

from __future__ import annotations

import logging
import uuid
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from distributed import Client, Future, as_completed, default_client

from . import jobs
from ._program import PointmillError
from .jobs import AnyPath, Batch, Listing, Unit

_log = logging.getLogger("pointmill")

#: Exit codes that another attempt cannot mend: a broken input, what is not supported, too little memory, faults found.
_FINAL = (3, 4, 6, 7)

#: Exit code for units whose needs are not there (a file that was damaged is removed, and its unit done again).
_USAGE = 2

#: Of a worker's memory per thread, what a process may take: the worker itself needs some.
_SHARE = 0.9


@dataclass(frozen=True)
class Progress:
    """How far the stage of a job is. Later stages are known when it is done."""

    #: ``read``, ``settle`` or ``build``.
    kind: str
    points_done: int
    points: int
    units_done: int
    units: int

    @classmethod
    def of(cls, listing: Listing) -> Progress:
        """Of a stage as it is listed."""
        done = [unit for unit in listing.units if unit.done]
        kind = listing.units[0].kind if listing.units else ""
        points = sum(unit.points for unit in listing.units)
        return cls(kind, sum(unit.points for unit in done), points, len(done), len(listing.units))

    def after(self, batch: Batch) -> Progress:
        """When the batch is done, too."""
        done = (self.points_done + batch.points, self.units_done + len(batch.units))
        return replace(self, points_done=done[0], units_done=done[1])


def convert(
    inputs: Iterable[AnyPath] | AnyPath,
    out: AnyPath,
    *,
    job: AnyPath | None = None,
    client: Client | None = None,
    options: Sequence[str] = (),
    batches_per_worker: int = 4,
    threads: int = 1,
    memory: int | str | None = None,
    resources: Mapping[str, float] | None = None,
    retries: int = 3,
    progress: Callable[[Progress], None] | None = None,
) -> dict[str, Any]:
    """Converts scans (files, folders, patterns) to the dataset ``out`` and returns the report.

    Args:
        inputs: Files, folders or patterns, as the workers see them.
        out: The folder of the dataset.
        job: Folder for what the processes leave, ``OUT.job`` if nothing is said; made here, removed at the end.
        client: Of a cluster, such as a ``LocalCluster`` or one of dask-jobqueue; without it, the current one.
        options: Those of ``pointmill convert``, such as ``["--to", "copc"]``; paths in them are absolute.
        batches_per_worker: Tasks per thread of a worker and layer of units. More lose less when a worker is lost, and
            start more processes.
        threads: Threads of each process; a Dask worker runs as many processes as it has threads itself.
        memory: Limit of each process in bytes or as text such as ``"4GiB"``; without it, 90 % of what the smallest
            worker has per thread.
        resources: What Dask must have free on a worker for a task, such as ``{"memory": 4e9}``; needs workers that
            declare it.
        retries: Attempts of a task after one that failed for a reason that may pass.
        progress: Called after each task.

    Raises:
        PointmillError: The program failed; the exception's text is its line. The job stays: :func:`resume` goes on.
    """
    cluster = _Cluster.of(client, batches_per_worker, threads, memory, resources, retries)
    (place,) = jobs.absolute(out)  # a task works in another folder
    (folder,) = jobs.absolute(f"{place}.job" if job is None else job)
    limit = [] if any(option.split("=")[0] == "--memory" for option in options) else cluster.memory_options()
    cluster.call("plan", jobs.plan, jobs.absolute(inputs), place, folder, [*options, *limit])
    return _do(cluster, folder, progress)


def resume(
    job: AnyPath,
    *,
    client: Client | None = None,
    batches_per_worker: int = 4,
    threads: int = 1,
    memory: int | str | None = None,
    resources: Mapping[str, float] | None = None,
    retries: int = 3,
    progress: Callable[[Progress], None] | None = None,
) -> dict[str, Any]:
    """Goes on with a job that :func:`convert` or ``pointmill job plan`` has planned; arguments as there."""
    cluster = _Cluster.of(client, batches_per_worker, threads, memory, resources, retries)
    return _do(cluster, jobs.absolute(job)[0], progress)


@dataclass(frozen=True)
class _Cluster:
    """Where tasks run, and what each may take."""

    client: Client
    batches_per_worker: int
    threads: int
    memory: int | str | None
    resources: dict[str, float]
    retries: int
    token: str

    @classmethod
    def of(
        cls,
        client: Client | None,
        batches_per_worker: int,
        threads: int,
        memory: int | str | None,
        resources: Mapping[str, float] | None,
        retries: int,
    ) -> _Cluster:
        client = default_client() if client is None else client
        if client.asynchronous:
            raise TypeError("pointmill.dask needs a client that is not asynchronous")
        client.wait_for_workers(1)
        memory = _memory_of(client) if memory is None else memory
        return cls(client, batches_per_worker, threads, memory, dict(resources or {}), retries, uuid.uuid4().hex[:8])

    def memory_options(self) -> list[str]:
        """The limit for processes that are given no other."""
        return [] if self.memory is None else ["--memory", str(self.memory)]

    def slots(self) -> int:
        """Processes that run at a time."""
        return max(1, sum(int(threads) for threads in self.client.nthreads().values()))

    def submit(self, name: str, number: int, function: Callable[..., Any], *args: object) -> Future:
        """A task; the dashboard groups by the name."""
        return self.client.submit(
            function,
            *args,
            key=(f"pointmill-{name}-{self.token}", number),
            resources=self.resources,
            retries=self.retries,
            pure=False,
        )

    def call(self, name: str, function: Callable[..., Any], *args: object, number: int = 0) -> Any:  # noqa: ANN401
        """Result of a task."""
        return self.submit(name, number, function, *args).result()


def _memory_of(client: Client) -> int | None:
    """Bytes for a process: the share of a thread of the smallest worker."""
    workers = client.scheduler_info()["workers"].values()
    shares = [worker["memory_limit"] / worker["nthreads"] for worker in workers if worker["memory_limit"]]
    return int(min(shares) * _SHARE) if shares else None


def _do(cluster: _Cluster, job: str, progress: Callable[[Progress], None] | None) -> dict[str, Any]:
    """All stages of a job, in order."""
    tasks = failed = 0
    was_open: list[Unit] = []
    error: PointmillError | None = None
    while True:
        listing: Listing = cluster.call("units", jobs.units, job, number=tasks)
        if listing.complete:
            report: dict[str, Any] = cluster.call("finish", jobs.finish, job)
            return report
        batches = jobs.batches(listing.units, cluster.slots(), cluster.batches_per_worker)
        failed = 0 if listing.open != was_open else failed + 1
        was_open = listing.open
        if failed > cluster.retries or not batches:
            raise error or PointmillError(f"{job}: the same units stay open; see 'pointmill job status'", 1)
        error = _stage(cluster, job, listing, batches, tasks, progress)
        tasks += len(batches)


def _stage(
    cluster: _Cluster,
    job: str,
    listing: Listing,
    batches: Sequence[Batch],
    first_task: int,
    progress: Callable[[Progress], None] | None,
) -> PointmillError | None:
    """Does units that are listed. Returns what kept some of them from being done, for now."""
    kind = listing.open[0].kind if listing.open else ""
    _log.info("%s: %d units to %s, in %d tasks", job, len(listing.open), kind, len(batches))
    futures: list[Future] = []
    for batch in batches:
        needs = [futures[need] for need in batch.needs]
        arguments = (job, batch.units, cluster.threads, cluster.memory, needs)
        futures.append(cluster.submit(kind, first_task + len(futures), _run, *arguments))
    batch_of = {future.key: batch for future, batch in zip(futures, batches, strict=True)}
    state = Progress.of(listing)
    last: PointmillError | None = None
    try:
        for future in as_completed(futures):
            error: PointmillError | None = future.result()
            if error is not None and error.code in _FINAL:
                raise error
            last = error or last
            if error is None:
                state = state.after(batch_of[future.key])
                if progress is not None:
                    progress(state)
    except BaseException:
        cluster.client.cancel(futures)
        raise
    return last


def _run(
    job: str, units: Sequence[str], threads: int, memory: int | str | None, needs: Sequence[PointmillError | None]
) -> PointmillError | None:
    """A task: does units in a process. What another attempt of the same task cannot mend is returned, and kept from
    Dask, which would try again; the rest is raised, and Dask does.
    """
    for need in needs:
        if need is not None:
            return need
    try:
        jobs.run(job, units, threads=threads, memory=memory)
    except PointmillError as error:
        if error.code in _FINAL or error.code == _USAGE:
            return error
        raise
    return None
