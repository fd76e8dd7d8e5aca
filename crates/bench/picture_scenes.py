#!/usr/bin/env python3
"""Scans with surfaces where samplers and node borders are tried hardest: picture_scenes.py SCENE POINTS OUT.las

    python3 crates/bench/picture_scenes.py terrestrial 3000000 street.las [--raise 5.123] [--seed 7]

aerial: terrain, houses and trees in swaths. terrestrial: a street of four scanner positions, its ground at z = 0 within
2 mm. corridor: 1 km x 10 m x 5 m, the floor at 0. room: six planes on multiples of 1 m within 2 mm. statue: a closed
surface with knobs, 10 m high. The same points each time. Needs numpy.
"""

import argparse

import numpy as np

from hard_scenes import PIECE, las

STEP = {"aerial": 0.01, "terrestrial": 0.001, "corridor": 0.001, "room": 0.001, "statue": 0.0001}


def terrain(x, y):
    return 30 * np.sin(x / 310) * np.cos(y / 270) + 8 * np.sin(x / 47 + 1) * np.sin(y / 39) + 0.4 * np.sin(x / 3.1)


def aerial(rng, index, total):
    """20 points per square metre, in swaths of 500 m that are flown to and fro."""
    side = np.sqrt(total / 20)
    width, per_lane = min(500, side), total / max(1, np.ceil(side / 500))
    lane = np.floor(index / per_lane)
    flown = (index / per_lane - lane) * side
    phase = index * 0.0137 % 2
    x = np.minimum(lane * 500, side - width) + np.minimum(phase, 2 - phase) * width + rng.normal(0, 0.05, len(index))
    y = np.where(lane % 2 == 0, flown, side - flown) + rng.normal(0, 0.4, len(index))
    block_x, block_y = np.floor(x / 60), np.floor(y / 45)
    height = (block_x * 7919 + block_y * 104_729) % 23
    in_x, in_y = x - block_x * 60, y - block_y * 45
    is_house = (height > 9) & (in_x > 15) & (in_x < 42) & (in_y > 10) & (in_y < 33)
    is_tree = ~is_house & (np.sin(x / 11) * np.sin(y / 13) > 0.45)
    roof = terrain(block_x * 60 + 28, block_y * 45 + 21) + height
    z = np.where(is_house, roof, terrain(x, y) + is_tree * np.sqrt(rng.random(len(index))) * 14)
    return np.stack([x + 476_000, y + 4_428_000, z + 400 + rng.normal(0, 0.03, len(index))], 1)


def terrestrial(rng, index, total):
    """Columns of rays from four positions in a street with house fronts 11 m high; at most 120 m."""
    per_station = total / 4
    station = np.floor(index / per_station)
    azimuth = (index / per_station - station) * 2 * np.pi
    rows = max(64, int(np.sqrt(per_station / 2)))
    elevation = (index % rows / rows - 0.42) * 2.2
    origin = np.stack([station * 18, station % 2 * 2 - 1, np.full(len(index), 1.7)], 1)
    ray = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        ground = np.where(ray[:, 2] < 0, -origin[:, 2] / ray[:, 2], np.inf)
        front = (9 * np.sign(ray[:, 1]) - origin[:, 1]) / ray[:, 1]
        hit = origin[:, 2] + front * ray[:, 2]
    front = np.where((hit >= 0) & (hit <= 11), front, np.inf)
    reach = np.minimum(np.minimum(ground, front), 120) + rng.normal(0, 0.002, len(index))
    return origin + reach[:, None] * ray


def box_faces(rng, count, size, noise):
    """Points on the six faces of a box from 0 to `size`, each face by its area."""
    size = np.asarray(size, float)
    areas = np.prod(size) / size
    axis = rng.choice(3, count, p=areas / areas.sum())
    points = rng.random((count, 3)) * size
    rows = np.arange(count)
    points[rows, axis] = rng.integers(0, 2, count) * size[axis] + rng.normal(0, noise, count)
    return points


def corridor(rng, index, total):
    return box_faces(rng, len(index), (1000, 10, 5), 0.002)


def room(rng, index, total):
    return box_faces(rng, len(index), (8, 6, 3), 0.002) + np.array([3, -2, 0])


def statue(rng, index, total):
    azimuth, z = rng.random(len(index)) * 2 * np.pi, 2 * rng.random(len(index)) - 1
    polar = np.arccos(z)
    knobs = 0.2 * np.sin(5 * azimuth) * np.sin(3 * polar) + 0.03 * np.cos(31 * azimuth) * np.sin(29 * polar)
    radius = 1 + knobs + rng.normal(0, 0.0002, len(index))
    around = np.sqrt(1 - z * z)
    return np.stack([2 * around * np.cos(azimuth), 2 * around * np.sin(azimuth), 5 * z], 1) * radius[:, None]


SCENES = {make.__name__: make for make in (aerial, terrestrial, corridor, room, statue)}


def pieces(name, points, seed, lift, origin):
    rng = np.random.default_rng(seed)
    for start in range(0, points, PIECE):
        index = np.arange(start, min(points, start + PIECE), dtype=float)
        xyz = SCENES[name](rng, index, points) - origin
        xyz[:, 2] += lift
        yield np.round(xyz / STEP[name]).astype(np.int32)


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("scene", choices=SCENES)
    arguments.add_argument("points", type=float)
    arguments.add_argument("out")
    arguments.add_argument("--seed", type=int, default=7)
    arguments.add_argument("--raise", dest="lift", type=float, default=0, help="metres added to z")
    given = arguments.parse_args()
    origin = (476_000, 4_428_000, 0) if given.scene == "aerial" else (0, 0, 0)
    las(given.out, pieces(given.scene, int(given.points), given.seed, given.lift, origin), STEP[given.scene],
        offset=origin)


if __name__ == "__main__":
    main()
