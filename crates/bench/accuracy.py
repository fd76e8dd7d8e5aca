#!/usr/bin/env python3
"""Accuracies of every output, as Markdown: what the report says and what the validator finds.

    python3 crates/bench/accuracy.py target/release/pointmill [SCAN …] >> docs/accuracy.md

Converts each scan, and the extremes that are made up here, to all formats in a folder for temporary files. Python's
standard library is enough.
"""

import decimal
import json
import random
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

UP = decimal.Context(prec=3, rounding=decimal.ROUND_CEILING)
FORMATS = ["potree2", "bintree", "batches"]


def las(points, scale, offset=(0.0, 0.0, 0.0)):
    """LAS 1.2 with points of format 0, field by field."""
    axes = list(zip(*points))
    world = lambda a, q: q * scale + offset[a]
    header = struct.pack("<4sHHIHH8sBB32s32sHHHIIBHI5I", b"LASF", 0, 0, 0, 0, 0, bytes(8), 1, 2, b"", b"", 1, 2026,
                         227, 227, 0, 0, 20, len(points), len(points), 0, 0, 0, 0)
    header += struct.pack("<6d", scale, scale, scale, *offset)
    for a in range(3):
        header += struct.pack("<2d", world(a, max(axes[a])), world(a, min(axes[a])))
    return header + b"".join(struct.pack("<3iHBBbBH", *p, 0, 9, 2, 0, 0, 0) for p in points)


def ply(points, kind):
    """Binary PLY of floats ("f") or doubles ("d")."""
    name = {"f": "float", "d": "double"}[kind]
    properties = "".join(f"property {name} {a}\n" for a in "xyz")
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{properties}end_header\n"
    return header.encode() + b"".join(struct.pack(f"<3{kind}", *p) for p in points)


def text(points, decimals):
    return "".join(" ".join(f"{v:.{d}f}" for v, d in zip(p, decimals)) + "\n" for p in points).encode()


def extremes():
    """What, file name, bytes, options, formats."""
    rng = random.Random(10)
    spread = lambda n, far: [tuple(rng.randrange(far) for _ in range(3)) for _ in range(n)]
    far = lambda n, origin, side: [tuple(o + rng.random() * side for o in origin) for _ in range(n)]
    place = (500_000.0, 5_400_000.0, 100.0)
    degrees = [(10 + rng.random(), 48 + rng.random(), 1000 * rng.random()) for _ in range(1000)]
    long = [(0, 0, 0), (123_456_789, 987_654_321, 0), (2**31 - 1, 2**31 - 1, 0)]
    return [
        ("1 km in mm, 10 bits", "km.las", las([(0, 0, 0), (333_333, 333_333, 0), (10**6, 10**6, 0)], 0.001),
         ["--planes", "10"], ["batches"]),
        ("2147 km in mm", "long.las", las(long, 0.001), [], FORMATS),
        ("mm, `--scale 0.002`", "ties.las", las(spread(1000, 10**6), 0.001), ["--scale", "0.002"], FORMATS),
        ("degrees, 8 decimals", "degrees.txt", text(degrees, (8, 8, 2)), ["--crs", "EPSG:4326"], FORMATS),
        ("degrees, `--scale 0.00001`", "coarse.txt", text(degrees, (8, 8, 2)),
         ["--crs", "EPSG:4326", "--scale", "0.00001"], FORMATS),
        ("mm over 600 km, text", "600km.txt", text(far(1000, (0, 0, 0), 600_000), (3, 3, 3)), [], FORMATS),
        ("float32 far from 0", "float.ply", ply(far(1000, place, 100), "f"), [], FORMATS),
        ("doubles, no step", "double.ply", ply(far(1000, place, 100), "d"), [], FORMATS),
        ("text, 3 decimals", "decimals.txt", text(far(1000, place, 100), (3, 3, 3)), [], FORMATS),
    ]


def run(*command):
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
    if not done.stdout:
        sys.exit(f"{' '.join(map(str, command))}: {done.stderr}")
    return json.loads(done.stdout)


def up(v):
    """Three digits, not rounded down."""
    return f"{UP.create_decimal_from_float(v):g}"


def share(integers):
    lost = integers["points"] - integers["same"]
    return "all" if lost == 0 else f"{integers['same']:,} of {integers['points']:,}"


def rows(program, what, scan, options, formats, out):
    to = [word for name in formats for word in ("--to", name)]
    report = run(program, "convert", scan, "-o", out, "--json", "--overwrite", "-q", *to, *options)
    scale = " ".join(dict.fromkeys(f"{s:g}" for s in report["grid"]["scale"]))
    for output in report["outputs"]:
        stated = output["accuracy"]
        outcome = run(program, "validate", Path(out) / output["folder"], "--against", scan, "--json", "--fast")
        found = outcome["accuracy"]
        agrees = "yes" if outcome["ok"] else "**no**"
        if not (found["lattice"] and found["format"]):
            agrees += ", in part"
        total, metres = stated["total"], stated.get("metres")
        largest = up(total["max_3d"]) + (f" ({up(metres['total']['max_3d'])} m)" if metres else "")
        mean = max(total["mean"], key=abs)
        merged = stated["merged"]
        merged = "/".join("?" if merged[k] is None else f"{merged[k]:,}" for k in ("lattice", "format"))
        print(f"| {what} | {scale} | {output['format']} | {up(stated['lattice']['max_3d'])} | "
              f"{up(stated['format']['max_3d'])} | {largest} | {total['rms_3d']:.2g} | {mean:.2g} | "
              f"{share(stated['integers'])} | {merged} | {agrees} |", flush=True)


def main():
    program, scans = sys.argv[1], sys.argv[2:]
    print("| scan | step | output | lattice: max | format: max | both: max | RMS | mean, worst axis | integers that come "
          "back | fell together, lattice/format | the validator agrees |\n|---|---|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        for scan in scans:
            rows(program, Path(scan).stem, scan, [], FORMATS, out)
        for what, name, data, options, formats in extremes():
            path = Path(folder) / name
            path.write_bytes(data)
            rows(program, what, path, options, formats, out)


if __name__ == "__main__":
    main()
