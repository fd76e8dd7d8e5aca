#!/usr/bin/env python3
"""What a viewer has to fetch of Potree 2.0 datasets before there is a picture, as a table or JSON.

    python3 crates/bench/first_picture.py DATASET ... [--quality] [--json]

Reads the files by docs/formats/potree2.md, independently of the crates, and walks them as viewers do. Two orders: that
of Potree 1.8 (a node before others by the radius of its sphere on the screen) and that of Fraiss' thesis and
BA_PointCloud (that radius, divided by one plus the angle to the line of sight). Both: 1920 x 1080 pixels, 60 degrees
from top to bottom, nodes below 30 pixels left out, four nodes loading at a time, all of which arrive before the next
four are asked for, and nothing fetched twice. Needs numpy; --quality needs scipy (sampling_quality.py).
"""

import argparse
import heapq
import itertools
import json
import math
import struct
import sys
from pathlib import Path

import numpy as np

WIDTH, HEIGHT = 1920, 1080
SLOPE = math.tan(math.radians(60) / 2)
LEAST_PIXELS = 30
LOADING = 4
FORCED_LEVEL = 2  # Potree counts and loads nodes down to this level wherever they are
MILLION = 1_000_000
STEPS = 20
RECORD = struct.Struct("<BBIQQ")
PROXY = 2


class Node:
    """A node whose payload may be unknown yet (`chunk` tells where its records are)."""

    def __init__(self, level, low):
        self.level, self.low = level, low  # low: index of the cube on its level, per axis
        self.children, self.chunk = [], None
        self.points = self.offset = self.size = 0

    def child(self, index):
        return Node(self.level + 1, tuple(2 * c + (index >> (2 - a) & 1) for a, c in enumerate(self.low)))


class Octree:
    """The files of a dataset, and its tree as far as it was asked for."""

    def __init__(self, folder):
        self.folder = Path(folder)
        text = (self.folder / "metadata.json").read_bytes()
        self.metadata, self.metadata_bytes = json.loads(text), len(text)
        self.hierarchy = (self.folder / "hierarchy.bin").read_bytes()
        box = self.metadata["boundingBox"]
        self.low = np.array(box["min"])
        self.side = box["max"][0] - box["min"][0]
        position = next(a for a in self.metadata["attributes"] if a["name"].lower() == "position")
        self.tight = np.array([position["min"], position["max"]])
        self.stride = sum(a["size"] for a in self.metadata["attributes"])
        self.forget()

    def forget(self):
        """As if nothing but the metadata had been read."""
        self.root = Node(0, (0, 0, 0))
        self.root.chunk = (0, self.metadata["hierarchy"]["firstChunkSize"])

    def expand(self, node):
        """Reads the chunk of a proxy, or of the root."""
        (start, size), node.chunk, nodes = node.chunk, None, [node]
        for at in range(start, start + size, RECORD.size):
            current = nodes[(at - start) // RECORD.size]
            kind, mask, current.points, offset, size_there = RECORD.unpack_from(self.hierarchy, at)
            if kind == PROXY:
                current.chunk = (offset, size_there)
                continue
            current.offset, current.size = offset, size_there
            current.points = current.points if size_there else 0
            current.children = [current.child(i) for i in range(8) if mask >> i & 1]
            nodes += current.children

    def nodes(self):
        """All nodes, the tree read to its end."""
        todo = [self.root]
        while todo:
            node = todo.pop()
            if node.chunk:
                self.expand(node)
            todo += node.children
            yield node

    def sphere(self, node):
        """Centre and radius of the sphere around the cube of a node."""
        side = self.side / 2**node.level
        return self.low + (np.array(node.low) + 0.5) * side, side * math.sqrt(3) / 2


class Camera:
    def __init__(self, position, direction):
        self.position = np.asarray(position, float)
        self.ahead = np.asarray(direction, float) / np.linalg.norm(direction)
        right = np.cross(self.ahead, (0, 0, 1))
        right /= np.linalg.norm(right)
        up = np.cross(right, self.ahead)
        wide = SLOPE * WIDTH / HEIGHT
        self.planes = np.array([self.ahead, wide * self.ahead + right, wide * self.ahead - right,
                                SLOPE * self.ahead + up, SLOPE * self.ahead - up])
        self.reach = np.abs(self.planes).sum(1)

    def sees(self, centre, radius):
        """Whether the cube in that sphere has a corner on the inner side of every plane."""
        return bool(np.all(self.planes @ (centre - self.position) + self.reach * (radius / math.sqrt(3)) >= 0))

    def pixels(self, centre, radius):
        """Radius of the sphere on the screen and the angle to the line of sight."""
        to = centre - self.position
        distance = np.linalg.norm(to)
        if distance < radius:
            return math.inf, 0.0
        return radius * HEIGHT / 2 / (SLOPE * distance), math.acos(np.clip(to @ self.ahead / distance, -1, 1))


def framed(low, high, direction=(-0.5, 0.5, -math.sqrt(0.5))):
    """The camera that has the sphere around a box in its picture: Potree's start, looking from a corner."""
    radius = np.linalg.norm(np.subtract(high, low)) / 2
    return Camera(np.add(low, high) / 2 - np.array(direction) * radius / math.sin(math.radians(30)), direction)


class Session:
    """A viewer that has opened a dataset; `requests` are (bytes, points) in their order."""

    def __init__(self, octree, order, budget):
        octree.forget()
        self.octree, self.order, self.budget = octree, order, budget
        self.requests, self.loaded = [(octree.metadata_bytes, 0)], set()
        self.fetch(octree.root)

    def fetch(self, node):
        if node.chunk:
            self.requests.append((node.chunk[1], 0))
            self.octree.expand(node)
        if node.size:
            self.requests.append((node.size, node.points))
        self.loaded.add(node)

    def traverse(self, camera):
        """What to load, most urgent first, and the points that are drawn."""
        count = drawn = 0
        missing, ticket = [], itertools.count()
        queue = [(-math.inf, next(ticket), self.octree.root, True)]
        while queue:
            _, _, node, is_parent_loaded = heapq.heappop(queue)
            if count + node.points > self.budget:
                break
            is_forced = self.order == "potree" and node.level <= FORCED_LEVEL
            if not is_forced and not camera.sees(*self.octree.sphere(node)):
                continue
            count += node.points
            is_loaded = node in self.loaded
            drawn += node.points if is_loaded else 0
            if not is_loaded and is_parent_loaded:
                missing.append(node)
            for child in node.children:
                pixels, angle = camera.pixels(*self.octree.sphere(child))
                weight = pixels if self.order == "potree" else pixels / (1 + angle)
                if pixels >= LEAST_PIXELS:
                    heapq.heappush(queue, (-weight, next(ticket), child, is_loaded))
        return missing, drawn

    def settle(self, camera, enough=math.inf):
        """Loads until the view is complete or `enough` points are there; the points drawn."""
        while True:
            missing, drawn = self.traverse(camera)
            if not missing:
                return drawn
            for node in missing[:LOADING]:
                self.fetch(node)
                if self.points() >= enough:
                    return drawn

    def points(self):
        return sum(points for _, points in self.requests)

    def figures(self, count=None):
        part = self.requests[:count]
        return {"requests": len(part), "bytes": sum(b for b, _ in part), "points": sum(p for _, p in part)}


def flight(octree):
    """Cameras from the overview down to a tenth of the longest axis above the middle, then along that axis."""
    low, high = octree.tight
    middle, extent = (low + high) / 2, high - low
    along = np.zeros(3)
    along[np.argmax(extent[:2])] = 1
    length = extent.max()
    above = np.array([0, 0, 0.1 * length])
    start = framed(low, high)
    end = middle - 0.6 * length * along + above
    down = along - np.array([0, 0, 0.3])
    for i in range(STEPS // 2):
        t = i / (STEPS // 2)
        yield Camera((1 - t) * start.position + t * end, (1 - t) * start.ahead + t * down)
    for i in range(STEPS // 2):
        yield Camera(end + i / (STEPS // 2) * length * along, down)


def nearer(octree):
    """The same view for all datasets of a scan: the tight box, from 0.7 of the distance that has all of it."""
    whole = framed(*octree.tight)
    middle = octree.tight.mean(0)
    return Camera(middle + 0.7 * (whole.position - middle), whole.ahead)


def walk(octree, order):
    overview = framed(octree.low, octree.low + octree.side)
    session = Session(octree, order, 5 * MILLION)
    opened = session.figures()
    session.settle(overview)
    found = {"opened": opened, "ten": session.figures(10)}
    session = Session(octree, order, 5 * MILLION)
    session.settle(nearer(octree), MILLION)
    found["million"] = session.figures()
    for millions in (1, 5):
        session = Session(octree, order, millions * MILLION)
        session.settle(overview)
        found[f"budget_{millions}m"] = session.figures()
    session = Session(octree, order, MILLION)
    drawn = [session.settle(camera) for camera in flight(octree)]
    return found | {"flight": session.figures() | {"drawn": round(np.mean(drawn))}}


def shape(octree):
    octree.forget()
    nodes = list(octree.nodes())
    inner = [n.points for n in nodes if n.children]
    return {"points": sum(n.points for n in nodes), "stride": octree.stride, "root_points": octree.root.points,
            "cube": octree.side / (octree.tight[1] - octree.tight[0]).max(),
            "divisor": octree.side / octree.metadata["spacing"], "nodes": len(nodes), "inner_nodes": len(inner),
            "points_per_inner_node": round(np.mean(inner)) if inner else 0,
            "first_chunk_bytes": octree.metadata["hierarchy"]["firstChunkSize"]}


def measure(folder, is_thorough):
    octree = Octree(folder)
    found = {"dataset": Path(folder).name} | shape(octree)
    found |= {order: walk(octree, order) for order in ("potree", "thesis")}
    if is_thorough:
        from sampling_quality import levels
        octree.forget()
        found["levels"] = levels(octree)
    return found


def cell(figures, least=0):
    """Requests, megabytes and points; in brackets where fewer points than wanted exist in the view."""
    text = f"{figures['requests']} · {figures['bytes'] / 1e6:.2f} MB · {figures['points']:,}"
    return f"({text})" if figures["points"] < least else text


def tables(all_found):
    print("| dataset | cube / extent | side / spacing | root points | nodes | first chunk, bytes |\n|---|---|---|---|---|---|")
    for f in all_found:
        print(f"| {f['dataset']} | {f['cube']:.3f} | {f['divisor']:.0f} | {f['root_points']:,} | {f['nodes']:,} "
              f"| {f['first_chunk_bytes']:,} |")
    print("\n| dataset | order | opened | 10 requests | 1 M points | view, budget 1 M | budget 5 M | flight | drawn in flight "
          "|\n|---|---|---|---|---|---|---|---|---|")
    for f, order in itertools.product(all_found, ("potree", "thesis")):
        w = f[order]
        print(f"| {f['dataset']} | {order} | {cell(w['opened'])} | {cell(w['ten'])} | {cell(w['million'], MILLION)} "
              f"| {cell(w['budget_1m'])} | {cell(w['budget_5m'])} | {cell(w['flight'])} | {w['flight']['drawn']:,} |")
    if not all("levels" in f for f in all_found):
        return
    print("\n| dataset | level | points of inner nodes | nearer than 0.999 spacing | within 1.0 spacing | within 1.5 | worst "
          "|\n|---|---|---|---|---|---|---|")
    for f in all_found:
        for row in f["levels"]:
            print(f"| {f['dataset']} | {row['level']} | {row['points']:,} | {row['close']:.3%} | {row['within_1']:.3%} "
                  f"| {row['within_1_5']:.4%} | {row['worst']:.3f} |")


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("datasets", nargs="+")
    arguments.add_argument("--quality", action="store_true", help="also distances between the points of each level")
    arguments.add_argument("--json", action="store_true")
    given = arguments.parse_args()
    found = []
    for folder in given.datasets:
        found.append(measure(folder, given.quality))
        print(folder, file=sys.stderr)
    if given.json:
        print(json.dumps(found, indent=1))
    else:
        tables(found)


if __name__ == "__main__":
    main()
