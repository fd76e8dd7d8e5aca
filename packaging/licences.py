#!/usr/bin/env python3
"""Writes the licence texts of everything that is linked into the program to one file.

    python3 packaging/licences.py OUT

The list is that of `cargo metadata` for this machine: normal dependencies of the package `pointmill`, and theirs. Texts are the
files LICENSE*, LICENCE*, COPYING*, NOTICE* and UNLICENSE* of each package, those of bundled C libraries included. Packages
without such a file that are under the MIT licence get its text with their authors; any other ends the run. Needs Python 3.9.
"""

import json
import re
import subprocess
import sys
from pathlib import Path

PATTERN = re.compile(r"(licen[sc]e|copying|notice|unlicense)", re.IGNORECASE)
# sources of a bundled library are at most this many folders below the package
DEPTH = 3
# libraries that are bundled without the file of their licence
HOLDERS = {"brotlic-sys": "2009, 2010, 2013-2016 by the Brotli Authors, and the authors of brotlic-sys"}


def metadata():
    host = re.search(r"host: (\S+)", subprocess.run(["rustc", "-vV"], check=True, capture_output=True, text=True).stdout)[1]
    command = ["cargo", "metadata", "--format-version", "1", "--locked", "--filter-platform", host]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def linked(data):
    """Packages that the program links, by name and version."""
    nodes = {node["id"]: node for node in data["resolve"]["nodes"]}
    packages = {package["id"]: package for package in data["packages"]}
    root = next(id for id, package in packages.items() if package["name"] == "pointmill")
    waiting, seen = [root], {root}
    while waiting:
        for dep in nodes[waiting.pop()]["deps"]:
            is_normal = any(kind["kind"] is None for kind in dep["dep_kinds"])
            is_macro = any("proc-macro" in target["kind"] for target in packages[dep["pkg"]]["targets"])
            if is_normal and not is_macro and dep["pkg"] not in seen:
                seen.add(dep["pkg"])
                waiting.append(dep["pkg"])
    others = [packages[id] for id in seen if packages[id]["source"] is not None]
    return sorted(others, key=lambda package: (package["name"], package["version"]))


def texts(package):
    folder = Path(package["manifest_path"]).parent
    files = [path for path in folder.rglob("*") if path.is_file() and len(path.relative_to(folder).parts) <= DEPTH]
    named = [path for path in files if PATTERN.match(path.name) and path.suffix.lower() in ("", ".md", ".txt", ".mit", ".apache")]
    return [(path.relative_to(folder), path.read_text("utf-8", "replace").strip()) for path in sorted(named)]


def without_file(package):
    """The MIT licence, which a package names without its text."""
    if "MIT" not in (package["license"] or ""):
        sys.exit(f"{package['name']} {package['version']} ({package['license']}) has no file of a licence")
    text = (Path(__file__).parent.parent / "LICENSE-MIT").read_text("utf-8")
    holders = HOLDERS.get(package["name"]) or ", ".join(package["authors"]) or f"the authors of {package['name']}"
    return [("MIT", re.sub(r"^Copyright.*$", lambda _: f"Copyright (c) {holders}", text, count=1, flags=re.MULTILINE).strip())]


def main(out):
    lines = ["pointmill contains the software below, under the licences that follow it.", ""]
    packages = linked(metadata())
    for package in packages:
        lines += ["=" * 100, f"{package['name']} {package['version']}: {package['license'] or 'see below'}", ""]
        for name, text in texts(package) or without_file(package):
            lines += [f"--- {name}", "", text, ""]
    Path(out).write_text("\n".join(lines) + "\n", "utf-8")
    print(f"{out}: {len(packages)} packages")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
