"""The model of `scale.py simulate`: units to read as a real plan lists them, units to build from the octree's rules.

The ground is flat, evenly dense, and as large as country.py's tiles. Nodes of a level are squares; units are the nodes
of the level at which none has more than UNIT_POINTS, and every node above. Units of a level are built in four classes
(whether x and y are even; hills make it eight), each after its neighbours of earlier classes; a node above after its
children. Batches are cut as pointmill.jobs cuts them: layer by layer, runs in Morton order.
"""

import heapq
import json

import numpy as np

UNIT_POINTS = 300_000  # octrees/mod.rs
POINTS_PER_CELL, CELL_LEVELS = 32_768, (6, 8)  # gather/partition.rs
TILE = (1000.0, 1250.0)  # country.py, metres
RECORD = 38  # bytes of a stored point of such tiles
UNIT_WEIGHT = 20_000  # pointmill.jobs: points that a unit counts beside its own
THREADS = 4  # of a worker
LINK, STORE = 1.25e9, 10e9  # bytes per second: of a machine, of the shared file system
ROUND_TRIP = 0.5e-3  # seconds to open, or to list, a file of a shared file system


def spread(v):
    v = v.astype(np.uint64)
    for shift, mask in (
        (16, 0x0000FFFF0000FFFF),
        (8, 0x00FF00FF00FF00FF),
        (4, 0x0F0F0F0F0F0F0F0F),
        (2, 0x3333333333333333),
        (1, 0x5555555555555555),
    ):
        v = (v | (v << np.uint64(shift))) & np.uint64(mask)
    return v


class Batches:
    """Batches with the points, the units and the batches that each needs."""

    def __init__(self):
        self.points, self.units, self.needs = [], [], []

    def add(self, points, units, needs=()):
        self.points.append(points)
        self.units.append(units)
        self.needs.append(list(needs))


def build_batches(tiles, points, slots, per_slot=4, least=4_000_000):
    """Batches of all units to build; the number of units, and of those the subtrees."""
    columns = int(tiles**0.5) or 1
    width, height = columns * TILE[0], -(-tiles // columns) * TILE[1]
    side = max(width, height)
    level = 0
    while points * min(1.0, (side / 2**level) ** 2 / (width * height)) > UNIT_POINTS:
        level += 1
    made, below, all_units, subtrees = Batches(), None, 0, 0
    for depth in range(level, -1, -1):
        nodes = 2**depth
        wide, high = (int(np.ceil(nodes * length / side)) for length in (width, height))
        grid = np.full((wide + 2, high + 2), -1, np.int64)  # batch of each node, with a rim
        each = points / (wide * high) if depth == level else 0
        subtrees = subtrees or wide * high
        all_units += wide * high
        for parity in range(4):
            x, y = np.meshgrid(np.arange(parity >> 1, wide, 2), np.arange(parity & 1, high, 2), indexing="ij")
            x, y = x.ravel(), y.ravel()
            if not x.size:
                continue
            order = np.argsort(spread(x) | spread(y) << np.uint64(1))
            x, y = x[order], y[order]
            total = (each + UNIT_WEIGHT) * x.size
            count = max(1, min(x.size, slots * per_slot, max(slots, int(total // least))), -(-x.size // 20_000))
            number = np.arange(x.size) * count // x.size
            pairs = []
            for dx in (-1, 0, 1):
                for dy in (-1, 0, 1):
                    pairs.append((number, grid[x + 1 + dx, y + 1 + dy]))
            if below is not None:
                for dx in (0, 1):
                    for dy in (0, 1):
                        pairs.append(
                            (
                                number,
                                below[
                                    np.minimum(2 * x + dx, below.shape[0] - 3) + 1,
                                    np.minimum(2 * y + dy, below.shape[1] - 3) + 1,
                                ],
                            )
                        )
            first = len(made.points)
            needs = [set() for _ in range(count)]
            for owner, needed in pairs:
                found = needed >= 0
                for code in np.unique(owner[found] << 32 | needed[found]):
                    needs[int(code) >> 32].add(int(code) & 0xFFFFFFFF)
            sizes = np.bincount(number, minlength=count)
            for i in range(count):
                made.add(each * sizes[i], int(sizes[i]), needs[i])
            grid[x + 1, y + 1] = first + number
        below = grid
    return made, all_units, subtrees


def read_batches(units, slots, per_slot=4):
    made = Batches()
    count = min(len(units), slots * per_slot)
    for part in np.array_split(np.array(units, float), count):
        made.add(part.sum(), len(part))
    return made


def run(batches, seconds, workers):
    """Makespan with workers that take what is ready in order, and the longest chain."""
    waits = [len(needs) for needs in batches.needs]
    users = [[] for _ in batches.needs]
    for number, needs in enumerate(batches.needs):
        for need in needs:
            users[need].append(number)
    ready = [number for number, left in enumerate(waits) if left == 0]
    heapq.heapify(ready)
    chain, running, free, now = [0.0] * len(waits), [], workers, 0.0
    while ready or running:
        while ready and free:
            number = heapq.heappop(ready)
            free -= 1
            heapq.heappush(running, (now + seconds[number], number))
        now, number = heapq.heappop(running)
        free += 1
        chain[number] = seconds[number] + max((chain[need] for need in batches.needs[number]), default=0.0)
        for user in users[number]:
            waits[user] -= 1
            if waits[user] == 0:
                heapq.heappush(ready, user)
    return now, max(chain)


def costs(times):
    """Seconds of a processor for a point, and what else was measured."""
    points, cpu, opened = times["points"], times["cpu"], times["open"]
    fixed = {
        kind: times["processes"][kind] * opened[kind if kind == "build" else "settle"]["cpu"]
        for kind in ("read", "build")
    }
    return {
        "read": max(cpu["read"] - fixed["read"], 0) / points,
        "build": (cpu["build"] - fixed["build"]) / points,
        "finish": cpu["finish"] / points,
        "plain": times["plain"]["cpu"] / points,
        "list_bytes": times["bytes"]["lists"] / points,
        "division_bytes": times["bytes"]["division"] / times["units"]["build"],
        "unit_bytes": (times["bytes"]["build"] - times["bytes"]["settle"]) / points,
        "out_bytes": times["bytes"]["out"] / points,
        # all lists of such a job are read in what opening it takes, but 5 ms
        "list_second": max(opened["build"]["cpu"] - 0.005, 1e-3)
        / (times["bytes"]["lists"] + times["bytes"]["division"]),
    }


def one(times, plan, workers):
    cost, points, tiles = costs(times), plan["points"], plan["tiles"]
    reads = read_batches(plan["units"], workers)
    builds, units, subtrees = build_batches(tiles, points, workers)
    level = min(max(-(-int(np.log2(max(points // POINTS_PER_CELL, 1))) // 2), CELL_LEVELS[0]), CELL_LEVELS[1])
    cells = 4**level * 0.8  # the country is no square
    headers = plan["list"]["cpu"]  # seconds to open all scans, on each process
    lists, division = cost["list_bytes"] * points, cost["division_bytes"] * units
    open_read = headers + tiles * ROUND_TRIP / 16
    open_build = open_read + (lists + division) * cost["list_second"] + (lists + division) / LINK
    # a cell with more points than a unit is divided by who settles: records of all are read and written, by one thread
    divides = points / cells > UNIT_POINTS
    moved = 2 * RECORD * points if divides else 0
    settle = open_build + moved / LINK

    def task(p, n, second, opened, size):
        return opened + max(p * second / THREADS, p * size / LINK) + n * 4 * ROUND_TRIP / THREADS

    read, _ = run(
        reads,
        [task(p, n, cost["read"], open_read, 2 * RECORD) for p, n in zip(reads.points, reads.units, strict=True)],
        workers,
    )
    seconds = [
        task(p, n, cost["build"], open_build, RECORD + cost["unit_bytes"])
        for p, n in zip(builds.points, builds.units, strict=True)
    ]
    build, chain = run(builds, seconds, workers)
    build = max(build, points * (RECORD + cost["unit_bytes"]) / STORE)
    read = max(read, points * 2 * RECORD / STORE)
    finish = (
        open_build
        + max(points * (cost["unit_bytes"] + cost["out_bytes"]) / LINK, points * cost["finish"] / THREADS)
        + units * ROUND_TRIP
    )
    stages = {
        "plan": plan["plan"]["cpu"] + tiles * ROUND_TRIP,
        "read": read,
        "settle": settle,
        "build": build,
        "finish": finish,
    }
    network = points * (2 * RECORD + RECORD + 2 * cost["unit_bytes"] + cost["out_bytes"]) + moved
    network += (lists + division) * len(builds.points)
    return {
        "points": points,
        "workers": workers,
        "stages": stages,
        "all": sum(stages.values()),
        "plain": max(points * cost["plain"] / THREADS, (points * (2 * RECORD + cost["out_bytes"]) + moved) / LINK),
        "chain": chain,
        "opening": open_build * len(builds.points),
        "open_build": open_build,
        "processes": len(builds.points) + len(reads.points),
        "units": units,
        "subtrees": subtrees,
        "network": network,
        "disk": points * (RECORD + cost["unit_bytes"] + cost["out_bytes"]) + moved / 2 + lists + division,
        # lists as they are in a file, and about twice that in memory
        "memory": 50e6 + 3 * (lists + division),
        "cell_points": points / cells,
    }


def clock(seconds):
    return (
        f"{seconds:.0f} s"
        if seconds < 120
        else f"{seconds / 60:.0f} min"
        if seconds < 7200
        else f"{seconds / 3600:.1f} h"
        if seconds < 172_800
        else f"{seconds / 86400:.1f} d"
    )


def amount(count):
    for power, name in ((1e12, "TB"), (1e9, "GB"), (1e6, "MB")):
        if count >= power:
            return f"{count / power:.3g} {name}"
    return f"{count:.0f} B"


def simulate(args):
    times = json.loads(open(args.times).read())
    print(
        "| points | workers | read | settle | build | finish | all | one process "
        "| longest chain | network | disk | opening | memory |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|---|---|")
    notes = []
    for path in args.units:
        plan = json.loads(open(path).read())
        for workers in map(int, args.workers.split(",")):
            row = one(times, plan, workers)
            stages = [clock(row["stages"][kind]) for kind in ("read", "settle", "build", "finish")]
            cells = [
                f"{row['points']:.2g}",
                str(workers),
                *stages,
                clock(row["all"]),
                clock(row["plain"]),
                clock(row["chain"]),
            ]
            cells += [
                amount(row["network"]),
                amount(row["disk"]),
                f"{clock(row['opening'])} × core",
                amount(row["memory"]),
            ]
            print("| " + " | ".join(cells) + " |", flush=True)
        notes.append(
            f"{row['points']:.2g} points: {len(plan['units'])} units to read, {row['units']} to build "
            f"({row['subtrees']} subtrees), {row['cell_points']:.0f} points per cell, opening {row['open_build']:.1f} s"
        )
    print("\n" + "\n".join(notes))
    print(json.dumps(costs(times)))
