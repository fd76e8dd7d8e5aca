#!/usr/bin/env python3
"""What a job costs, measured, and what a larger one would cost on many machines, simulated.

    scale.py measure SCAN DIR --program POINTMILL [--at-a-time 3] [--unit 8000000] [--out times.json]
    scale.py plan DIR --program POINTMILL --tiles 50000
    scale.py simulate times.json UNITS.json... [--workers 1,16,256]

`measure` converts SCAN in one process and as a job, in processes of one thread, some at a time, with the package in
python/, and writes what each took. `plan` plans a country of tiles that are headers alone (country.py) and keeps the
list of units, the time and the memory. `simulate` takes such lists for what is read, and a model of the octree for what
is built: docs/scale.md says which. Needs numpy.
"""

import argparse
import filecmp
import json
import os
import shutil
import subprocess
import sys
import time
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1] / "python/src"), str(HERE)]

from pointmill import jobs  # noqa: E402


def timed(command):
    """Runs a program; its seconds of processor and clock, its peak memory in bytes, and what it has printed."""
    begun = time.monotonic()
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        text = process.stdout.read()
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{' '.join(command[:4])} … failed")
    took = {
        "cpu": usage.ru_utime + usage.ru_stime,
        "system": usage.ru_stime,
        "wall": time.monotonic() - begun,
        "peak": usage.ru_maxrss * 1024,
    }
    return took, text


def run_layered(program, job, batches, at_a_time):
    """Does batches, each as soon as those it needs are done."""
    done, running, rows = set(), {}, []
    with ThreadPoolExecutor(at_a_time) as pool:
        left = dict(enumerate(batches))
        while left or running:
            for number in [n for n, batch in left.items() if done.issuperset(batch.needs)]:
                batch = left.pop(number)
                command = [program, "job", "run", job, "--threads", "1", "-q", *batch.units]
                running[pool.submit(timed, command)] = number
            finished, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in finished:
                number = running.pop(future)
                done.add(number)
                batch = batches[number]
                rows.append(
                    {"stage": batch.stage, "units": len(batch.units), "points": batch.points, **future.result()[0]}
                )
    return rows


def size(folder, pattern="*"):
    return sum(path.stat().st_size for path in Path(folder).rglob(pattern) if path.is_file())


def measure(args):
    program, where = str(Path(args.program).resolve()), Path(args.dir)
    shutil.rmtree(where, ignore_errors=True)
    where.mkdir(parents=True)
    plain, _ = timed([program, "convert", args.scan, "-o", str(where / "plain"), "--threads", str(args.threads), "-q"])
    job, out = str(where / "job"), where / "out"
    begun = time.monotonic()
    plan, _ = timed(
        [program, "job", "plan", args.scan, "-o", str(out), "--job", job, "--checkpoint", str(args.unit), "-q"]
    )
    rows, listings, open_costs, bytes_of = [], [], {}, {}
    units = Path(job) / "units"
    while True:
        took, text = timed([program, "job", "units", job, "--json", "-q"])
        listed = json.loads(text)
        listings.append(took)
        if listed["complete"]:
            break
        known = [jobs.Unit(u["name"], u["kind"], u["points"], tuple(u["needs"]), u["done"]) for u in listed["units"]]
        if (kind := known[0].kind) in open_costs and kind != "read":
            raise SystemExit(f"units to {kind} stay open")
        batches = jobs.batches(known, args.at_a_time, args.per_slot)
        rows += run_layered(program, job, batches, args.at_a_time)
        # once more: what a process costs that finds all done
        open_costs[kind] = timed([program, "job", "run", job, "--threads", "1", "-q", known[0].name])[0]
        bytes_of[kind] = size(units)
        if kind == "read":
            bytes_of["lists"] = sum(p.stat().st_size for p in units.iterdir() if not p.name.endswith(".records"))
    bytes_of["division"] = sum(
        p.stat().st_size for p in units.iterdir() if p.name.startswith("settle") and "records" not in p.name
    )
    counts = {kind: sum(row["units"] for row in rows if row["stage"].startswith(kind)) for kind in ("read", "build")}
    finish, text = timed([program, "job", "finish", job, "--threads", str(args.threads), "--json", "-q"])
    clock = time.monotonic() - begun
    points = json.loads(text)["points"]["kept"]
    same = filecmp.dircmp(where / "plain", out, ignore=["report.json"])
    is_same = (
        not (same.left_only or same.right_only)
        and not filecmp.cmpfiles(where / "plain", out, same.common_files, shallow=False)[1]
    )
    of = lambda kind, what="cpu": sum(row[what] for row in rows if row["stage"].startswith(kind))  # noqa: E731
    total = plan["cpu"] + finish["cpu"] + sum(row["cpu"] for row in rows) + sum(took["cpu"] for took in listings)
    result = {
        "points": points,
        "same_bytes": is_same,
        "plain": plain,
        "cpu": {
            "all": total,
            "plan": plan["cpu"],
            "list": sum(took["cpu"] for took in listings),
            "finish": finish["cpu"],
        }
        | {kind: of(kind) for kind in ("read", "settle", "build")},
        "system": {kind: of(kind, "system") for kind in ("read", "settle", "build")} | {"finish": finish["system"]},
        "peak": {
            kind: max(row["peak"] for row in rows if row["stage"].startswith(kind))
            for kind in ("read", "settle", "build")
        }
        | {"finish": finish["peak"]},
        "wall": {
            "all": clock,
            "settle": next(r["wall"] for r in rows if r["stage"].startswith("settle")),
            "finish": finish["wall"],
        },
        "processes": {kind: sum(row["stage"].startswith(kind) for row in rows) for kind in ("read", "settle", "build")},
        "units": counts,
        "open": open_costs,
        "bytes": bytes_of | {"out": size(out)},
        "ratio": total / plain["cpu"],
    }
    Path(args.out).write_text(json.dumps(result, indent=1))
    print(json.dumps(result, indent=1))


def plan(args):
    import country  # noqa: F401: beside this file

    where = Path(args.dir)
    shutil.rmtree(where, ignore_errors=True)
    subprocess.run(
        [sys.executable, str(HERE / "country.py"), str(where / "tiles"), "--tiles", str(args.tiles)], check=True
    )
    job = str(where / "job")
    command = [args.program, "job", "plan", str(where / "tiles"), "-o", str(where / "out"), "--job", job, "-q"]
    took, _ = timed(command)
    again, text = timed([args.program, "job", "units", job, "--json", "-q"])
    units = [unit["points"] for unit in json.loads(text)["units"]]
    row = {"tiles": args.tiles, "points": sum(units), "plan": took, "list": again, "units": units}
    (where / "units.json").write_text(json.dumps(row))
    print({key: row[key] for key in ("tiles", "points", "plan", "list")}, len(units), "units to read")
    shutil.rmtree(where / "tiles")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    one = commands.add_parser("measure")
    one.add_argument("scan")
    one.add_argument("dir")
    one.add_argument("--program", required=True)
    one.add_argument("--at-a-time", type=int, default=3)
    one.add_argument("--threads", type=int, default=2, help="of the run in one process, and of job finish")
    one.add_argument("--unit", type=int, default=8_000_000, help="points of a unit to read")
    one.add_argument(
        "--per-slot", type=int, default=4, help="processes per layer of units for each that runs at a time"
    )
    one.add_argument("--out", default="times.json")
    one.set_defaults(run=measure)
    one = commands.add_parser("plan")
    one.add_argument("dir")
    one.add_argument("--program", required=True)
    one.add_argument("--tiles", type=int, default=50_000)
    one.set_defaults(run=plan)
    one = commands.add_parser("simulate")
    one.add_argument("times")
    one.add_argument("units", nargs="+")
    one.add_argument("--workers", default="1,16,256")
    one.set_defaults(run=lambda args: __import__("scale_model").simulate(args))
    args = parser.parse_args()
    args.run(args)


if __name__ == "__main__":
    main()
