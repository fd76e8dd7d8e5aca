"""A conversion in units, which processes of one machine or of many do together.

All of them see the folder of the job, the inputs and the place of the output under the same paths. These are the five
commands of ``pointmill job``, and :func:`batches`, which shares units out. Nothing here knows Dask.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ._program import run as _call

#: A path, or text with one.
AnyPath = str | os.PathLike[str]

#: Inputs whose names are longer together go into a file: the system limits what a command line holds.
_LONGEST_COMMAND = 100_000

#: What a unit costs beside its points, in points: files that are opened, nodes that are made of others.
_UNIT_POINTS = 20_000

#: Units per process; a name takes some 20 bytes of the command line.
_MOST_UNITS = 20_000


@dataclass(frozen=True)
class Unit:
    """What one process does at once."""

    #: As the program calls it, such as ``build-0-17``.
    name: str
    #: ``read``, ``settle`` or ``build``.
    kind: str
    #: Points that it decodes or builds, as far as known.
    points: int
    #: Names of units of the same listing that must be done before.
    needs: tuple[str, ...]
    done: bool

    @property
    def stage(self) -> str:
        """Its name without the number: the pass that it reads, or the outputs that it builds."""
        return self.name.rpartition("-")[0]


@dataclass(frozen=True)
class Listing:
    """The units of the stage that a job has reached, in an order in which they can be done."""

    #: All is done: what is left is to finish.
    complete: bool
    units: tuple[Unit, ...]

    @property
    def open(self) -> list[Unit]:
        """Units that are not done."""
        return [unit for unit in self.units if not unit.done]


@dataclass(frozen=True)
class Batch:
    """Units that one process does; none needs another one of them."""

    stage: str
    units: tuple[str, ...]
    points: int
    #: Numbers of the batches before it that must be done.
    needs: tuple[int, ...]


def plan(inputs: Iterable[AnyPath] | AnyPath, out: AnyPath, job: AnyPath, options: Sequence[str] = ()) -> None:
    """Plans a conversion of ``inputs`` to ``out`` in the folder ``job``, which is made.

    ``options`` are those of ``pointmill convert``. Paths in them are absolute, or relative to the folder above the job.

    Raises:
        PointmillError: The inputs, an option or the folder cannot be used.
    """
    paths = absolute(inputs)
    folder = Path(job).absolute()
    folder.parent.mkdir(parents=True, exist_ok=True)
    sources = paths
    if sum(len(path) + 1 for path in paths) > _LONGEST_COMMAND:
        _list_file(folder).write_text("".join(f"{path}\n" for path in paths), encoding="utf-8")
        sources = ["--files-from", str(_list_file(folder))]
    # the folder that a job was planned in must be there on every machine; the one above the job is
    where = ["-o", str(Path(out).absolute()), "--job", str(folder)]
    _call(["job", "plan", *where, *options, "-q", *sources], cwd=folder.parent)


def absolute(paths: Iterable[AnyPath] | AnyPath) -> list[str]:
    """Paths and patterns that mean the same in every folder."""
    given = [paths] if isinstance(paths, str | os.PathLike) else paths
    return [str(Path(path).absolute()) for path in given]


def units(job: AnyPath) -> Listing:
    """The units of a job that are known.

    Raises:
        PointmillError: There is no job, or an input is not as it was.
    """
    listed = json.loads(_call(["job", "units", "--json", "-q", job]))
    known = (Unit(u["name"], u["kind"], u["points"], tuple(u["needs"]), u["done"]) for u in listed["units"])
    return Listing(listed["complete"], tuple(known))


def run(job: AnyPath, names: Sequence[str], *, threads: int | None = None, memory: int | str | None = None) -> None:
    """Does units in one process of ``threads`` threads and at most ``memory`` bytes (or a text such as ``"4GiB"``).

    A unit that is done already is not done again.

    Raises:
        PointmillError: A unit cannot be done, or needs one that is not done.
    """
    _call(["job", "run", job, *_resources(threads, memory), "-q", *names])


def finish(job: AnyPath, *, threads: int | None = None, memory: int | str | None = None) -> dict[str, Any]:
    """Puts the results of all units together, removes the job, and returns the report of the conversion.

    Raises:
        PointmillError: Units are not done, or the output cannot be written.
    """
    report: dict[str, Any] = json.loads(_call(["job", "finish", job, *_resources(threads, memory), "-q", "--json"]))
    _list_file(Path(job).absolute()).unlink(missing_ok=True)
    return report


def status(job: AnyPath) -> dict[str, Any]:
    """How far a job is: ``complete``, and for each kind of units how many there are and how many are done.

    Raises:
        PointmillError: There is no job, or an input is not as it was.
    """
    known: dict[str, Any] = json.loads(_call(["job", "status", "--json", "-q", job]))
    return known


def batches(listed: Iterable[Unit], slots: int, per_slot: int = 4, least_points: int = 4_000_000) -> list[Batch]:
    """Shares out the units that are not done, for ``slots`` processes that run at a time.

    The batches come in layers: what needs nothing, what needs units of that alone, and so on. A layer is cut into at
    most ``slots * per_slot`` runs of units that follow one another, hence are neighbours, with about the same number of
    points; into no more than ``slots`` if they would have fewer than ``least_points``, since each process has to open
    the job.
    """
    depth: dict[str, int] = {}
    layers: dict[tuple[int, str], list[Unit]] = {}
    for unit in listed:
        if not unit.done:
            # those that are done are not in depth, and not waited for
            depth[unit.name] = 1 + max((depth[need] for need in unit.needs if need in depth), default=-1)
            layers.setdefault((depth[unit.name], unit.stage), []).append(unit)
    made: list[Batch] = []
    batch_of: dict[str, int] = {}
    for (_, stage), layer in sorted(layers.items(), key=lambda item: item[0]):
        for part in _cut(layer, slots, per_slot, least_points):
            needs = {batch_of[need] for unit in part for need in unit.needs if need in batch_of}
            batch_of.update((unit.name, len(made)) for unit in part)
            points = sum(unit.points for unit in part)
            made.append(Batch(stage, tuple(unit.name for unit in part), points, tuple(sorted(needs))))
    return made


def _cut(layer: list[Unit], slots: int, per_slot: int, least_points: int) -> list[list[Unit]]:
    """Runs of units with about the same number of points."""
    total = sum(unit.points + _UNIT_POINTS for unit in layer)
    wanted = max(slots, -(-total // max(1, least_points)), -(-len(layer) // _MOST_UNITS))
    count = max(1, min(len(layer), slots * per_slot, wanted), -(-len(layer) // _MOST_UNITS))
    parts: list[list[Unit]] = []
    before, last = 0, -1
    for unit in layer:
        weight = unit.points + _UNIT_POINTS
        number = (2 * before + weight) * count // (2 * total)
        if number != last or len(parts[-1]) >= _MOST_UNITS:
            parts.append([])
            last = number
        parts[-1].append(unit)
        before += weight
    return parts


def _resources(threads: int | None, memory: int | str | None) -> list[str]:
    """Options of a process."""
    given = (("--threads", threads), ("--memory", memory))
    return [word for option, value in given if value is not None for word in (option, str(value))]


def _list_file(folder: Path) -> Path:
    """Where long lists of inputs are; the folder of the job must be empty when it is planned."""
    return folder.with_name(f"{folder.name}.inputs")
