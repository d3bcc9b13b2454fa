"""How long an agent waits: ``python -m tests.benchmarks.agent_latency [WORDS OF vlmgineer mcp ...]``.

A scripted session with a server in a process of its own: a row for each call, with the wall time until its answer, the
processor time of the server and its workers meanwhile, and what is asked of a quiet machine of two cores. Run it alone.
"""

from __future__ import annotations

import itertools
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from core.support.cli import command, say
from tests.support.processes import family

ROOT = Path(__file__).parents[2]
SOLUTIONS = ROOT / "tests" / "tasks" / "solutions"
USUAL = (
    *("task=BringCube", "sim=mujoco", "prompt.context=pictures", "listener=[]"),
    *("film=false", "second=[]", "budget.final_s=15"),
)
HELLO = {
    "protocolVersion": "2025-06-18",
    "capabilities": {},
    "clientInfo": {"name": "latency", "version": "1"},
}


def processor_seconds(pid: int) -> float:
    """Return the processor time of a process, of those that it began, and of those of them that have ended."""
    ticks = 0
    for member in family(pid):
        try:
            stat = Path(f"/proc/{member}/stat").read_text()
        except FileNotFoundError:  # it has just ended
            continue
        ticks += sum(map(int, stat.rpartition(")")[2].split()[11:15]))
    return ticks / os.sysconf("SC_CLK_TCK")


class Client:
    """A client of a server in a process of its own, that asks one thing after the other."""

    def __init__(self, words: list[str], folder: Path) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "core", "mcp", *words, "folder=run"],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=(folder / "said").open("wb"),
        )
        self._numbers = itertools.count(1)

    def send(self, **message: Any) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(
            json.dumps({"jsonrpc": "2.0", **message}).encode() + b"\n"
        )
        self.process.stdin.flush()

    def ask(self, method: str, params: dict[str, Any]) -> dict[str, Any]:
        """Send a request, and return what it is answered."""
        number = next(self._numbers)
        self.send(id=number, method=method, params=params)
        assert self.process.stdout is not None
        for line in self.process.stdout:
            answer: dict[str, Any] = json.loads(line)
            if answer.get("id") == number:
                return answer["result"]
        raise SystemExit("the server has ended")

    def call(self, name: str, **arguments: Any) -> str:
        """Call a tool, and return the text of its answer, which may come later."""
        answer = self.ask("tools/call", {"name": name, "arguments": arguments})
        return "\n".join(part.get("text", "") for part in answer["content"])


def list_calls(design: dict[str, Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Yield what is measured: what is asked of it, s; the tool; and its arguments."""
    plan = design["strategies"][0]["action_sets"][0]
    last = f"action_sets.0.{len(plan) - 1}.1"
    fork = {"candidate": "g0-a0-s0-p0", "from_waypoint": len(plan) - 1}
    yield "5", "describe_task", {}
    yield "", "describe_task", {}
    yield "1", "look", {}
    yield "3", "look", {"designs": design}
    yield "1", "check_design", {"designs": design}
    yield "", "rehearse", {"designs": design, "waypoint": 1}
    yield "", "try_design", {"designs": design}
    yield "", "try_design", {**fork, "change": {last: 0.03}}
    yield "", "try_design", {**fork, "change": {last: -0.03}}
    yield "", "watch", {"candidate": "g0-a0-s0-p0"}
    yield "", "trace", {"candidate": "g0-a0-s0-p0"}
    yield "", "finish", {}
    yield "", "wait", {}


def main(words: list[str]) -> None:
    """Play the session, and print its table."""
    words = [*USUAL, *words]  # of two the last counts
    task = [word for word in words if word.startswith("task=")][-1].partition("=")[2]
    design = json.loads((SOLUTIONS / f"{task}.json").read_text())
    with tempfile.TemporaryDirectory() as folder:
        client = Client(
            list({w.partition("=")[0]: w for w in words}.values()), Path(folder)
        )
        say(f"{'call':42} wall (s)  processor (s)  asked (s)")

        def measure(asked: str, name: str, **arguments: Any) -> None:
            spent = processor_seconds(client.process.pid)
            began = time.monotonic()
            if name == "initialize":
                client.ask(name, HELLO)
                text = ""
                client.send(method="notifications/initialized")
            else:
                text = client.call(name, **arguments)
            wall_s = time.monotonic() - began
            spent = processor_seconds(client.process.pid) - spent
            given = ", ".join(arguments)
            label = f"{name} ({given})" if given else name
            say(f"{label:42} {wall_s:8.2f}  {spent:13.2f}  {asked:>9}")
            if name != "finish" and " goes on (" in text:
                measure("", "wait")

        measure("2", "initialize")
        for asked, name, arguments in list_calls(design):
            measure(asked, name, **arguments)

        assert client.process.stdin is not None
        client.process.stdin.close()
        client.process.wait()


if __name__ == "__main__":
    command(main)
