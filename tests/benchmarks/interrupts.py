"""How long commands take to end after a signal: ``python -m tests.benchmarks.interrupts [times=N] [seed=N] [most=S]``.

Five commands are begun, each in a folder of its own, and get a TERM, or a Ctrl-C as a terminal sends it, at a random
moment. A row says for each when it came and how long the command and all that it had begun were there after it. The
exit status is 1 if one took longer than ``most`` seconds.
"""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from core.support.cli import command, say
from tests.support.processes import family, living

ROOT = Path(__file__).parents[2]
SOLUTION = ROOT / "tests" / "tasks" / "solutions" / "BringCube.json"
LATEST_S = 20.0
FOR_GOOD_S = 120.0

COMMANDS: dict[str, Sequence[str]] = {
    "run": ("core.run", "task=TurkeyLegs", "sim=mujoco", "executor.workers=1"),
    "study": (
        *("core", "study", "paper", "seeds=1", "tasks=BringCube,OneBook", "sim=mujoco"),
        *(
            "methods=full,sampling,gripper",
            "executor.workers=1",
            "yes=true",
            "folder=study",
        ),
    ),
    "evaluate": (
        "core",
        "evaluate",
        "task=BringCube",
        "designs=designs.json",
        "executor.workers=1",
    ),
    "transfer": (
        *("core", "transfer", "task=BringCube", "designs=designs.json"),
        *("executor.workers=1", "sims=[mujoco, sapien]"),
    ),
    "conformance": ("core", "conformance", "task=GatherSpheres", "sim=mujoco"),
}


@dataclass(frozen=True)
class Ending:
    """What came of a signal.

    Attributes:
        command: the name among `COMMANDS`.
        kind: TERM or INT.
        sent_s: when it was sent, after the beginning.
        ended_s: until the command ended; infinite: it had to be killed.
        gone_s: until all processes that it had begun were gone.
        status: of the command.
        said: its last line on standard error.
    """

    command: str
    kind: str
    sent_s: float
    ended_s: float
    gone_s: float
    status: int
    said: str


def interrupt(name: str, kind: str, sent_s: float, folder: Path) -> Ending | None:
    """Begin a command, and send it a signal; None: it ended before."""
    with (folder / "said").open("wb") as said:
        process = subprocess.Popen(
            [sys.executable, "-m", *COMMANDS[name]],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            stdout=subprocess.DEVNULL,
            stderr=said,
            start_new_session=True,
        )
    try:
        process.wait(sent_s)
    except subprocess.TimeoutExpired:
        pass
    else:
        return None

    begun = family(process.pid)
    sent = time.monotonic()
    if kind == "INT":
        os.killpg(process.pid, signal.SIGINT)
    else:
        process.terminate()

    ended_s = gone_s = float("inf")
    try:
        process.wait(FOR_GOOD_S)
        ended_s = time.monotonic() - sent
        while set(begun) & set(living()):
            time.sleep(0.02)
        gone_s = time.monotonic() - sent
    except subprocess.TimeoutExpired:
        for pid in begun:
            os.kill(pid, signal.SIGKILL)
        process.wait()

    lines = (folder / "said").read_text().splitlines()
    last = lines[-1] if lines else ""
    return Ending(name, kind, sent_s, ended_s, gone_s, process.returncode, last)


def write_designs(folder: Path) -> None:
    """Write designs whose evaluation lasts for a minute."""
    document = json.loads(SOLUTION.read_text())
    strategy = document["strategies"][0]
    (plan,) = strategy["action_sets"]
    plans = []
    for number in range(1000):
        plans.append([[x + 1e-4 * number, *others] for x, *others in plan])
    strategy["action_sets"] = plans
    (folder / "designs.json").write_text(json.dumps(document))


def main(words: list[str]) -> int:
    # In the background of a shell Ctrl-C is ignored, and every command started from here would ignore it too.
    signal.signal(signal.SIGINT, signal.default_int_handler)

    settings = dict(word.split("=", 1) for word in words)
    times = int(settings.get("times", 50))
    most_s = float(settings.get("most", 3.0))
    draw = random.Random(int(settings.get("seed", 0)))

    slowest_s = 0.0
    while times > 0:
        name = draw.choice([*COMMANDS])
        kind = draw.choice(["TERM", "INT"])
        sent_s = draw.uniform(0.5, LATEST_S)
        with tempfile.TemporaryDirectory() as made:
            write_designs(Path(made))
            ending = interrupt(name, kind, sent_s, Path(made))
        if ending is None:
            continue

        times -= 1
        slowest_s = max(slowest_s, ending.ended_s, ending.gone_s)
        say(
            f"{ending.command:12} {ending.kind:5} at {ending.sent_s:5.1f} s: ended after {ending.ended_s:5.2f} s, "
            f"all gone after {ending.gone_s:5.2f} s, status {ending.status}: {ending.said}"
        )
        sys.stdout.flush()

    say(f"the slowest took {slowest_s:.2f} s")
    return int(slowest_s > most_s)


if __name__ == "__main__":
    command(main)
