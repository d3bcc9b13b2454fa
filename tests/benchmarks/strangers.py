"""Search the scenes that were written without a look at the embedded designer, and print what each earns.

``python -m tests.benchmarks.strangers [NAME ...] [seeds=0] [budget=quick] [sim=mujoco] [folder=strangers]``. The
scenes lie in the folder ``strangers`` beside this file: tasks as people write them after reading the docs of scene
files, of the kinds that benchmarks of manipulation and tests of tool use have. Without names all are searched. A line
says the best reward, rollouts and seconds; below 0.9 also what the best attempt did. The runs stay in ``folder``.
With ``stop=0.9`` a search ends after the generation in which it reached that.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from core.errors import UsageError, choices
from core.support.cli import answer_help, command
from tests.benchmarks import measuring

USAGE = (
    "usage: python -m tests.benchmarks.strangers [NAME ...] [seeds=N,...] [budget=NAME] [sim=NAME] [workers=N] "
    "[stop=REWARD] [folder=FOLDER]"
)
SCENES = Path(__file__).parent / "strangers"
WAITING = " ..."  # the end of a line that says how far something is
WISHED = 0.9  # a reward from which on a tool does what was asked
HEAD = (
    f"{'scene':16} seed  reward  rollouts  seconds  below {WISHED:g}: what the best did"
)


@dataclass
class Settings:
    seeds: list[int] = field(default_factory=lambda: [0])
    budget: str = "quick"
    sim: str = "mujoco"
    workers: int = 1
    stop: float | None = None
    folder: str = "strangers"


@dataclass(frozen=True)
class Row:
    """What came of one search; ``note`` says what the best attempt did, or why there is none."""

    scene: str
    seed: int
    reward: float = 0.0
    rollouts: int = 0
    seconds: float = 0.0
    note: str = ""

    def __str__(self) -> str:
        figures = f"{self.reward:6.3f}  {self.rollouts:8}  {self.seconds:7.0f}"
        return f"{self.scene:16} {self.seed:4}  {figures}  {self.note}".rstrip()


def main() -> None:
    """Search the scenes, and print a table as it grows."""
    words = answer_help(USAGE, sys.argv[1:])
    given = measuring.settings([w for w in words if "=" in w], Settings)
    files = find_scenes([word for word in words if "=" not in word])
    rows = list[Row]()
    print(HEAD)

    for file in files:
        for seed in given.seeds:
            row = search(file, seed, given)
            rows.append(row)
            print(row, flush=True)

    reached = sum(row.reward >= WISHED for row in rows)
    print(f"{reached} of {len(rows)} reach {WISHED:g}")


def find_scenes(names: Sequence[str]) -> list[Path]:
    """Return the scene files of these names; all if there are none.

    Raises:
        UsageError: no scene has such a name.
    """
    known = sorted(file.stem for file in SCENES.glob("*.yaml"))
    for name in names:
        if name not in known:
            raise choices("scene", name, known)

    return [SCENES / f"{name}.yaml" for name in names or known]


def search(file: Path, seed: int, given: Settings) -> Row:
    """Run the search in one scene with one seed."""
    folder = Path(given.folder) / f"{file.stem}_{seed}"
    if folder.exists():
        raise UsageError(f"{folder} exists; choose another folder=FOLDER")

    scene = ("task=file", f"task.file={file}", f"sim={given.sim}", f"seed={seed}")
    workers = f"executor.workers={given.workers}"
    size = [f"budget={given.budget}", workers, "listener=[]", "film=false"]
    if given.stop is not None:
        size.append(f"budget.stop_reward={given.stop}")

    run = call("core.run", *scene, *size, f"hydra.run.dir={folder}")
    if run.returncode:
        return Row(file.stem, seed, note=run.stderr.strip())

    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    best = result["best"]
    figures = (best["reward"], result["rollouts"], result["wall_time_s"])
    if best["reward"] >= WISHED:
        return Row(file.stem, seed, *figures)

    lines = run.stderr.splitlines()
    notes = [*watch(folder, scene), *(x for x in lines if not x.endswith(WAITING))]
    return Row(file.stem, seed, *figures, "; ".join(notes))


def watch(folder: Path, scene: Sequence[str]) -> Iterator[str]:
    """Play a run's best attempt again, and yield what was observed of it."""
    output = folder / "observed.json"
    best = f"designs={folder / 'best/design.json'}"
    again = ("rollout.observe=true", f"output={output}")
    played = call("core.evaluate", *scene, best, *again)
    if played.returncode:
        yield played.stderr.strip()
        return

    (trial,) = json.loads(output.read_text(encoding="utf-8"))
    for text in (trial["reason"], trial.get("observed")):
        if text:
            yield text


def call(module: str, *words: str) -> subprocess.CompletedProcess[str]:
    """Run one of the program's commands."""
    whole = [sys.executable, "-m", module, *words]
    return subprocess.run(whole, check=False, capture_output=True, text=True)


if __name__ == "__main__":
    command(lambda _: main())
