"""Studies and sweeps on a Slurm cluster: jobs are ended early, and the same command goes on and pays nothing twice."""

from __future__ import annotations

import json
import signal
import sqlite3
import subprocess
import sys
import threading
from collections import Counter
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from tests.cluster.slurm import PATIENCE_S, cluster, job_of, wait_until
from tests.plugins.vlms.servers import Say, Stall, serving

pytestmark = pytest.mark.cluster

ROOT = Path(__file__).parents[2]
SOLUTIONS = ROOT / "tests" / "tasks" / "solutions"
TASKS = ("BringCube", "LiftBox", "OneBook", "ScoreGoal")
FREE = "MoveBall"  # whose requests are never held
# Two generations of a request each.
SMALL = [
    *("vlm=gemini", "sim=mujoco", "prompt.picture=false"),
    *("prompt.repair=0", "film=false", "listener=[progress]", "executor.workers=1"),
    *("budget=tiny"),
    *("budget.n_iteration=1", "budget.reward_save=0"),
]


@pytest.fixture(scope="module")
def slurm(tmp_path_factory):
    with cluster(tmp_path_factory.mktemp("slurm")) as running:
        yield running


class Designer:
    """Answers with the reference solution; while it is ``held``, only the first request of each of `TASKS`."""

    def __init__(self) -> None:
        self.held = threading.Event()
        self.answered: Counter[str] = Counter()
        self.waiting: set[str] = set()

    def __call__(self, call):
        text = "".join(call.texts)
        (task,) = [name for name in (*TASKS, FREE) if f"class {name}(" in text]
        if self.held.is_set() and self.answered[task] and task != FREE:
            self.waiting.add(task)
            return Stall()

        self.answered[task] += 1
        solution = json.loads((SOLUTIONS / f"{task}.json").read_text())
        return Say(json.dumps({"scene_analysis": "", **solution}))


@contextmanager
def designer():
    script = Designer()
    script.held.set()
    with serving(script) as server:
        yield script, f"vlm.api_base={server.url}"


def start(slurm, folder, *words):
    """Start a command as a user of the cluster does."""
    environment = slurm.environment | {
        "GEMINI_API_KEY": "AIza-planted+0123456789",
        "PYTHONPATH": str(ROOT),
    }
    return subprocess.Popen(
        [sys.executable, "-m", *words],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def replies_in(folder):
    with closing(sqlite3.connect(folder / "run.sqlite")) as database:
        return database.execute("SELECT count(*) FROM replies").fetchone()[0]


def test_a_study_whose_jobs_are_cancelled_late_and_on_a_dead_node(slurm, tmp_path):
    """Four runs on two nodes, and one that waits for room. One is cancelled, one comes to its time limit, and two are
    on a node that dies.
    """
    with designer() as (script, address):
        tasks = [*TASKS, FREE]
        words = ["core", "study", "paper", f"tasks={','.join(tasks)}", "methods=full"]
        words += ["seeds=1", "jobs=5", "yes=true", "folder=study", *SMALL, address]
        words.append("launch=srun --ntasks=1 --cpus-per-task=1 --time=30")
        study = start(slurm, tmp_path, *words)
        wait_until(lambda: len(script.waiting) == 4, study)

        jobs = {
            task: job_of({}, "core.run", f"study/full/{task}/")
            for task in script.waiting
        }
        nodes = {task: slurm.node_of(job) for task, job in jobs.items()}
        assert sorted(nodes.values()) == ["one", "one", "two", "two"]
        cancelled, late = [task for task in nodes if nodes[task] == "one"]
        slurm.command("scancel", jobs[cancelled])
        slurm.command("scontrol", "update", f"jobid={jobs[late]}", "timelimit=1")
        slurm.kill_node("two")
        said, _ = study.communicate(timeout=PATIENCE_S)
        print(said)
        assert study.returncode == 1
        assert "4 runs failed" in said
        assert slurm.state("two").startswith("down")
        unfinished = (tmp_path / "study/report/data/left_out.csv").read_text()
        assert all(f"{task},unfinished" in unfinished for task in TASKS)
        assert f"{FREE}," not in unfinished

        slurm.start_node("two")
        wait_until(lambda: slurm.state("two") == "idle")
        script.held.clear()
        again = start(slurm, tmp_path, *words)
        said, _ = again.communicate(timeout=PATIENCE_S)
        print(said)
        assert again.returncode == 0
        folders = {path.parent for path in tmp_path.rglob("result.json")}
        assert len(folders) == 5
        assert [replies_in(folder) for folder in folders] == [2] * 5
        assert script.answered == dict.fromkeys(tasks, 2)


def test_a_sweep_by_submitit_goes_on_after_its_time_limit(slurm, tmp_path):
    """One of two jobs is warned of its limit, and goes on when submitit has queued it again; one is cancelled."""
    with designer() as (script, address):
        words = ["core.run", "-m", "hydra/launcher=submitit_slurm", *SMALL, address]
        words += ["hydra.launcher.cpus_per_task=1", "hydra.launcher.mem_gb=1"]
        words += ["hydra.launcher.timeout_min=30", "hydra.launcher.max_num_timeout=3"]
        words += ["hydra.sweep.dir=sweep", "task=BringCube,OneBook"]
        sweep = start(slurm, tmp_path, *words)
        wait_until(lambda: script.waiting == {"BringCube", "OneBook"}, sweep)

        submitted = "submitit.core._submit"
        warned = job_of({"SLURM_ARRAY_TASK_ID": "0"}, submitted)
        cancelled = job_of({"SLURM_ARRAY_TASK_ID": "1"}, submitted)
        slurm.command("scancel", "--signal=USR2", warned)
        slurm.command("scancel", cancelled)
        script.held.clear()
        wait_until(lambda: list(tmp_path.glob("sweep/0_*/result.json")), sweep)
        sweep.send_signal(signal.SIGINT)
        said, _ = sweep.communicate(timeout=PATIENCE_S)
        print(said)
        assert script.answered == {"BringCube": 2, "OneBook": 1}
        assert replies_in(next(tmp_path.glob("sweep/0_*"))) == 2
