#!/usr/bin/env python3
"""What a job costs that a run leaves for `--resume`, and what it takes to go on with a run that was killed. Prints Markdown.

    python3 crates/bench/checkpoints.py target/quick/pointmill SCAN [--to potree2,bintree,batches,copc] [--memory 250MiB]
        [--points 4000000] [--runs 4] [--at 0.9]

Runs with `--checkpoint never` and `--checkpoint POINTS` take turns. Then runs are killed when a share `--at` of the units was built, and gone on
with. Processor seconds are user and system together. Needs Python's standard library alone, and an idle machine.
"""

import argparse
import os
import shutil
import statistics
import subprocess
import tempfile
import time
from pathlib import Path


class Bench:
    def __init__(self, args, folder):
        self.args, self.folder = args, folder
        self.output, self.job = folder / "out", folder / "out.job"

    def clean(self):
        for path in (self.output, self.job):
            shutil.rmtree(path, ignore_errors=True)

    def built(self):
        """Units that the job has."""
        try:
            return sum(name.startswith("build-") and "." not in name for name in os.listdir(self.job))
        except FileNotFoundError:
            return 0

    def run(self, kind, *options, until=None, watch=False):
        """Wall and processor seconds of a run, and the most units that its job had, if that is watched. `until`: kill it then."""
        args = self.args
        command = [args.pointmill, "convert", args.scan, "-o", self.output, "--to", kind, "-q", "--memory", args.memory]
        start, most = time.monotonic(), 0
        process = subprocess.Popen([*command, *options])
        ended = (0, 0, None)
        while not ended[0]:
            if until is None and not watch:
                ended = os.wait4(process.pid, 0)
                continue
            most = max(most, self.built())
            if until is not None and most >= until:
                os.kill(process.pid, 9)
            ended = os.wait4(process.pid, os.WNOHANG)
            time.sleep(0.005)
        process.returncode = os.waitstatus_to_exitcode(ended[1])
        if process.returncode and until is None:
            raise SystemExit(f"{command}: exit code {process.returncode}")
        return time.monotonic() - start, ended[2].ru_utime + ended[2].ru_stime, most

    def measure(self, kind):
        job, runs = ("--checkpoint", str(self.args.points)), range(self.args.runs)
        never, always, on = [], [], []
        for _ in runs:
            self.clean()
            never.append(self.run(kind, "--checkpoint", "never"))
            self.clean()
            always.append(self.run(kind, *job))
        self.clean()
        units = self.run(kind, *job, watch=True)[2]
        for _ in runs:
            self.clean()
            self.run(kind, *job, until=max(int(units * self.args.at), 1))
            on.append(self.run(kind, *job, "--resume"))
        self.clean()
        mean = lambda measured, i: statistics.mean(run[i] for run in measured)
        share = lambda part, of, i: f"{100 * mean(part, i) / mean(of, i):.0f} %"
        cells = [f"{mean(never, 1):.1f} s, {mean(always, 1):.1f} s", share(always, never, 1)]
        cells += [f"{mean(never, 0):.1f} s, {mean(always, 0):.1f} s"]
        cells += [f"{mean(on, 1):.1f} s, {share(on, always, 1)}", f"{mean(on, 0):.1f} s, {share(on, always, 0)}"]
        print(f"| {kind} | {' | '.join(cells)} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pointmill")
    parser.add_argument("scan")
    parser.add_argument("--to", default="potree2,bintree,batches,copc")
    parser.add_argument("--memory", default="250MiB")
    parser.add_argument("--points", type=int, default=4_000_000)
    parser.add_argument("--runs", type=int, default=4)
    parser.add_argument("--at", type=float, default=0.9)
    parser.add_argument("--folder", type=Path, help="where to work")
    args = parser.parse_args()
    print("| output | processor: never, with a job | of it | time: never, with a job | going on: processor | going on: time |")
    print("|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory(dir=args.folder) as folder:
        for kind in args.to.split(","):
            Bench(args, Path(folder)).measure(kind)


if __name__ == "__main__":
    main()
