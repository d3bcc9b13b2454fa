"""A fuzzer of run folders: ``python -m tests.fuzz.folders [-cases=100] [-seed=0]``.

It damages copies of a few runs at random, their stores by bits and by values and the files beside them, and calls the
commands that read runs. A command does its work or ends with one line. A traceback, an error of several lines, and a
report that counts other rewards without a word are findings. Each is printed with its seed; ``-seed=N -cases=1``
repeats it.
"""

from __future__ import annotations

import contextlib
import csv
import io
import json
import random
import shutil
import sqlite3
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest import mock

from core import run
from core.errors import UserError
from core.store import rows
from core.store.database import FILE
from plugins.commands import evaluate, prompt
from plugins.executors.local import LocalExecutor
from plugins.results import transfer, view
from plugins.results.report import report_command as report
from plugins.results.toolbox import toolbox_command as toolbox
from plugins.results.workshop import export_command as export
from tests.core.run_folders import write_run
from tests.support.executors import Inline

SMALL = (
    "budget.n_agent=2",
    "budget.n_tool=2",
    "budget.n_action=1",
    "budget.k_top=2",
    "budget.n_iteration=1",
)
QUICK = ("task=BringCube", "sim=mujoco")
UNSEEN = ("film=false", "listener=[]")

JSON_VALUES: list[Any] = [
    *(None, True, 0, -1, -1.5, 1e308, 2**63 - 1, 10**400),
    *(float("inf"), float("nan")),
    *("", "x", "\ud800", "\x1b[2J", "${oc.env:HOME}", "${", "x" * 100_000),
    *([], {}, [[]], {"name": "x"}, [1, "2", None], {"a": {"b": 1}}),
]
SQL_VALUES: list[Any] = [
    *(None, 0, -1, 3, 1e308, 2**63 - 1, float("inf"), b"\xff\xfe", b""),
    *("", "x", "[", "{}", "[1]", "null", "\x00", '{"name": "\\ud800"}'),
    *("9" * 5000, "[" * 5000, "x" * 50_000_000),
]
LIKELY = ("result.json", "design.json", "config.yaml", "run.sqlite-wal")
"""The files that are damaged most."""


@dataclass
class Cases:
    """Runs to damage, by their names, with the rewards that a report of each has, and what came of the cases."""

    runs: dict[str, Path]
    rewards: dict[str, list[dict[str, str]]] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)
    findings: list[str] = field(default_factory=list)

    def try_one(self, seed: int) -> None:
        """Damage a copy of a run, and call three commands on it."""
        rng = random.Random(seed)
        name = rng.choice(list(self.runs))
        with tempfile.TemporaryDirectory() as scratch:
            for copied in {name, "whole"}:
                shutil.copytree(self.runs[copied], Path(scratch) / "runs" / copied)
            folder = Path(scratch) / "runs" / name
            damage = rng.choice([damage_store, damage_file])
            what = damage(rng, folder)
            others = list(COMMANDS)
            others.remove("report")
            for command in ("report", *rng.sample(others, 2)):
                wrong = self.call(command, folder, Path(scratch) / "out")
                if wrong:
                    title = f"-seed={seed}: {command} of {name}, {what}"
                    self.findings.append(f"{title}\n{wrong}\n")

        self.counts["cases"] += 1

    def call(self, command: str, folder: Path, out: Path) -> str:
        """Call a command on a run's folder; return what is wrong with its end; empty: nothing."""
        shutil.rmtree(out, ignore_errors=True)
        printed = io.StringIO()
        self.counts["commands"] += 1
        try:
            with (
                contextlib.redirect_stdout(printed),
                contextlib.redirect_stderr(printed),
            ):
                COMMANDS[command](folder, out)
        except UserError as error:
            self.counts["errors of one line"] += 1
            several = len(str(error).splitlines()) > 1
            return f"several lines: {error}" if several else ""
        except (Exception, SystemExit):  # what a command may not raise
            return traceback.format_exc()[-3000:]

        if command != "report":
            return ""
        found = read_rewards(out)
        known = self.rewards.setdefault(folder.name, found)
        if found == known or "not counted" in printed.getvalue():
            return ""
        return f"silent difference: {found} instead of {known}"


def _resume(folder: Path, out: Path) -> None:
    run.main([f"resume={folder}", "budget.stop_reward=0.0"])


def _replay(folder: Path, out: Path) -> None:
    where = (f"+vlm.run={folder}", f"hydra.run.dir={out}")
    run.main([*QUICK, *SMALL, *UNSEEN, "vlm=replay", *where])


def _view(folder: Path, out: Path) -> None:
    view.recordings(folder)


def _design(folder: Path) -> str:
    return f"designs={folder / 'best' / 'design.json'}"


COMMANDS: dict[str, Callable[[Path, Path], Any]] = {
    "report": lambda run, out: report.main([str(run), f"output={out}"]),
    "reports": lambda run, out: report.main([str(run.parent), f"output={out}"]),
    "resume": _resume,
    "replay": _replay,
    "transfer": lambda run, out: transfer.main(
        [f"designs={run}", "sims=[mujoco]", "seeds=[0]"]
    ),
    "export": lambda run, out: export.main(
        [str(run), "sims=[mujoco]", f"output={out}"]
    ),
    "toolbox": lambda run, out: toolbox.main(
        [str(run.parent), "tasks=[LiftBox]", *QUICK[1:], f"output={out}"]
    ),
    "evaluate": lambda run, out: evaluate.main([*QUICK, _design(run)]),
    "prompt": lambda run, out: prompt.main([*QUICK, _design(run), f"output={out}"]),
    "view": _view,
}
"""The commands that read a run: each gets its folder, and one to write."""


def make_runs(folder: Path) -> dict[str, Path]:
    """Make a run that ended, one that was killed, one without a candidate, and one of the bare hand."""
    whole = folder / "whole"
    run.main([*QUICK, *SMALL, *UNSEEN, "vlm=offline", f"hydra.run.dir={whole}"])
    words = ("vlm=offline", "sim=mujoco", *SMALL)
    opened = write_run(folder / "open", "seed=1", *words, finish=False)
    killed = shutil.copytree(opened, folder / "killed")
    rejected = [[None], [None]]
    failed = write_run(folder / "failed", "seed=2", *words, rewards=rejected)
    bare = [*words, "tool=none"]
    hand = write_run(folder / "hand", "seed=3", *bare, rewards=[[0.5, 0.25]])
    return {run.name: run for run in (whole, killed, failed, hand)}


def read_rewards(out: Path) -> list[dict[str, str]]:
    """Read the first table of a report; empty: there is none."""
    file = out / "data" / "rewards.csv"
    if not file.exists():
        return []
    return list(csv.DictReader(file.read_text().splitlines()))


def change(rng: random.Random, value: object) -> object:
    """Change one thing somewhere in a JSON value."""
    if isinstance(value, dict) and value and rng.random() < 0.9:
        key = rng.choice(list(value))
        changed = {**value, key: change(rng, value[key])}
        if rng.random() < 0.15:
            del changed[key]
        return changed

    if isinstance(value, list) and value and rng.random() < 0.9:
        place = rng.randrange(len(value))
        item = change(rng, value[place])
        there = rng.choice([[], [item, item], *([[item]] * 8)])
        return [*value[:place], *there, *value[place + 1 :]]

    return rng.choice(JSON_VALUES)


def flip_bits(rng: random.Random, file: Path) -> None:
    data = bytearray(file.read_bytes())
    if not data:
        return
    for _ in range(rng.choice([1, 1, 1, 8])):
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    file.write_bytes(data)


def damage_store(rng: random.Random, folder: Path) -> str:
    """Flip bits of a store, or change a value; say which."""
    file = folder / FILE
    if rng.random() < 0.4:
        flip_bits(rng, file)
        return "bits of the store"

    table = rng.choice(list(rows.TABLES))
    with contextlib.closing(sqlite3.connect(file)) as database:
        database.row_factory = sqlite3.Row
        query = f"SELECT rowid AS row_number, * FROM {table}"
        stored = [dict(row) for row in database.execute(query)]
        if not stored:
            return "nothing"
        row = rng.choice(stored)
        number = row.pop("row_number")
        name = rng.choice(list(row))
        value = _other_value(rng, row[name])
        with contextlib.suppress(sqlite3.Error, OverflowError):
            statement = f"UPDATE {table} SET {name} = ? WHERE rowid = ?"
            database.execute(statement, [value, number])
            database.commit()

    return f"{table}.{name} = {str(value)[:60]!r}"


def _other_value(rng: random.Random, old: object) -> object:
    """Return something else for a column, often like what was there."""
    if not isinstance(old, str) or not old or rng.random() < 0.2:
        return rng.choice(SQL_VALUES)
    if old[0] in "[{" and rng.random() < 0.8:
        return json.dumps(change(rng, json.loads(old)))
    place = rng.randrange(len(old))
    return old[:place] + rng.choice("0x'\"{[\\\n-") + old[place + 1 :]


def damage_file(rng: random.Random, folder: Path) -> str:
    """Damage, remove or replace a file; say which."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    likely = [path for path in files if path.name in LIKELY]
    file = rng.choice(likely if likely and rng.random() < 0.6 else files)
    data = file.read_bytes()
    how = rng.choice(
        ["bits", "json", "remove", "folder", "link", "cut", "text", "deep"]
    )
    if how == "json" and file.suffix == ".json":
        file.write_text(json.dumps(change(rng, json.loads(data))))
    elif how in ("bits", "json"):
        flip_bits(rng, file)
    elif how in ("remove", "folder", "link"):
        file.unlink()
        if how == "folder":
            file.mkdir()
        if how == "link":
            file.symlink_to("/etc/hostname")
    else:
        put = {
            "cut": data[: rng.randrange(len(data) + 1)],
            "text": b"no such thing \xff" * 9,
            "deep": b"[" * 100_000,
        }
        file.write_bytes(put[how])

    return f"{file.relative_to(folder)}: {how}"


@contextlib.contextmanager
def ready() -> Iterator[Cases]:
    """Make the runs in a folder that is removed, with rollouts in this process."""

    def here(_: object, function: Any, chunks: Any) -> Any:
        return Inline().map(function, chunks)

    with (
        mock.patch.object(LocalExecutor, "map", here),
        tempfile.TemporaryDirectory() as scratch,
        contextlib.chdir(scratch),
    ):
        cases = Cases(make_runs(Path(scratch)))
        for name, folder in cases.runs.items():
            cases.call("report", folder, Path(scratch) / f"{name}_report")
        cases.counts.clear()
        yield cases


def main() -> None:
    flags = dict(word.lstrip("-").split("=") for word in sys.argv[1:])
    first = int(flags.get("seed", "0"))
    with ready() as cases:
        for seed in range(first, first + int(flags.get("cases", "100"))):
            cases.try_one(seed)
    figures = [f"{count} {what}" for what, count in cases.counts.items()]
    print(*cases.findings, ", ".join(figures), sep="\n")
    sys.exit(bool(cases.findings))


if __name__ == "__main__":
    main()
