#!/usr/bin/env python3
"""Scenes that are hard to hold in memory, converted under a real limit, as Markdown.

    python3 crates/bench/hard_scenes.py target/release/pointmill [--points 20000000] [--threads 2] [--ceiling MiB]

Makes each scene in a folder for temporary files (about 40 bytes a point), and converts it to every format with the least
ceiling that the program names for it, or with --ceiling. The kernel is asked to hold the process to its ceiling: by a
cgroup where one may be made, else the resident set is read when the process has ended. Python's standard
library and numpy are enough. Ends with exit code 1 if a run fails or a ceiling is passed.
"""

import argparse
import json
import os
import re
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

FORMATS = ["potree2", "bintree", "batches"]
PIECE = 1_000_000
RECORD = np.dtype([("xyz", "<i4", 3), ("intensity", "<u2"), ("flags", "u1"), ("class", "u1"), ("angle", "i1"),
                   ("user", "u1"), ("source", "<u2"), ("time", "<f8"), ("rgb", "<u2", 3)])


def las(path, pieces, scale=0.001, extra=0, offset=(0, 0, 0), paint=None):
    """LAS 1.2 with points of format 3 and `extra` undescribed bytes behind each; `paint` gives colours of places."""
    record = np.dtype(RECORD.descr + ([("extra", "u1", extra)] if extra else []))
    count, least, greatest = 0, np.full(3, 2**31), np.full(3, -(2**31))
    rng = np.random.default_rng(7)
    with open(path, "wb") as out:
        out.write(bytes(227))
        for xyz in pieces:
            points = np.zeros(len(xyz), record)
            points["xyz"] = xyz
            points["rgb"] = rng.integers(0, 65536, (len(xyz), 3)) if paint is None else paint(rng, xyz * scale)
            points["intensity"] = rng.integers(0, 65536, len(xyz))
            if extra:
                points["extra"] = rng.integers(0, 256, (len(xyz), extra))
            out.write(points.tobytes())
            count += len(xyz)
            least, greatest = np.minimum(least, xyz.min(0)), np.maximum(greatest, xyz.max(0))
        header = struct.pack("<4sHHIHH8sBB32s32sHHHIIBHI5I", b"LASF", 0, 0, 0, 0, 0, bytes(8), 1, 2, b"", b"", 1, 2026,
                             227, 227, 0, 3, record.itemsize, count, count, 0, 0, 0, 0)
        header += struct.pack("<6d", scale, scale, scale, *offset)
        for a in range(3):
            header += struct.pack("<2d", greatest[a] * scale + offset[a], least[a] * scale + offset[a])
        out.seek(0)
        out.write(header)


def pieces(points, make):
    rng = np.random.default_rng(1)
    for start in range(0, points, PIECE):
        yield make(rng, min(PIECE, points - start), start).astype(np.int32)


def volume(rng, n, _):
    return rng.integers(0, 1_000_000, (n, 3))


def surface(rng, n, _):
    x, y = rng.integers(0, 1_000_000, (2, n))
    return np.stack([x, y, (3000 * np.sin(x / 40_000) + 2000 * np.cos(y / 30_000)).astype(int)], 1)


def one_place(rng, n, start):
    xyz = np.full((n, 3), 123_456)
    if start == 0:
        xyz[: n // 100] = rng.integers(0, 200_000, (n // 100, 3))
    return xyz


def clusters(rng, n, _):
    return rng.integers(0, 1000, (n, 3)) + 10**9 * rng.integers(0, 2, (n, 1))


def powers(rng, n, start):
    xyz = rng.integers(0, 1000, (n, 3))
    if start == 0:
        for power in range(3, 10):
            xyz[power] = [10**power, -(10**power), 0]
    return xyz


SCENES = {
    "a volume in random order": (volume, 1, 0, []),
    "200 extra bytes a point": (volume, 10, 200, ["--attributes", "all"]),
    "a surface in random order": (surface, 1, 0, []),
    "nearly all in one place": (one_place, 1, 0, []),
    "two clusters far apart": (clusters, 1, 0, ["--outliers", "keep"]),
    "outliers at powers of ten": (powers, 1, 0, ["--outliers", "keep"]),
}


def cgroup(limit_bytes):
    """A new cgroup with that limit (version 2 or 1), or None where none may be made."""
    root = Path("/sys/fs/cgroup")
    is_second = (root / "cgroup.controllers").exists()
    folder = (root if is_second else root / "memory") / f"hard-scenes-{os.getpid()}"
    try:
        folder.mkdir()
        (folder / ("memory.max" if is_second else "memory.limit_in_bytes")).write_text(str(limit_bytes))
        return folder
    except OSError:
        if folder.exists():
            folder.rmdir()
        return None


def run(command, limit_bytes):
    """Exit code, CPU seconds, wall seconds, peak of the resident set in MiB, and whether the kernel held the limit."""
    group = cgroup(limit_bytes)
    enter = (lambda: (group / "cgroup.procs").write_text(str(os.getpid()))) if group else None
    start = time.monotonic()
    child = subprocess.Popen(command, preexec_fn=enter, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    text = child.stderr.read()
    _, status, usage = os.wait4(child.pid, 0)
    wall = time.monotonic() - start
    if group:
        group.rmdir()
    code = os.waitstatus_to_exitcode(status)
    return code, usage.ru_utime + usage.ru_stime, wall, usage.ru_maxrss / 1024, group is not None, text


def least(command):
    refused = subprocess.run([*command, "--memory", "1MiB"], capture_output=True, text=True)
    found = re.search(r"--memory (\d+)MiB", refused.stderr)
    if refused.returncode != 6 or not found:
        sys.exit(f"no least ceiling: {refused.stderr}")
    return int(found[1])


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("program")
    arguments.add_argument("--points", type=int, default=20_000_000)
    arguments.add_argument("--threads", default="2")
    arguments.add_argument("--ceiling", type=int)
    given = arguments.parse_args()
    print("| scene | points | format | ceiling MiB | peak MiB | CPU s | wall s | temporary GiB | limit by |")
    print("|---|---|---|---|---|---|---|---|---|")
    is_kept = True
    with tempfile.TemporaryDirectory() as folder:
        scan, out = Path(folder, "scan.las"), Path(folder, "out")
        for name, (make, fewer, extra, options) in SCENES.items():
            points = given.points // fewer
            las(scan, pieces(points, make), extra=extra)
            for kind in FORMATS:
                command = [given.program, "convert", str(scan), "-o", str(out), "--to", kind, "--overwrite", "-q",
                           "--threads", given.threads, *options]
                ceiling = given.ceiling or least(command)
                code, cpu, wall, peak, by_kernel, text = run([*command, "--memory", f"{ceiling}MiB"], ceiling << 20)
                if code != 0 or peak > ceiling:
                    is_kept = False
                    print(f"{name}, {kind}: exit code {code}, {peak:.0f} of {ceiling} MiB: {text}", file=sys.stderr)
                temporary = json.loads(Path(out, "report.json").read_text())["temp_bytes"] / 2**30 if code == 0 else 0
                print(f"| {name} | {points:,} | {kind} | {ceiling} | {peak:.0f} | {cpu:.1f} | {wall:.1f} "
                      f"| {temporary:.2f} | {'cgroup' if by_kernel else 'reading'} |", flush=True)
    sys.exit(0 if is_kept else 1)


if __name__ == "__main__":
    main()
