"""Machines for a test: network namespaces with an address each, on a switch; processes where there are none."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
from collections.abc import Sequence
from pathlib import Path

SOURCES = Path(__file__).parents[1] / "src"


class Machines:
    """Some machines that reach one another. What they run is ended with them."""

    def __init__(self, count: int, folder: Path) -> None:
        self.folder = folder
        self._started: list[subprocess.Popen[bytes]] = []
        self._spaces: list[str] = []
        self.why_not = self._connect(count)

    def _connect(self, count: int) -> str | None:
        """Makes the namespaces; says what kept them from being made."""
        if os.name != "posix" or os.geteuid() != 0 or shutil.which("ip") is None:
            return "no root, or no ip (iproute2)"
        switch, *machines = (f"pointmill-{os.getpid()}-{i}" for i in range(count + 1))
        try:
            for name in (switch, *machines):
                self._ip("netns", "add", name)
                self._spaces.append(name)
                self._ip("-n", name, "link", "set", "lo", "up")
            self._ip("-n", switch, "link", "add", "bridge", "type", "bridge")
            self._ip("-n", switch, "link", "set", "bridge", "up")
            for i, name in enumerate(machines):
                self._ip("-n", name, "link", "add", "wire", "type", "veth", "peer", "name", f"port{i}", "netns", switch)
                self._ip("-n", switch, "link", "set", f"port{i}", "master", "bridge", "up")
                self._ip("-n", name, "addr", "add", f"10.77.0.{i + 1}/24", "dev", "wire")
                self._ip("-n", name, "link", "set", "wire", "up")
        except subprocess.CalledProcessError as error:
            self._disconnect()
            return str(error.stderr.decode(errors="replace").strip() or error)
        return None

    @staticmethod
    def _ip(*words: str) -> None:
        subprocess.run(["ip", *words], check=True, capture_output=True)

    def address(self, machine: int) -> str:
        """Where others reach it."""
        return "127.0.0.1" if self.why_not else f"10.77.0.{machine + 1}"

    def start(self, machine: int, name: str, command: Sequence[str]) -> subprocess.Popen[bytes]:
        """Starts a program, with a folder of its own to work in and a log beside it."""
        space = [] if self.why_not else ["ip", "netns", "exec", self._spaces[machine + 1]]
        (self.folder / name).mkdir()
        with self.log(name).open("wb") as log:
            # ip becomes the program, so the number is that of the program; what it starts is in its group
            process = subprocess.Popen(
                [*space, *command],
                cwd=self.folder / name,
                env={**os.environ, "PYTHONPATH": str(SOURCES)},
                stdout=log,
                stderr=log,
                start_new_session=True,
            )
        self._started.append(process)
        return process

    def log(self, name: str) -> Path:
        """What a program has printed."""
        return self.folder / f"{name}.log"

    def close(self) -> None:
        """Ends what was started, and the network."""
        for process in self._started:
            crash(process)
        self._disconnect()

    def _disconnect(self) -> None:
        for name in self._spaces:
            subprocess.run(["ip", "netns", "del", name], check=False, capture_output=True)
        self._spaces.clear()


def crash(process: subprocess.Popen[bytes]) -> None:
    """Ends a program and all that it has started at once, as when a machine loses its power."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def children(process: subprocess.Popen[bytes]) -> list[list[str]]:
    """Command lines of what a program has started."""
    found = []
    for task in Path(f"/proc/{process.pid}/task").glob("*/children"):
        try:
            for child in task.read_text().split():
                found.append(Path(f"/proc/{child}/cmdline").read_text().split("\0"))
        except OSError:  # ended meanwhile
            continue
    return found
