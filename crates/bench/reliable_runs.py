"""Scenes and runs for reliability.py: what an undisturbed run makes, and what must hold of any other."""

import hashlib
import json
import math
import random
import re
import shutil
import struct
import subprocess
import sys
import time
from pathlib import Path

from country import RECORD, TILE, header

OUTPUTS = {
    "potree2": ["potree2"],
    "potree2, Brotli": ["potree2", "--encoding", "brotli", "--brotli-quality", "1"],
    "potree1": ["potree1", "--potree1-version", "1.8"],
    "potree1, archive": ["potree1", "--archive", "--potree1-version", "1.8"],
    "copc": ["copc"],
    "bintree, a file per leaf": ["bintree", "--capacity", "5000"],
    "bintree, packed": ["bintree", "--layout", "packed"],
    "batches": ["batches"],
    "batches, zstd": ["batches", "--compress", "zstd:1"],
    "potree2, bintree and batches": ["potree2", "--to", "bintree", "--to", "batches"],
    "potree2, potree1 and copc": ["potree2", "--to", "potree1", "--potree1-version", "1.8", "--to", "copc"],
}
UNITS = 8  # units of reading in a job
TILES = 4
EXTRA = 24  # numbers of 8 bytes, beside what LAS has of a point: so few points exceed the least memory
BROKEN = []


def scan(path, column, points, seed):
    """A tile of hills in random order."""
    rng = random.Random(seed)
    numbers = b"".join(struct.pack("<HBB32s156x", 0, 7, 0, f"number {i}".encode()) for i in range(EXTRA))
    head = bytearray(header(0, column, 0, points))
    head += struct.pack("<H16sHH32s", 0, b"LASF_Spec", 4, len(numbers), b"extra bytes") + numbers
    head[96:107] = struct.pack("<IIBH", len(head), 1, 3, RECORD + 8 * EXTRA)
    with open(path, "wb") as file:
        file.write(head)
        for _ in range(points):
            x, y = rng.randrange(int(TILE[0] * 1000)), rng.randrange(int(TILE[1] * 1000))
            z = int(15_000 + 9000 * math.sin(x / 80_000) + 5000 * math.cos(y / 60_000)) + rng.randrange(100)
            file.write(struct.pack("<3i", x + int(column * TILE[0] * 1000), y + 300_000_000, z))
            # the time in the middle: random bits are no numbers
            file.write(rng.randbytes(8) + bytes(8) + rng.randbytes(6 + 8 * EXTRA))


def contents(folder):
    """Names and checksums of all files but the report; None: nothing is there."""
    if not folder.exists():
        return None
    files = (path for path in sorted(folder.rglob("*")) if path.is_file() and path.name != "report.json")
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


class Run:
    """How a process has ended: exit code, phase that it was in, and what it said beside its progress."""

    def __init__(self, code, log, seconds):
        lines = log.read_text(errors="replace").splitlines()
        progress = [json.loads(line) for line in lines if line.startswith("{")]
        phases = [line["phase"] for line in progress if "phase" in line and line["phase"] != "clean up"]
        self.code, self.seconds = code, seconds
        self.phase = phases[-1] if phases else "start"
        self.said = [line for line in lines if not line.startswith("{")]
        self.warnings = [line["warning"] for line in progress if "warning" in line]


class Bench:
    def __init__(self, program, folder, points, seed):
        self.program, self.folder, self.points = str(Path(program).resolve()), folder, points
        self.random = random.Random(seed)
        self.scans, self.old_scan = folder / "scans", folder / "old.las"
        self.scans.mkdir()
        for tile in range(TILES):
            scan(self.scans / f"{tile}.las", tile, points // TILES, seed + tile)
        scan(self.old_scan, 9, 3000, seed + 99)
        self.expected, self.old, self.seconds, self.least = {}, {}, {}, {}
        for name in OUTPUTS:
            self.learn(name)

    def learn(self, name):
        """What undisturbed runs to an output make of the new scans and the old one, and what they need."""
        place = self.folder / "plain"
        ended = self.end(self.command(name, place))
        require(ended.code == 0, name, "an undisturbed run", ended)
        self.expected[name] = contents(place)
        shutil.rmtree(place)
        old = self.folder / "old" / str(len(self.old))
        ended = self.end(self.command(name, old, scans=[self.old_scan]))
        require(ended.code == 0, name, "the old dataset", ended)
        self.old[name] = (old, contents(old))

    def least_memory(self, name, threads):
        """The least ceiling that the program names, with which points go to temporary files."""
        if (name, threads) not in self.least:
            refused = self.end([*self.command(name, self.folder / "plain", threads=threads), "--memory", "1MiB"])
            self.least[name, threads] = re.search(r"--memory (\d+MiB)", refused.said[-1])[1]
        return self.least[name, threads]

    def command(self, name, out, scans=(), spilled=False, job=False, resume=False, over=False, temp=None, threads=2):
        command = [self.program, "convert", *map(str, scans or [self.scans]), "-o", str(out), "--to", *OUTPUTS[name]]
        command += ["--threads", str(threads), "--name", "scans", "--attributes", "all", "--progress", "json"]
        command += ["--memory", self.least_memory(name, threads)] if spilled else []
        command += ["--checkpoint", str(self.points // UNITS)] if job else ["--checkpoint", "never"]
        command += ["--resume"] if resume else []
        command += ["--overwrite"] if over else []
        return command + (["--temp-dir", str(temp)] if temp else [])

    def start(self, command):
        self.log = self.folder / "log"
        with open(self.log, "w") as log:
            return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=log)

    def end(self, command, child=None):
        start = time.monotonic()
        code = (child or self.start(command)).wait()
        return Run(code, self.log, time.monotonic() - start)

    def duration(self, name, **how):
        """Seconds of an undisturbed run, which must make the same bytes as every other."""
        key = (name, *how.items())
        if key not in self.seconds:
            place = self.folder / "plain"
            ended = self.end(self.command(name, place, **how))
            require(ended.code == 0, name, f"an undisturbed run, {how}", ended)
            require(contents(place) == self.expected[name], name, f"other bytes: {how}", ended)
            temporary = json.loads((place / "report.json").read_text())["temp_bytes"]
            require(temporary > 0 or not how.get("spilled"), name, "nothing was spilled: more --points", ended)
            shutil.rmtree(place)
            self.seconds[key] = ended.seconds
        return self.seconds[key]

    def put_old(self, name, out):
        shutil.copytree(self.old[name][0], out)
        return self.old[name][1]

    def finish(self, name, out, what, **how):
        """The next run: it ends well, its bytes are right, and nothing is left beside it. Returns its report."""
        ended = self.end(self.command(name, out, **how))
        require(ended.code == 0, name, f"{what}: the next run", ended)
        require(contents(out) == self.expected[name], name, f"{what}: the bytes of the next run", ended)
        left = sorted(path.name for path in out.parent.iterdir() if path != out)
        require(not left, name, f"{what}: {left} are left", ended)
        return json.loads((out / "report.json").read_text()) if ended.code == 0 else {}


def require(condition, name, what, ended):
    if not condition:
        BROKEN.append(f"{name}: {what}")
        print(f"BROKEN: {name}: {what}: exit code {ended.code}, {ended.phase}, {ended.said}", file=sys.stderr, flush=True)


def failed_well(name, what, ended, words=(), code=5):
    """A run that failed said why, in one line, with the right exit code."""
    is_line = len(ended.said) >= 1 and ended.said[-1].startswith("error: ")
    others = [line for line in ended.said[:-1] if not line.startswith("pointmill: ")]
    has_words = any(word in ended.said[-1] for word in words) if words and ended.said else True
    require(ended.code == code and is_line and not others and has_words, name, what, ended)


def row(*cells):
    print("| " + " | ".join(str(cell) for cell in cells) + " |", flush=True)


def table(*cells):
    print()
    row(*cells)
    row(*("---" for _ in cells))
