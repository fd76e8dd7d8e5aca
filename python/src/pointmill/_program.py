"""Finds and calls the program."""

from __future__ import annotations

import os
import shutil
import subprocess
import sysconfig
from collections.abc import Sequence
from pathlib import Path

#: Names the program, if it is another one than that of this package.
VARIABLE = "POINTMILL"

_PREFIXES = ("error: ", "pointmill: ")


class PointmillError(RuntimeError):
    """The program ended without success; its text is the line that the program has printed.

    ``code`` is the exit code: 1 a fault of the program, 2 usage, 3 a broken input, 4 not supported, 5 disk full or
    another failure of the system, 6 too little memory, 7 faults found by validation, 130 interrupted. A signal is
    negative, as in :mod:`subprocess`: -9 is mostly a machine that is out of memory.
    """

    def __init__(self, line: str, code: int) -> None:
        """Both are kept when the exception goes to another process."""
        super().__init__(line, code)
        self.line = line
        self.code = code

    def __str__(self) -> str:
        """The line."""
        return self.line


def find() -> str:
    """Path of the program: what the environment names as ``POINTMILL``, that of this package, or one on the path.

    Raises:
        FileNotFoundError: There is none.
    """
    named = os.environ.get(VARIABLE)
    if named:
        return named
    name = "pointmill.exe" if os.name == "nt" else "pointmill"
    for scheme in ("", f"{os.name}_user"):
        folder = sysconfig.get_path("scripts", scheme) if scheme else sysconfig.get_path("scripts")
        if folder and (Path(folder) / name).is_file():
            return str(Path(folder) / name)
    found = shutil.which("pointmill")
    if found is None:
        raise FileNotFoundError(f"pointmill: not installed here, not on the path, and {VARIABLE} does not name it")
    return found


def run(arguments: Sequence[str | os.PathLike[str]], *, cwd: str | os.PathLike[str] | None = None) -> str:
    """Calls the program and returns what it prints on standard output. ``cwd`` is the folder it works in.

    Raises:
        PointmillError: The program failed.
        FileNotFoundError: There is no program, see :func:`find`.
    """
    command = [find(), *(os.fspath(argument) for argument in arguments)]
    done = subprocess.run(
        command, cwd=cwd, stdin=subprocess.DEVNULL, capture_output=True, text=True, encoding="utf-8", errors="replace"
    )
    if done.returncode != 0:
        raise PointmillError(_line(done.stderr, done.returncode), done.returncode)
    return done.stdout


def _line(stderr: str, code: int) -> str:
    """The last line, which says what was wrong."""
    lines = [line for line in stderr.splitlines() if line.strip()]
    if not lines or code < 0:
        return f"pointmill was ended by signal {-code}" if code < 0 else f"pointmill ended with code {code}"
    line = lines[-1]
    for prefix in _PREFIXES:
        line = line.removeprefix(prefix)
    return line
