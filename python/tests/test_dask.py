"""Conversions on a cluster of this machine: workers are processes."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from conftest import OPTIONS, UNITS
from distributed import Client, LocalCluster
from scenes import content

from pointmill import PointmillError, find, run
from pointmill import dask as on_dask
from pointmill.jobs import plan, units

AUTZEN = Path(__file__).parents[2] / "fixtures/las/autzen_trim.laz"


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """What workers call: the program, or what a test puts in its place."""
    real, place = find(), tmp_path_factory.mktemp("program") / "pointmill"
    place.symlink_to(real)
    os.environ["POINTMILL"] = str(place)
    yield place
    os.environ["POINTMILL"] = real


@contextmanager
def faulty(program: Path, instead: str) -> Iterator[None]:
    """Puts a script before the program, for as long as it lasts."""
    real = program.readlink()
    program.unlink()
    program.write_text(f'#!/bin/sh\n{instead}\nexec "{real}" "$@"\n')
    program.chmod(0o755)
    yield
    program.unlink()
    program.symlink_to(real)


@pytest.fixture(scope="module")
def client(program: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    with (
        LocalCluster(
            n_workers=2,
            threads_per_worker=1,
            dashboard_address=None,
            local_directory=str(tmp_path_factory.mktemp("workers")),
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client


def test_laz_on_dask_is_laz_on_one_machine(tmp_path: Path, client: Client) -> None:
    run(["convert", AUTZEN, "-o", tmp_path / "plain", "--encoding", "brotli", "-q"])
    seen: list[on_dask.Progress] = []
    report = on_dask.convert(
        AUTZEN,
        tmp_path / "out",
        job=tmp_path / "job",
        client=client,
        options=["--encoding", "brotli", *UNITS],
        progress=seen.append,
    )
    assert content(tmp_path / "out") == content(tmp_path / "plain")
    assert report["points"]["kept"] == 110_000
    assert {state.kind for state in seen} == {"read", "settle", "build"}
    assert all(state.units_done <= state.units and state.points_done <= state.points for state in seen)
    assert seen[-1].units_done == seen[-1].units
    assert not (tmp_path / "job").exists()


def test_relative_paths_are_those_of_the_caller(
    tmp_path: Path, scans: Path, client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(scans.parent)
    assert client  # the current one is taken
    on_dask.convert("scans/0.las", os.path.relpath(tmp_path / "out"), job=os.path.relpath(tmp_path / "job"))
    assert content(tmp_path / "out")


def test_a_job_without_a_name_is_beside_the_output(tmp_path: Path, scans: Path, client: Client, program: Path) -> None:
    seen = tmp_path / "seen"
    with faulty(program, f'[ "$2" = run ] && ls "{tmp_path}/out.job" >> "{seen}"'):
        on_dask.convert(scans / "0.las", f"{tmp_path}/out/", client=client)
    assert "plan.json" in seen.read_text()
    assert content(tmp_path / "out")
    assert not (tmp_path / "out.job").exists()


def test_an_input_that_is_broken_ends_it_with_its_line(tmp_path: Path, scans: Path, client: Client) -> None:
    whole = (scans / "0.las").read_bytes()
    (tmp_path / "cut.las").write_bytes(whole)
    job = tmp_path / "job"
    plan(tmp_path / "cut.las", tmp_path / "out", job, UNITS)
    (tmp_path / "cut.las").write_bytes(whole[:-100])
    with pytest.raises(PointmillError, match=r"cut\.las") as caught:
        on_dask.resume(job, client=client)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_a_job_of_the_command_line_goes_on_where_it_is(
    tmp_path: Path, scans: Path, plain: dict[str, bytes], client: Client
) -> None:
    job = tmp_path / "job"
    run(["job", "plan", scans, "-o", tmp_path / "out", "--job", job, *OPTIONS, *UNITS, "-q"])
    first = units(job).units
    run(["job", "run", job, *(unit.name for unit in first[:3]), "-q"])
    on_dask.resume(job, client=client, batches_per_worker=2, threads=2)
    assert content(tmp_path / "out") == plain


def test_a_process_that_fails_for_a_while_is_tried_again(
    tmp_path: Path, scans: Path, client: Client, program: Path
) -> None:
    calls = tmp_path / "calls"
    # the first call is ended by a signal, the third finds a disk that is full
    instead = f"""
if [ "$2" = run ]; then
    echo call >> "{calls}"
    case $(wc -l < "{calls}") in
        1) kill -9 $$ ;;
        3) echo "error: disk full" >&2; exit 5 ;;
    esac
fi"""
    with faulty(program, instead):
        on_dask.convert(scans, tmp_path / "out", job=tmp_path / "job", client=client, options=UNITS)
    assert len(calls.read_text().splitlines()) > 4
    assert content(tmp_path / "out")


def test_what_no_attempt_can_mend_is_not_tried_again(
    tmp_path: Path, scans: Path, client: Client, program: Path
) -> None:
    calls = tmp_path / "calls"
    instead = f'[ "$2" = run ] && {{ echo call >> "{calls}"; echo "error: too little memory" >&2; exit 6; }}'
    with faulty(program, instead), pytest.raises(PointmillError, match=r"^too little memory$") as caught:
        on_dask.convert(scans / "0.las", tmp_path / "out", job=tmp_path / "job", client=client)
    assert caught.value.code == 6
    assert len(calls.read_text().splitlines()) == 1


def test_a_unit_that_is_broken_is_done_again(tmp_path: Path, scans: Path, client: Client, program: Path) -> None:
    calls, job = tmp_path / "calls", tmp_path / "job"
    # before the units that build are done, one that was read loses its end
    instead = f"""
case "$*" in *build-0-0*)
    echo call >> "{calls}"
    [ $(wc -l < "{calls}") = 1 ] && truncate -s -9 "{job}/units/read-1-0" ;;
esac"""
    with faulty(program, instead):
        on_dask.convert(scans / "0.las", tmp_path / "out", job=job, client=client, options=UNITS)
    run(["convert", scans / "0.las", "-o", tmp_path / "plain", "-q"])
    assert content(tmp_path / "out") == content(tmp_path / "plain")
