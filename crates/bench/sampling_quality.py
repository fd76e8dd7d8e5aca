"""Distances between the points that each level of a Potree 2.0 dataset draws, over the borders of nodes too.

Part of first_picture.py --quality. Needs numpy and scipy.
"""

import numpy as np
from scipy.spatial import cKDTree

OFFERED = 200_000
SEED = 7
ROUNDING = 1.0001


def positions(octree):
    """All points in the order of octree.bin: stored integers as float64 · scale, their levels, whether of inner nodes."""
    nodes = sorted((n for n in octree.nodes() if n.size), key=lambda n: n.offset)
    before = 0
    for attribute in octree.metadata["attributes"]:
        if attribute["name"].lower() == "position":
            break
        before += attribute["size"]
    payload = np.memmap(octree.folder / "octree.bin", np.uint8, "r")
    xyz = np.concatenate([payload[n.offset:n.offset + n.size].reshape(-1, octree.stride)[:, before:before + 12].copy()
                          .view("<i4") for n in nodes])
    counts = [n.points for n in nodes]
    level = np.repeat(np.array([n.level for n in nodes], np.uint8), counts)
    is_inner = np.repeat([bool(n.children) for n in nodes], counts)
    return xyz * np.array(octree.metadata["scale"]), level, is_inner


def tree(points):
    return cKDTree(points, balanced_tree=False, compact_nodes=False)


def levels(octree):
    """Per level with inner nodes: its points, the share of them with another of the same level nearer than 0.999 of the
    level's spacing; of up to 200,000 points of deeper levels, the share within 1.0 and 1.5 spacings of a point of this
    level or above, and the largest distance in spacings."""
    if octree.metadata["encoding"] == "BROTLI":
        raise SystemExit(f"{octree.folder}: BROTLI is not read here")
    xyz, level, is_inner = positions(octree)
    rng, rows = np.random.default_rng(SEED), []
    for l in np.unique(level[is_inner]):
        spacing = octree.metadata["spacing"] / 2.0**l
        own = xyz[is_inner & (level == l)]
        nearest = tree(own).query(own, k=2)[0][:, 1] if len(own) > 1 else np.array([np.inf])
        deeper = np.flatnonzero(level > l)
        offered = xyz[rng.choice(deeper, min(OFFERED, len(deeper)), replace=False)]
        far = tree(xyz[level <= l]).query(offered)[0] / spacing
        rows.append({"level": int(l), "points": len(own), "close": float(np.mean(nearest < 0.999 * spacing)),
                     "within_1": float(np.mean(far <= ROUNDING)), "within_1_5": float(np.mean(far <= 1.5 * ROUNDING)),
                     "worst": float(far.max())})
    return rows
