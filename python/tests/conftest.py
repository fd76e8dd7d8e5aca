"""What several tests share."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import pytest
from scenes import content, scene

from pointmill import run

collect_ignore = [] if find_spec("distributed") else ["test_dask.py", "test_machines.py"]

#: All outputs that can be made together, and units small enough that a small scene has many.
OPTIONS = [word for kind in ("potree2", "potree1", "copc", "bintree", "batches") for word in ("--to", kind)]
UNITS = ["--checkpoint", "20000"]


@pytest.fixture(scope="session")
def scans(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with a scene of 160,000 points."""
    return scene(tmp_path_factory.mktemp("scene") / "scans", 160_000)


@pytest.fixture(scope="session")
def plain(scans: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What one process makes of it."""
    out = tmp_path_factory.mktemp("plain") / "out"
    run(["convert", scans, "-o", out, *OPTIONS, "-q"])
    return content(out)
