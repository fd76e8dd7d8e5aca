#!/usr/bin/env python3
"""Measures `convert --derive normals,radius`: errors on surfaces whose normals are known, and the time beside Open3D's.

    cargo build --profile quick && python3 crates/bench/surfels.py --program target/quick/pointmill

Prints the tables of docs/tradeoffs.md ("Surfels") as Markdown. Needs numpy, scipy and, for the comparison, open3d (without it, the
columns of it are missing). With --scan it is the time alone, of the points of that scan. One thread each; run it on an idle machine.
"""

import argparse
import json
import os
import subprocess
import tempfile
import time
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"  # of Open3D, before it is loaded

import numpy as np
from scipy.spatial import cKDTree

try:
    import open3d
except ImportError:
    open3d = None

NEIGHBOURS = (8, 16, 32)
PLY_TYPES = {"double": "<f8", "float": "<f4", "uchar": "u1", "ushort": "<u2", "short": "<i2", "int": "<i4", "char": "i1", "uint": "<u4"}


def sphere(rng, n):
    v = rng.normal(size=(n, 3))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    return 10 * v, v


def torus(rng, n):
    u, v = rng.uniform(0, 2 * np.pi, (2, 4 * n))
    keep = rng.uniform(0, 13, 4 * n) < 10 + 3 * np.cos(v)  # the same density everywhere
    u, v = u[keep][:n], v[keep][:n]
    normal = np.stack([np.cos(u) * np.cos(v), np.sin(u) * np.cos(v), np.sin(v)], 1)
    return np.stack([10 * np.cos(u), 10 * np.sin(u), 0 * u], 1) + 3 * normal, normal


def noisy_plane(rng, n):
    """Deviations of a quarter of the mean distance of 200,000 points."""
    xy = rng.uniform(0, 30, (n, 2))
    z = rng.normal(0, 30 / np.sqrt(200_000) / 4, n)
    return np.column_stack([xy, z]), np.tile([0.0, 0.0, 1.0], (n, 1))


SURFACES = {"sphere": sphere, "torus": torus, "plane with noise": noisy_plane}


def write_ply(path, xyz):
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(xyz)}\n"
    head += "".join(f"property double {axis}\n" for axis in "xyz") + "end_header\n"
    path.write_bytes(head.encode() + np.ascontiguousarray(xyz, "<f8").tobytes())


def read_ply(path):
    raw = path.read_bytes()
    end = raw.index(b"end_header\n") + 11
    words = [line.split() for line in raw[:end].decode().splitlines() if line.startswith("property")]
    return np.frombuffer(raw[end:], [(name, PLY_TYPES[kind]) for _, kind, name in words])


def pointmill(program, scan, folder, k):
    """The points with their surfels, and microseconds of one point."""
    out, ply = folder / "out", folder / "out.ply"
    options = ["--derive", "normals,radius", "--neighbours", str(k), "--threads", "1", "--checkpoint", "never"]
    subprocess.run([program, "convert", scan, "-o", out, "--overwrite", "-q", *options], check=True)
    report = json.loads((out / "report.json").read_text())
    seconds = next(p["seconds"] for p in report["phases"] if p["name"] == "derive")
    subprocess.run([program, "export", out, "-o", ply, "--overwrite", "-q"], check=True)
    return read_ply(ply), seconds / report["points"]["kept"] * 1e6


def of_open3d(xyz, k):
    """The normals, and microseconds of one point."""
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(xyz))
    begin = time.perf_counter()
    cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(k))
    return np.asarray(cloud.normals), (time.perf_counter() - begin) / len(xyz) * 1e6


def degrees(found, right):
    cos = np.abs((found * right).sum(1)) / np.linalg.norm(found, axis=1)
    return np.degrees(np.arccos(np.clip(cos, 0, 1)))


def covered(xyz, radius, rng, make):
    """The part of places of the surface that a disk covers."""
    places, _ = make(rng, 20_000)
    distance, index = cKDTree(xyz).query(places, 16)
    return (distance <= radius[index]).any(1).mean()


def quality(args, folder):
    peer = " Open3D: RMS | Open3D: µs a point |" if open3d else ""
    print(f"| surface | K | angle: RMS | median | 99 % | covered by disks | µs a point |{peer}")
    print("|---|---|---|---|---|---|---|" + "---|---|" * bool(open3d))
    for name, make in SURFACES.items():
        xyz, _ = make(np.random.default_rng(1), args.points)
        write_ply(folder / "scan.ply", xyz)
        for k in NEIGHBOURS:
            found, micros = pointmill(args.program, folder / "scan.ply", folder, k)
            at = np.column_stack([found[axis] for axis in "xyz"])
            _, original = cKDTree(xyz).query(at)
            _, right = make(np.random.default_rng(1), args.points)
            error = degrees(np.column_stack([found[a] for a in ("nx", "ny", "nz")]).astype(float), right[original])
            cover = covered(at, found["radius"], np.random.default_rng(2), make)
            row = f"| {name} | {k} | {rms(error):.3f}° | {np.median(error):.3f}° | {np.percentile(error, 99):.2f}° "
            row += f"| {100 * cover:.1f} % | {micros:.2f} |"
            if open3d:
                normals, peer_micros = of_open3d(xyz, k)
                row += f" {rms(degrees(normals, right)):.3f}° | {peer_micros:.2f} |"
            print(row, flush=True)


def rms(error):
    return np.sqrt(np.mean(error**2))


def speed(args, folder):
    print("| K | µs a point | Open3D: µs a point | ratio | largest angle between the normals |\n|---|---|---|---|---|")
    for k in NEIGHBOURS:
        found, micros = pointmill(args.program, args.scan, folder, k)
        xyz = np.column_stack([found[axis] for axis in "xyz"])
        xyz -= xyz.mean(0)
        if open3d is None:
            print(f"| {k} | {micros:.2f} | – | – | – |")
            continue
        # the order of the scan is not known any more: that of the dataset is better for Open3D
        normals, peer = of_open3d(xyz, k)
        own = np.column_stack([found[a] for a in ("nx", "ny", "nz")]).astype(float)
        apart = degrees(own, normals)
        print(f"| {k} | {micros:.2f} | {peer:.2f} | {micros / peer:.2f} | 99.9 %: {np.percentile(apart, 99.9):.3f}° |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="target/quick/pointmill")
    parser.add_argument("--points", type=int, default=200_000)
    parser.add_argument("--scan", type=Path)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        (speed if args.scan else quality)(args, Path(folder))


if __name__ == "__main__":
    main()
