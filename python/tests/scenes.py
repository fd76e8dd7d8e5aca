"""Scans made of chance, as LAS files, and what datasets are compared by."""

from __future__ import annotations

import random
import struct
from pathlib import Path

#: Point format 2 of LAS 1.2: position, intensity, flags, class, angle, user data, source, colour.
RECORD = struct.Struct("<iiiHBBbBH3H")


def tile(path: Path, column: int, row: int, points: int, seed: int) -> None:
    """Hilly ground of 100 by 100 metres, with a tower that is denser than the rest."""
    chance = random.Random(seed)
    records = bytearray()
    low, high = [2**31] * 3, [-(2**31)] * 3
    for index in range(points):
        spread = 3_000 if index % 3 == 0 else 100_000
        place = (
            column * 100_000 + chance.randrange(spread),
            row * 100_000 + chance.randrange(spread),
            chance.randrange(30_000) if spread == 3_000 else chance.randrange(800),
        )
        colour = (chance.randrange(65_536), index % 65_536, 300)
        records += RECORD.pack(*place, index % 4_000, 0x09, 2 + index % 5, 0, 0, column, *colour)
        low, high = (
            [min(a, b) for a, b in zip(low, place, strict=True)],
            [max(*ab) for ab in zip(high, place, strict=True)],
        )
    bounds = [value / 1000 for axis in range(3) for value in (high[axis], low[axis])]
    header = struct.pack(
        "<4sHHIHH8sBB32s32sHHHIIBHI5I3d3d6d",
        *(b"LASF", 0, 0, 0, 0, 0, bytes(8), 1, 2, b"tests", b"tests", 1, 2026, 227, 227, 0, 2, RECORD.size),
        *(points, points, 0, 0, 0, 0, 0.001, 0.001, 0.001, 0.0, 0.0, 0.0, *bounds),
    )
    path.write_bytes(header + records)


def scene(folder: Path, points: int) -> Path:
    """Four tiles in a folder."""
    folder.mkdir()
    for index in range(4):
        tile(folder / f"{index}.las", index % 2, index // 2, points // 4, index)
    return folder


def content(dataset: Path) -> dict[str, bytes]:
    """All files but the report, which has times in it."""
    files = (path for path in sorted(dataset.rglob("*")) if path.is_file() and path.name != "report.json")
    return {str(path.relative_to(dataset)): path.read_bytes() for path in files}
