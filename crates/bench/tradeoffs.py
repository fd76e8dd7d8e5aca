#!/usr/bin/env python3
"""Measures four made-up scenes with `pointmill measure`, and writes docs/tradeoffs.md with plots and pictures.

    cargo build --release && python3 crates/bench/tradeoffs.py --program target/release/pointmill

Scenes: those of picture_scenes.py, with colours that follow the ground. Run it on an idle machine; ten minutes with two
million points each. Needs numpy.
"""

import argparse
import base64
import json
import platform
import re
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from hard_scenes import las
from picture_scenes import SCENES, STEP, pieces

KINDS = {
    "aerial": "Terrain, houses and trees from the air, 20 points per square metre, step 0.01 m.",
    "terrestrial": "A street from four scanner positions: density falls with the square of the distance, step 0.001 m.",
    "statue": "A closed surface with knobs, 10 m high, step 0.0001 m.",
    "corridor": "A tunnel of 1 km x 10 m x 5 m, step 0.001 m.",
}
PLOTS = {"Time against size": "time", "Size against pictures": "pictures", "Colours by level": "colours"}
SHOWN = ["", "potree2, poisson", "potree2, random", "batches, auto bits"]
VIEW = "near"


def painter(name):
    """Colours of places: a ramp with height, patterns of a hundredth to a tenth of the scene, and the noise of a camera."""
    size = {"aerial": 200, "terrestrial": 40, "statue": 5, "corridor": 10}[name]

    def paint(rng, xyz):
        waves = [np.sin(xyz @ np.array(k) * 2 * np.pi / size) for k in ((7, 2, 1), (-3, 8, 2), (31, -17, 23), (5, 43, -29))]
        base = np.stack([0.5 + 0.25 * waves[0], 0.45 + 0.2 * waves[1], 0.4 + 0.2 * np.sin(xyz[:, 2] * 6 / size)], 1)
        texture = 0.12 * (waves[2] > 0.3)[:, None] + 0.08 * (waves[3] > 0)[:, None]
        noise = rng.normal(0, 0.02, (len(xyz), 1))
        return (np.clip(base + texture + noise, 0, 1) * 255).astype(np.uint16) * 257

    return paint


def scene(name, points, path):
    origin = (476_000, 4_428_000, 0) if name == "aerial" else (0, 0, 0)
    las(path, pieces(name, points, 7, 0, origin), STEP[name], offset=origin, paint=painter(name))


def number(value):
    if value is None:
        return "–"
    if value == 0:
        return "0"
    return f"{value:.1e}" if abs(value) < 1e-4 else f"{value:.3g}"


def mean(values):
    values = [v for v in values if v is not None]
    return sum(values) / len(values) if values else None


def error_of(psnr):
    return 0 if psnr is None else 255 / 10 ** (psnr / 20)


def table(result):
    lines = ["| setting | CPU s per million points | MiB peak | bytes per point | position error, max | mean ΔE2000 | "
             "picture error | SSIM | holes, % | pops, % |", "|---|---|---|---|---|---|---|---|---|---|"]
    million = result["scene"]["points"] / 1e6
    for row in result["rows"]:
        if row["failed"]:
            lines.append(f"| {row['name']} | {row['failed']} |" + " |" * 8)
            continue
        cost, views = row["cost"], row["views"]
        cells = [
            f"**{row['name']}**" if row["is_on_front"] else row["name"],
            number(cost["cpu_seconds"] / million),
            f"{cost['peak_memory_bytes'] / 2**20:.0f}",
            number(cost["bytes_per_point"]),
            number(max(axis["max"] for axis in row["position"])) if row["position"] else "–",
            number(mean([level["delta_e"] for level in row["levels"]])),
            number(mean([error_of(view["error"]["psnr"]) for view in views])),
            number(mean([view["error"]["ssim"] for view in views])),
            number(100 * mean([view["error"]["holes"] for view in views])),
            number(100 * row["popping"]),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def section(name, result, page, folder):
    lines = [f"## {name.capitalize()}", "", f"{KINDS[name]} {result['scene']['points']:,} points.", ""]
    lines += table(result) + [""]
    lines += ["| output | profile | options |", "|---|---|---|"]
    lines += [f"| {p['output']} | {p['name']} | `{' '.join(p['arguments'])}` |" for p in result["profiles"]] + [""]
    lines += [f"- {trade['sentence']}" for trade in result["trades"]] + [""]
    for title, svg in re.findall(r"<figure><figcaption>([^<]*)</figcaption>(<svg.*?</svg>)", page, re.S):
        if title in PLOTS:
            file = f"{name}-{PLOTS[title]}.svg"
            (folder / file).write_text(svg)
            lines += [f"![{title}]({folder.name}/{file})"]
    lines += ["", f"The view *{VIEW}*: " + "; ".join(s or "all points" for s in SHOWN) + ".", ""]
    part = page[page.index(f"<h3>{VIEW}</h3>"):]
    pictures = re.findall(r"<figcaption>(.*?)</figcaption><img[^>]*base64,([^\"]*)\"", part.split("<h3>")[1], re.S)
    for i, setting in enumerate(SHOWN):
        caption = "the whole cloud" if not setting else setting + ":"
        found = next((data for text, data in pictures if text.startswith(caption)), None)
        if found:
            file = f"{name}-{i}.jpg"
            (folder / file).write_bytes(base64.b64decode(found))
            lines += [f"![{setting or 'all points'}]({folder.name}/{file})"]
    return lines + [""]


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--program", default="target/release/pointmill")
    arguments.add_argument("--points", type=float, default=2e6)
    arguments.add_argument("--out", type=Path, default=Path("docs/tradeoffs.md"))
    given = arguments.parse_args()
    folder = given.out.with_suffix("")
    folder.mkdir(exist_ok=True)
    text = Path(__file__).with_name("tradeoffs_head.md").read_text().rstrip().split("\n")
    text = [line.replace("MACHINE", f"{platform.machine()}, {platform.system()}") for line in text] + [""]
    for name in KINDS:
        with tempfile.TemporaryDirectory() as work:
            scan, out = f"{work}/{name}.las", f"{work}/out"
            scene(name, int(given.points), scan)
            subprocess.run([given.program, "measure", scan, "-o", out, "--size", "480x360"], check=True)
            result = json.loads(Path(out, "measure.json").read_text())
            text += section(name, result, Path(out, "report.html").read_text(), folder)
    given.out.write_text("\n".join(text).rstrip() + "\n")


if __name__ == "__main__":
    main()
