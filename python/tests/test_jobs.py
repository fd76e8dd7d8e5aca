"""Sharing out units, and the commands of the program."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest
from conftest import UNITS
from scenes import content

from pointmill import PointmillError, find, jobs, run
from pointmill.jobs import Unit


def unit(name: str, points: int = 1_000, needs: tuple[str, ...] = (), done: bool = False) -> Unit:
    return Unit(name, name.partition("-")[0], points, needs, done)


def test_units_are_cut_by_points_and_keep_their_order() -> None:
    reads = [unit(f"read-1-{i}", 5_000_000 if i < 2 else 500_000) for i in range(40)]
    made = jobs.batches(reads, slots=2, per_slot=3)
    assert [name for batch in made for name in batch.units] == [u.name for u in reads]
    assert len(made) == 6
    assert all(batch.needs == () and batch.stage == "read-1" for batch in made)
    fair = sum(u.points for u in reads) / 6
    assert all(batch.points < fair + 5_000_000 for batch in made)


def test_few_points_do_not_start_more_processes_than_can_run() -> None:
    reads = [unit(f"read-1-{i}", 1_000) for i in range(100)]
    assert len(jobs.batches(reads, slots=3, per_slot=8)) == 3
    assert len(jobs.batches(reads, slots=3, per_slot=8, least_points=0)) == 24
    assert jobs.batches([], slots=3) == []


def test_no_process_gets_more_names_than_fit_into_a_command() -> None:
    reads = [unit(f"read-1-{i}", 1) for i in range(50_001)]
    made = jobs.batches(reads, slots=1, per_slot=1)
    assert [len(batch.units) <= 20_000 for batch in made] == [True] * len(made)
    assert sum(len(batch.units) for batch in made) == 50_001


def test_a_batch_needs_those_that_have_the_needs_of_its_units() -> None:
    builds = [
        unit("build-0-0", done=True),
        unit("build-0-1"),
        unit("build-0-2"),
        unit("build-0-3", needs=("build-0-0",)),
        unit("build-0-4", needs=("build-0-1", "build-0-2")),
        unit("build-0-5", needs=("build-0-4",)),
        unit("build-1-0"),
    ]
    made = jobs.batches(builds, slots=8, least_points=0)
    place = {name: number for number, batch in enumerate(made) for name in batch.units}
    assert set(place) == {u.name for u in builds[1:]}
    for one in builds[1:]:
        batch = made[place[one.name]]
        assert {place[need] for need in one.needs if need in place} <= set(batch.needs)
        assert all(number < place[one.name] for number in batch.needs)
        assert batch.stage == one.stage
    assert made[place["build-0-3"]].needs == ()


def test_a_job_in_this_process_makes_the_bytes_of_one_run(tmp_path: Path, scans: Path) -> None:
    run(["convert", *sorted(scans.iterdir()), "-o", tmp_path / "plain", "-q"])
    job = tmp_path / "job"
    jobs.plan([scans / "0.las", scans / "[123].las"], tmp_path / "out", job, UNITS)
    kinds: dict[str, None] = {}
    while not (listing := jobs.units(job)).complete:
        kinds.update((u.kind, None) for u in listing.open)
        for batch in jobs.batches(listing.units, slots=2):
            jobs.run(job, batch.units, threads=1, memory="1GiB")
    assert list(kinds) == ["read", "settle", "build"]
    assert jobs.status(job)["complete"]
    jobs.finish(job)
    assert content(tmp_path / "out") == content(tmp_path / "plain")
    assert not job.exists()


def test_many_inputs_go_into_a_file_that_goes_with_the_job(
    tmp_path: Path, scans: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(jobs, "_LONGEST_COMMAND", 10)
    job = tmp_path / "job"
    jobs.plan(sorted(scans.iterdir()), tmp_path / "out", job)
    assert (tmp_path / "job.inputs").read_text().count("\n") == 4
    while not (listing := jobs.units(job)).complete:
        for batch in jobs.batches(listing.units, slots=1):
            jobs.run(job, batch.units)
    jobs.finish(job)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out"]


def test_the_line_of_the_program_is_that_of_the_exception(tmp_path: Path) -> None:
    with pytest.raises(PointmillError, match=r"nothing\.las") as caught:
        jobs.plan(tmp_path / "nothing.las", tmp_path / "out", tmp_path / "job")
    error = caught.value
    assert not str(error).startswith("error") and "\n" not in str(error)
    again = pickle.loads(pickle.dumps(error))  # noqa: S301
    assert (str(again), again.code) == (str(error), error.code)
    with pytest.raises(PointmillError, match="job") as caught:
        jobs.units(tmp_path)
    assert caught.value.code == 2


def test_a_program_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("POINTMILL", raising=False)
    monkeypatch.setattr("sysconfig.get_path", lambda *_: None)
    monkeypatch.setattr("shutil.which", lambda _: None)
    with pytest.raises(FileNotFoundError, match="POINTMILL"):
        find()
