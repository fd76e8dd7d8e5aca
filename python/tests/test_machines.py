"""A scheduler and three workers on machines with addresses of their own, of which one is lost in the middle."""

from __future__ import annotations

import subprocess
import sys
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest
from conftest import OPTIONS, UNITS
from machines import Machines, children, crash
from scenes import content

#: Seconds until the test gives up.
PATIENCE = 100


@pytest.fixture
def machines(tmp_path: Path) -> Iterator[Machines]:
    found = Machines(4, tmp_path)
    if found.why_not:
        warnings.warn(f"no network namespaces ({found.why_not}): machines are processes", stacklevel=1)
    yield found
    found.close()


def python(*words: str) -> list[str]:
    return [sys.executable, "-m", *words]


def wait_for_build(worker: subprocess.Popen[bytes], driver: subprocess.Popen[bytes]) -> list[str]:
    """Waits until a worker builds, and returns the command that does."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end and driver.poll() is None:
        for command in children(worker):
            if any(word.startswith("build-") for word in command):
                return command
        time.sleep(0.002)
    raise AssertionError("the worker never built")


def test_a_machine_that_is_lost_changes_nothing(
    tmp_path: Path, scans: Path, plain: dict[str, bytes], machines: Machines
) -> None:
    where, out, job = f"{machines.address(0)}:8786", tmp_path / "out", tmp_path / "job"
    scheduler = python("distributed.cli.dask_scheduler", "--host", machines.address(0), "--no-dashboard")
    machines.start(0, "scheduler", [*scheduler, "--port", "8786"])
    worker = python("distributed.cli.dask_worker", f"tcp://{where}", "--no-nanny", "--nthreads", "1", "--no-dashboard")
    workers = [
        machines.start(i, f"worker{i}", [*worker, "--host", machines.address(i), "--local-directory", "."])
        for i in (1, 2, 3)
    ]
    script = str(Path(__file__).with_name("drive.py"))
    driver = machines.start(
        0, "driver", [sys.executable, script, where, *map(str, (job, out, scans)), *OPTIONS, *UNITS]
    )

    command = wait_for_build(workers[1], driver)
    crash(workers[1])
    units = [word for word in command if word.startswith("build-")]
    undone = [unit for unit in units if not (job / "units" / unit).exists()]

    assert driver.wait(PATIENCE) == 0, machines.log("driver").read_text()
    lines = machines.log("driver").read_text().splitlines()
    assert lines[-1] == "workers 2"
    kind, done, all_units = lines[-2].split()
    assert (kind, done) == ("build", all_units)
    assert undone, f"the worker was lost too late: {units}"
    assert content(out) == plain
    assert not job.exists()
