#!/usr/bin/env python3
"""Writes the licence texts of everything that is linked into the program to one file.

    python3 packaging/licences.py OUT [TARGET]
    python3 packaging/licences.py --check     names what has no text, and writes nothing

The list is that of `cargo metadata` for this machine, or for TARGET: normal dependencies of the package `pointmill`, and theirs.
Texts are the files LICENSE*, LICENCE*, COPYING*, NOTICE* and UNLICENSE* of each package, those of bundled C libraries included.
Packages without such a file that are under the MIT licence get its text with their authors; any other ends the run. The notices
of Rust's standard library are those that come with the compiler. Needs Python 3.9.
"""

import html
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


def metadata(target):
    target = target or re.search(r"host: (\S+)", subprocess.run(["rustc", "-vV"], check=True, capture_output=True, text=True).stdout)[1]
    command = ["cargo", "metadata", "--format-version", "1", "--locked", "--filter-platform", target]
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


def standard_library():
    """The notices of Rust's standard library and of what it is made with; compilers of distributions come without the file."""
    found = subprocess.run(["rustc", "--print", "sysroot"], check=True, capture_output=True, text=True).stdout.strip()
    notices = Path(found) / "share" / "doc" / "rust" / "COPYRIGHT-library.html"
    if not notices.is_file():
        return without_file({"name": "Rust", "version": "", "license": "MIT", "authors": ["The Rust Project Developers"]})
    text = html.unescape(re.sub(r"<[^>]+>", "", notices.read_text("utf-8")))
    return [("notices", re.sub(r"\n\s*\n\s*\n+", "\n\n", text).strip())]


def main(out, target=None):
    lines = ["pointmill contains the software below, under the licences that follow it."]
    packages = linked(metadata(target))
    parts = [(f"{p['name']} {p['version']}: {p['license'] or 'see below'}", texts(p) or without_file(p)) for p in packages]
    parts.append(("The Rust standard library: MIT OR Apache-2.0", standard_library()))
    for title, licences in parts:
        lines += ["", "=" * 100, title]
        for name, text in licences:
            lines += ["", f"--- {name}", "", text]
    if out is not None:
        Path(out).write_text("\n".join(lines) + "\n", "utf-8")
    print(f"{out or 'complete'}: {len(packages)} packages")


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    main(None if sys.argv[1] == "--check" else sys.argv[1], *sys.argv[2:])
