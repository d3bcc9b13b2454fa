"""A fuzzer for run folders: ``python -m tests.fuzz.folders [stores|folders] [-max_total_time=60] [-seed=N]``.

It damages copies of a few runs at random and calls the commands on them: ``stores`` changes `run.sqlite` by bits and
by values, ``folders`` the files beside it; the default is both. A command does its work or ends with one line. A
traceback, an error of several lines, and a report that counts other rewards are findings. Each is printed with its
seed; ``-seed=N -max_total_time=0`` repeats it.
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
import time
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

from core import evaluate, prompt, run
from core.errors import UserError
from core.store import rows
from plugins import transfer
from plugins.executors.local import LocalExecutor
from plugins.listeners.rerun import view
from plugins.results.report import command as report
from tests.core.run_folders import write_run
from tests.executors import Inline

SMALL = ("budget.n_agent=2", "budget.n_tool=2", "budget.n_action=1", "budget.k_top=2", "budget.n_iteration=1")
QUICK = ("task=BringCube", "sim=mujoco")
TIMEOUT_S = 60
VALUES: list[Any] = [
    None,
    0,
    -1,
    2**63 - 1,
    1e308,
    -1.5,
    float("inf"),
    float("nan"),
    True,
    "",
    "x",
    "\ud800",
    "\x1b[2J",
]
VALUES += [10**400, [], {}, [[]], {"name": "x"}, [1, "2", None], {"a": {"b": 1}}, "${oc.env:HOME}", "${", "x" * 100_000]
PLAIN: list[Any] = [None, 0, -1, 3, 2**63 - 1, 1e308, float("inf"), "", "x", "[", "{}", "[1]", "null", b"\xff\xfe", b""]
PLAIN += ["9" * 5000, "[" * 5000, "\x00", '{"name": "\\ud800"}', "x" * 50_000_000]


def make_runs(folder: Path) -> list[Path]:
    """Make one run that ended, one that was killed, one without a candidate, one of given tools."""
    whole = folder / "whole"
    call(run.main, *QUICK, *SMALL, "vlm=offline", "film=false", "listener=[]", f"hydra.run.dir={whole}")
    words = ("vlm=offline", "sim=mujoco", *SMALL)
    killed = shutil.copytree(write_run(folder / "open", "seed=1", *words, finish=False), folder / "killed")
    failed = write_run(folder / "failed", "seed=2", *words, rewards=[[None], [None]])
    bare = write_run(folder / "bare", "seed=3", "tool=none", *words, rewards=[[0.5, 0.25]])
    return [whole, killed, failed, bare]


def call(main: Callable[[list[str]], int | None], *words: str) -> None:
    run._failures.clear()
    main([*words])


def changed(rng: random.Random, value: object) -> object:
    """Change one thing somewhere in a JSON value."""
    if isinstance(value, dict) and value and rng.random() < 0.9:
        key = rng.choice(list(value))
        if rng.random() < 0.15:
            return {k: v for k, v in value.items() if k != key}
        return value | {key: changed(rng, value[key])}
    if isinstance(value, list) and value and rng.random() < 0.9:
        at = rng.randrange(len(value))
        new: list[object] = rng.choice([[], [value[at]] * 2, *([[changed(rng, value[at])]] * 8)])
        return [*value[:at], *new, *value[at + 1 :]]
    return rng.choice(VALUES)


def flip(rng: random.Random, file: Path) -> None:
    data = bytearray(file.read_bytes())
    for _ in range(rng.choice([1, 1, 1, 8]) if data else 0):
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    file.write_bytes(data)


def damage_store(rng: random.Random, folder: Path) -> str:
    """Flip bits, or change a value."""
    if rng.random() < 0.4:
        flip(rng, folder / "run.sqlite")
        return "run.sqlite: bits"
    with contextlib.closing(sqlite3.connect(folder / "run.sqlite")) as database:
        database.row_factory = sqlite3.Row
        table = rng.choice(list(rows.TABLES))
        row = dict(rng.choice(database.execute(f"SELECT rowid AS at, * FROM {table}").fetchall() or [{"at": 0}]))
        at = row.pop("at")
        if not row:
            return "nothing"
        name = rng.choice(list(row))
        old, value = row[name], rng.choice(PLAIN)
        if isinstance(old, str) and old[:1] in ("[", "{") and rng.random() < 0.8:
            value = json.dumps(changed(rng, json.loads(old)))
        elif isinstance(old, str) and old and rng.random() < 0.3:
            where = rng.randrange(len(old))
            value = old[:where] + rng.choice("0x'\"{[\\\n-") + old[where + 1 :]
        with contextlib.suppress(sqlite3.Error, OverflowError):
            database.execute(f"UPDATE {table} SET {name} = ? WHERE rowid = ?", [value, at])
            database.commit()
    return f"{table}.{name} = {str(value)[:60]!r}"


def damage_folder(rng: random.Random, folder: Path) -> str:
    """Damage, remove or replace a file."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    likely = [path for path in files if path.name in ("result.json", "design.json", "config.yaml", "run.sqlite-wal")]
    file = rng.choice(likely if likely and rng.random() < 0.6 else files)
    how = rng.choice(["bits", "json", "json", "remove", "folder", "cut", "text", "deep"])
    if how == "json" and file.suffix == ".json":
        file.write_text(json.dumps(changed(rng, json.loads(file.read_text()))))
    elif how in ("bits", "json"):
        flip(rng, file)
    elif how in ("remove", "folder"):
        file.unlink()
        if how == "folder":
            file.mkdir()
    else:
        data = file.read_bytes()
        new = {"cut": data[: rng.randrange(len(data) + 1)], "text": b"no such thing \xff" * 9, "deep": b"[" * 100_000}
        file.write_bytes(new[how])
    return f"{file.relative_to(folder)}: {how}"


def commands(folder: Path, out: Path) -> dict[str, tuple[Callable[[], Any], tuple[str, ...]]]:
    """Return the commands that read a folder, with their words."""
    to, design = f"output={out}", f"designs={folder / 'best' / 'design.json'}"
    replayed = ("vlm=replay", f"+vlm.run={folder}", "film=false", "listener=[]", f"hydra.run.dir={out}")
    return {
        "report": (report.main, (str(folder), to)),
        "reports": (report.main, (str(folder.parent), to)),
        "resume": (run.main, (f"resume={folder}", "budget.stop_reward=0.0")),
        "transfer": (transfer.main, (f"designs={folder}", "sims=[mujoco]", "seeds=[0]")),
        "replay": (run.main, (*QUICK, *SMALL, *replayed)),
        "evaluate": (evaluate.main, (*QUICK, design)),
        "prompt": (prompt.main, (*QUICK, design, to)),
        "view": (lambda _: view.recordings(folder), ()),
    }


def rewards(out: Path) -> list[dict[str, str]]:
    file = out / "data" / "rewards.csv"
    return list(csv.DictReader(file.read_text().splitlines())) if file.exists() else []


def outcome(main: Callable[[], Any], words: tuple[str, ...], counts: Counter[str]) -> tuple[str, str]:
    """Call a command; return what it printed, and what is wrong with its end."""
    began, printed, wrong = time.monotonic(), io.StringIO(), ""
    try:
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            call(main, *words)
    except UserError as error:
        counts["errors of one line"] += 1
        wrong = f"several lines: {error}" if len(str(error).splitlines()) > 1 else ""
    except (Exception, SystemExit):
        wrong = traceback.format_exc()[-3000:]
    if time.monotonic() - began > TIMEOUT_S:
        wrong = wrong or f"it took more than {TIMEOUT_S} s"
    counts["commands"] += 1
    return printed.getvalue(), wrong


def one_case(seed: int, mode: str, runs: list[Path], good: dict[str, Any], counts: Counter[str]) -> None:
    rng = random.Random(seed)
    source = rng.choice(runs)
    with tempfile.TemporaryDirectory() as scratch:
        for other in {source, runs[0]}:
            shutil.copytree(other, Path(scratch) / "runs" / other.name)
        folder, out = Path(scratch) / "runs" / source.name, Path(scratch) / "out"
        what = (damage_store if mode == "stores" or (mode == "both" and seed % 2) else damage_folder)(rng, folder)
        others = rng.choice(["reports", "view"])
        ways = ["resume", "transfer", "replay", *(["evaluate", "prompt"] if (folder / "best").is_dir() else [])]
        for name in ("report", others, rng.choice(ways)):
            shutil.rmtree(out, ignore_errors=True)
            printed, wrong = outcome(*commands(folder, out)[name], counts)
            found = rewards(out) if name == "report" else []
            if found and found != good[source.name] and "not counted" not in printed:
                wrong = wrong or f"silent difference: {found} instead of {good[source.name]}"
            if wrong:
                counts["findings"] += 1
                print(f"-seed={seed} {mode}: {name} of {source.name}, {what}\n{wrong}\n", flush=True)


def main() -> None:
    flags = dict(word.lstrip("-").split("=") for word in sys.argv[1:] if word.startswith("-"))
    mode = next((word for word in sys.argv[1:] if not word.startswith("-")), "both")
    seed, counts = int(flags.get("seed", "0")), Counter[str]()
    here = mock.patch.object(LocalExecutor, "map", lambda _, function, chunks: Inline().map(function, chunks))
    with here, tempfile.TemporaryDirectory() as scratch, contextlib.chdir(scratch):
        runs, good = make_runs(Path(scratch)), {}
        for folder in runs:
            outcome(report.main, (str(folder), f"output={folder.name}_good"), Counter())
            good[folder.name] = rewards(Path(f"{folder.name}_good"))
        end = time.monotonic() + float(flags.get("max_total_time", "60"))
        while not counts["cases"] or time.monotonic() < end:
            one_case(seed + counts["cases"], mode, runs, good, counts)
            counts["cases"] += 1
    figures = ", ".join(f"{counts[what]} {what}" for what in ("cases", "commands", "errors of one line", "findings"))
    sys.stdout.write(f"{mode}: {figures}; next: -seed={seed + counts['cases']}\n")
    sys.exit(counts["findings"] > 0)


if __name__ == "__main__":
    main()
