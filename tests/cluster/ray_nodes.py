"""A Ray cluster of several nodes on this machine: Ray's own commands, on loopback, with a token."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.cluster.slurm import free_ports, wait_until
from tests.support.processes import family

RAY = [sys.executable, "-m", "ray.scripts.scripts"]  # the command ``ray``
SMALL_MB = 100
"""Of shared memory that a node of `Nodes` with ``small`` has; Ray's object store takes 75 MB at least."""
OWN_SHM = [
    *("unshare", "--mount", "sh", "-c"),
    f'mount -t tmpfs -o size={SMALL_MB}m shm /dev/shm && exec "$@"',
    "sh",
]


class Nodes:
    """A running cluster, whose nodes have a core each; programs find it by ``address`` and ``environment``.

    Args:
        folder: for its files.
        small: each node has a /dev/shm of its own, of `SMALL_MB`. This needs root.
    """

    def __init__(self, folder: Path, small: bool = False) -> None:
        self.folder = folder
        self._small = small
        self.environment = os.environ | {
            "HOME": str(folder),
            "RAY_AUTH_MODE": "token",
            "RAY_USAGE_STATS_ENABLED": "0",
        }
        self.address = ""
        self._nodes: list[subprocess.Popen[bytes]] = []

    def start_head(self) -> None:
        """Start a first node, at an address of its own."""
        (port,) = free_ports(1)
        self.address = f"127.0.0.1:{port}"
        if not (self.folder / ".ray/auth_token").exists():
            generate = [*RAY, "get-auth-token", "--generate"]
            subprocess.run(generate, env=self.environment, check=True)
        self._start("--head", f"--port={port}", "--include-dashboard=false")

    def add(self) -> None:
        """Start one more node."""
        self._start(f"--address={self.address}")

    def kill(self, number: int) -> None:
        """End all that runs on a node at once, as a power cut does; 0: the head."""
        node = self._nodes.pop(number)
        for pid in family(node.pid):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        node.wait()

    def fill(self, number: int) -> None:
        """Fill a node's shared memory; the node was started as a small one."""
        assert self._small
        inside = Path(f"/proc/{self._nodes[number].pid}/root/dev/shm/filler")
        with inside.open("wb") as file, contextlib.suppress(OSError):
            file.write(bytes(2 * SMALL_MB * 1_000_000))

    def stop(self) -> None:
        """End all nodes."""
        while self._nodes:
            self.kill(len(self._nodes) - 1)

    def _start(self, *words: str) -> None:
        before = self._count() if self._nodes else 0
        file = self.folder / f"node{len(self._nodes)}.out"
        command = [*RAY, "start", "--block", "--num-cpus=1", "--disable-usage-stats"]
        command += ["--node-ip-address=127.0.0.1", *words]
        if self._small:
            command = [*OWN_SHM, *command, "--object-store-memory=80000000"]
        with file.open("wb") as output:
            node = subprocess.Popen(
                command,
                env=self.environment,
                stdout=output,
                stderr=output,
                start_new_session=True,
            )
        self._nodes.append(node)
        wait_until(lambda: self._count() > before or node.poll() is not None)
        assert node.poll() is None, file.read_text()

    def _count(self) -> int:
        """Count the nodes that ever joined, dead ones too; 0: there is no head yet."""
        script = "import ray, sys; ray.init(sys.argv[1], logging_level=40); print('nodes', len(ray.nodes()))"
        done = subprocess.run(
            [sys.executable, "-c", script, self.address],
            env=self.environment,
            capture_output=True,
            text=True,
        )
        counted = re.search(r"^nodes (\d+)$", done.stdout, re.MULTILINE)
        return int(counted[1]) if counted else 0


@contextmanager
def cluster(folder: Path, count: int, small: bool = False) -> Iterator[Nodes]:
    """Start a cluster of so many nodes, see `Nodes`, and end it."""
    nodes = Nodes(folder, small)
    try:
        nodes.start_head()
        for _ in range(count - 1):
            nodes.add()
        yield nodes
    finally:
        nodes.stop()
