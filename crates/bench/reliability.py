#!/usr/bin/env python3
"""Runs that are killed, or whose disk fails them: what stays, and what the next run makes of it. Prints Markdown.

    python3 crates/bench/reliability.py target/quick/pointmill [--kills 160] [--points 100000] [--seed 1] [--only PART]

Parts: kills, calls, full, inodes, refused, vanished, twice, same. Each run is one of every combination of output, memory (enough, or
the least that works, so that points go to temporary files), job (none, or one that the next run resumes), and what stood
at the place of the output (an old dataset, or nothing). Whatever happens to a run, these are checked:

- At the final name is what stood there before, to the bit, or all of the new dataset.
- A run that fails ends in one line and the right exit code.
- The next run ends well, in the bytes of a run that nothing happened to; beside the output nothing is left.

Full disks and disks without inodes are mounted (tmpfs) in a space of mounts of their own, which takes the rights of root; without
them these parts are skipped. Needs Python's standard library alone; `calls` needs strace. Ends with exit code 1 if a promise is broken.
"""

import argparse
import collections
import itertools
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from country import RECORD
from reliable_runs import BROKEN, EXTRA, OUTPUTS, Bench, Run, contents, failed_well, require, row, table


def kills(bench, count):
    """Kill -9 at random moments, until there are so many, or Ctrl-C."""
    counts = collections.defaultdict(collections.Counter)
    combinations = list(itertools.product(OUTPUTS, (False, True), (False, True), (False, True)))
    bench.random.shuffle(combinations)
    try:
        for combination in itertools.cycle(combinations):
            killed = sum(c["kills"] for c in counts.values())
            if killed >= count:
                break
            print(f"{killed} kills", file=sys.stderr, flush=True)
            kill(bench, *combination, counts[combination[0]])
    except KeyboardInterrupt:
        pass
    table("output", "kills", "while starting", "reading", "building", "finishing", "with temporary files", "with a job",
          "over an old dataset", "old one or nothing stood", "new one stood", "left something hidden",
          "next runs, same bytes, nothing left", "of them resumed")
    total = sum(counts.values(), collections.Counter())
    for name, c in [*counts.items(), ("all", total)]:
        row(name, c["kills"], c["in start"] + c["in probe"], c["in read"], c["in build"], c["in finish"], c["spilled"],
            c["job"], c["over"], c["old"], c["new"], c["left"], c["next"], c["recalled"])


def kill(bench, name, spilled, job, over, counts):
    """Kills a run to an output; one with a job perhaps again when it is resumed. Then the next run must end well."""
    what = f"killed, {'spilled' if spilled else 'in memory'}, {'job' if job else 'no job'}, {'over' if over else 'new'}"
    seconds = bench.duration(name, spilled=spilled, job=job)
    place = Path(tempfile.mkdtemp(dir=bench.folder))
    out = place / "out"
    before = bench.put_old(name, out) if over else None
    killed = 0
    for again in range(1 + (bench.random.randrange(3) if job else 0)):
        how = {"spilled": spilled, "job": job, "over": over, "resume": again > 0}
        # a third of the kills near the end, where names are given
        near = bench.random.random() < 1 / 3
        wait = seconds * (bench.random.uniform(0.8, 1.05) if near else bench.random.uniform(0, 0.9))
        child = bench.start(bench.command(name, out, **how))
        time.sleep(wait)
        child.send_signal(signal.SIGKILL)
        ended = bench.end(None, child)
        found = contents(out)
        is_old, is_new = found == before, found == bench.expected[name]
        require(is_old or is_new, name, f"{what} in {ended.phase}: neither the old nor the new dataset", ended)
        if ended.code != -signal.SIGKILL:
            require(ended.code == 0, name, what, ended)
            break
        killed += 1
        left = "left" if any(path != out for path in place.iterdir()) else "nothing left"
        counts.update(["kills", f"in {ended.phase}", "new" if is_new else "old", left])
        counts.update([w for w, is_it in (("spilled", spilled), ("job", job), ("over", over)) if is_it])
        if is_new:
            break
    if killed:
        report = bench.finish(name, out, what, spilled=spilled, job=job, resume=job, over=over or out.exists())
        counts["next"] += 1
        counts["recalled"] += report.get("recalled_points", 0) > 0
    shutil.rmtree(place)


CALLS = {
    "opened": "openat", "listed": "getdents64", "made": "mkdir,mkdirat", "linked": "link,linkat",
    "renamed": "rename,renameat,renameat2", "removed": "unlink,unlinkat,rmdir", "locked": "flock",
    "written": "write,pwrite64,ftruncate", "synced": "fsync,fdatasync,syncfs",
}


def calls(bench):
    """Kill -9 at every call of each kind by which a run of one thread changes the disk, or looks at it."""
    if not shutil.which("strace"):
        print("\nskipped: calls: no strace")
        return
    table("output", "kills", *(f"where something is {kind}" for kind in CALLS), "next runs, same bytes, nothing left")
    for name in OUTPUTS:
        counts = collections.Counter()
        for kind, over, job in itertools.product(CALLS, (False, True), (False, True)):
            number = 1
            while kill_at(bench, name, CALLS[kind], number, over, job):
                counts[kind] += 1
                number += 1 + number // 10  # of many alike not each
        row(name, counts.total(), *(counts[kind] for kind in CALLS), counts.total())


def kill_at(bench, name, names, number, over, job):
    """False: there are not so many such calls, and the run ended well."""
    with tempfile.TemporaryDirectory(dir=bench.folder) as place:
        out = Path(place) / "out"
        before = bench.put_old(name, out) if over else None
        command = bench.command(name, out, job=job, over=over, threads=1)
        trace = ["strace", "-f", "-o", "/dev/null", "-e", f"trace={names}"]
        ended = bench.end([*trace, "-e", f"inject={names}:signal=SIGKILL:when={number}", *command])
        what = f"killed at call {number} of {names}, {'job' if job else 'no job'}, {'over' if over else 'new'}"
        found = contents(out)
        require(found in (before, bench.expected[name]), name, f"{what}: neither the old nor the new dataset", ended)
        if ended.code == 0:
            return False
        bench.finish(name, out, what, job=job, resume=job, over=over or out.exists())
        return True


def mounted(options, folder):
    folder.mkdir(exist_ok=True)
    subprocess.run(["mount", "-t", "tmpfs", "-o", options, "none", str(folder)], check=True)


def unmount(folder):
    subprocess.run(["umount", str(folder)], check=True)


def short_of(bench, name, options, job, spilled, words):
    """A run in a file system that is too small, beside an old dataset. Returns None if it was enough, or the phase."""
    disk = bench.folder / "disk"
    mounted(options, disk)
    try:
        out = disk / "out"
        try:
            before = bench.put_old(name, out)
        except OSError:
            return "no room for the old dataset"
        ended = bench.end(bench.command(name, out, spilled=spilled, job=job, over=True))
        if ended.code == 0:
            require(contents(out) == bench.expected[name], name, f"{options}: other bytes", ended)
            return None
        what = f"{options}, {'job' if job else 'no job'}, in {ended.phase}"
        failed_well(name, what, ended, words)
        require(contents(out) == before, name, f"{what}: the old dataset", ended)
        is_safe = any("safe in" in line for line in ended.said)
        left = {path.name for path in disk.iterdir()} - {"out"} - ({"out.job"} if is_safe else set())
        require(not left, name, f"{what}: {left} are left", ended)
        if (disk / "out.job").exists():  # what was read is not lost: with more room the run goes on
            subprocess.run(["mount", "-o", "remount,size=2g,nr_inodes=100000", str(disk)], check=True)
            bench.finish(name, out, what, spilled=spilled, job=True, resume=True, over=True)
        return ended.phase
    finally:
        unmount(disk)


def full(bench):
    """Disks of random sizes, and of the sizes just below what is enough: there the last files do not fit."""
    table("output", "memory", "job", "disks that were too small", "full in reading", "building", "finishing",
          "least disk that was enough, KiB")
    for name in OUTPUTS:
        for spilled, job in ((False, False), (True, True)):
            phases, low, high = collections.Counter(), 4, 4 * bench.points * (RECORD + 8 * EXTRA) // 1024

            def attempt(kib):
                phase = short_of(bench, name, f"size={kib}k", job, spilled, ["No space left"])
                phases.update([phase] if phase else [])
                return phase

            for _ in range(3):
                attempt(bench.random.randrange(low, high // 4))
            while high - low > 64:
                middle = (low + high) // 8 * 4
                low, high = (middle, high) if attempt(middle) else (low, middle)
            for pages in range(1, 8):
                attempt(high - 4 * pages)
            count = sum(phases.values()) - phases["no room for the old dataset"]
            row(name, "least" if spilled else "enough", "yes" if job else "no", count, phases["read"] + phases["probe"],
                phases["build"], phases["finish"], high)


def inodes(bench):
    table("output", "numbers of inodes that were too small", "out of them in start, reading", "building", "finishing")
    for name in OUTPUTS:
        phases = collections.Counter()
        have = sum(1 for _ in bench.old[name][0].rglob("*")) + 2
        need = len(bench.expected[name]) + have + 40
        numbers = sorted({*range(have, have + 12), *bench.random.sample(range(have, need), min(12, need - have))})
        for number in numbers:
            phase = short_of(bench, name, f"size=1g,nr_inodes={number}", False, False, ["No space left"])
            phases.update([phase] if phase else [])
        count = sum(phases.values()) - phases["no room for the old dataset"]
        row(name, count, phases["start"] + phases["probe"] + phases["read"], phases["build"], phases["finish"])


def refused(bench):
    """A disk that cannot be written, for the output or for temporary files."""
    table("read-only", "runs", "exit code 5, one line, before the first point is read")
    disk = bench.folder / "disk"
    for place in ("output", "temporary files"):
        for name in OUTPUTS:
            mounted("ro", disk)
            out = (disk if place == "output" else bench.folder) / "new"
            temp = None if place == "output" else disk
            ended = bench.end(bench.command(name, out, spilled=temp is not None, job=temp is not None, temp=temp))
            failed_well(name, f"read-only {place}", ended, ["ead-only"])
            require(not out.exists(), name, f"read-only {place}: something was made", ended)
            require(ended.phase in ("start", "probe"), name, f"read-only {place}: in {ended.phase}", ended)
            unmount(disk)
        row(place, len(OUTPUTS), len(OUTPUTS))


def vanished(bench):
    """The folder of temporary files is removed while the run works."""
    table("output", "runs whose folder was removed", "ended well", "exit code 5, one line", "old dataset, or the new one")
    for name in OUTPUTS:
        counts = collections.Counter()
        for job in (False, True, False, True):
            place = Path(tempfile.mkdtemp(dir=bench.folder))
            out, temp = place / "out", bench.folder / "temp"
            temp.mkdir()
            before = bench.put_old(name, out)
            how = {"spilled": True, "job": job, "over": True, "temp": temp}
            seconds = bench.duration(name, spilled=True, job=job)
            child = bench.start(bench.command(name, out, **how))
            time.sleep(seconds * bench.random.uniform(0.02, 0.8))
            shutil.rmtree(temp, ignore_errors=True)
            ended = bench.end(None, child)
            what = f"the folder of temporary files vanished in {ended.phase}"
            if ended.code == 0:
                require(contents(out) == bench.expected[name], name, f"{what}: other bytes", ended)
            else:
                failed_well(name, what, ended, code=2 if ended.phase == "start" else 5)  # looked for before the work
                require(contents(out) == before, name, f"{what}: the old dataset", ended)
            counts.update(["well" if ended.code == 0 else "failed"])
            temp.mkdir(exist_ok=True)
            bench.finish(name, out, what, **how)
            shutil.rmtree(place)
            shutil.rmtree(temp)
        row(name, sum(counts.values()), counts["well"], counts["failed"], sum(counts.values()))


def twice(bench):
    """Two runs to one output at once."""
    table("place of the output", "pairs", "both ended well", "one ended with code 2 and said why",
          "one complete dataset, nothing beside it")
    for over, job in ((False, False), (True, False), (True, True)):
        counts = collections.Counter()
        for name in OUTPUTS:
            place = Path(tempfile.mkdtemp(dir=bench.folder))
            out = place / "out"
            if over:
                bench.put_old(name, out)
            command = bench.command(name, out, over=over, job=job)
            runs = []
            for number in range(2):
                with open(bench.folder / f"log{number}", "w") as log:
                    runs.append(subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=log))
                time.sleep(bench.random.uniform(0, 0.2))
            ended = [Run(run.wait(), bench.folder / f"log{number}", 0) for number, run in enumerate(runs)]
            lost = [run for run in ended if run.code != 0]
            what = f"two runs, {'over' if over else 'new'}, {'job' if job else 'no job'}"
            require(len(lost) < 2, name, f"{what}: none was done", ended[0])
            for run in lost:
                require(run.code == 2 and run.said[-1].startswith("error: "), name, what, run)
            require(contents(out) == bench.expected[name], name, f"{what}: other bytes", ended[0])
            left = sorted(path.name for path in place.iterdir() if path != out)
            require(not left, name, f"{what}: {left} are left", ended[0])
            counts.update(["lost" if lost else "both"])
            shutil.rmtree(place)
        row(f"{'an old dataset' if over else 'nothing'}{', with jobs' if job else ''}", len(OUTPUTS), counts["both"],
            counts["lost"], len(OUTPUTS))


def same(bench):
    """Bytes do not depend on threads, memory, the folder for temporary files, or the order of the inputs."""
    table("output", "runs", "same bytes")
    for name in OUTPUTS:
        good = count = 0
        temp = bench.folder / "temp"
        temp.mkdir()
        files = sorted(map(str, bench.scans.iterdir()))
        for threads, spilled, elsewhere in itertools.product((1, 2, 4), (False, True), (False, True)):
            out = bench.folder / "plain"
            order = bench.random.sample(files, len(files))
            how = {"spilled": spilled, "temp": temp if elsewhere else None, "job": elsewhere, "threads": threads}
            ended = bench.end(bench.command(name, out, scans=order, **how))
            is_same = ended.code == 0 and contents(out) == bench.expected[name]
            require(is_same, name, f"{how}, {order}", ended)
            count, good = count + 1, good + is_same
            shutil.rmtree(out, ignore_errors=True)
        temp.rmdir()
        row(name, count, good)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--points", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", help="parts, separated by commas")
    given = parser.parse_args()
    own_mounts = ["unshare", "-m", sys.executable, *sys.argv]
    can_mount = os.environ.get("RELIABILITY_MOUNTS") == "1"
    if not can_mount and subprocess.run(["unshare", "-m", "true"], capture_output=True).returncode == 0:
        os.execvpe("unshare", own_mounts, {**os.environ, "RELIABILITY_MOUNTS": "1"})
    parts = {"kills": lambda b: kills(b, given.kills), "calls": calls, "full": full, "inodes": inodes, "refused": refused,
             "vanished": vanished, "twice": twice, "same": same}
    chosen = given.only.split(",") if given.only else list(parts)
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(given.program, Path(folder), given.points, given.seed)
        for part in chosen:
            if part in ("full", "inodes", "refused") and not can_mount:
                print(f"\nskipped: {part}: no rights to mount")
                continue
            start = time.monotonic()
            parts[part](bench)
            print(f"\n{part}: {time.monotonic() - start:.0f} s", flush=True)
    print(f"\n{len(BROKEN)} promises were broken")
    sys.exit(1 if BROKEN else 0)


if __name__ == "__main__":
    main()
