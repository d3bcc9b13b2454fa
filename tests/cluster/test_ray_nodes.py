"""Runs on a Ray cluster of several nodes: some are killed on the way, and the result is that of one machine."""

from __future__ import annotations

import json
import os
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from tests.cluster.ray_nodes import cluster
from tests.cluster.slurm import PATIENCE_S, wait_until
from tests.support.processes import stored

pytestmark = pytest.mark.cluster

pytest.importorskip("ray", reason="executor=ray is an extra: pip install 'ray>=2.40'")

ROOT = Path(__file__).parents[2]
CANDIDATES = int(os.environ.get("CANDIDATES", "400"))
"""How many are tried, in two generations."""
RUN = [
    *("task=BringCube", "sim=mujoco", "film=false", "listener=[progress]"),
    *("prompt.picture=false", "budget.n_iteration=1", "budget.n_agent=10"),
    *("budget.n_tool=4", f"budget.n_action={CANDIDATES // 80}"),
    *("budget.reward_save=0", "seed=1"),
]
TIMES = ("wall_time_s", "rollouts_per_s")


@pytest.fixture
def start():
    """Start runs in a folder, with an environment; what still runs after the test is ended."""
    started = []
    yield lambda *args: started.append(_start(*args)) or started[-1]
    for run in started:
        run.kill()
        run.wait()


def _start(folder, environment, *words):
    return subprocess.Popen(
        [sys.executable, "-m", "core.run", *words],
        cwd=folder,
        env={**environment, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def finish(run):
    said, _ = run.communicate(timeout=PATIENCE_S)
    assert run.returncode == 0, said
    return said


def result_of(folder):
    result = json.loads((folder / "result.json").read_text())
    print(f"{folder.name}: {result['rollouts_per_s']:.2f} rollouts/s")
    return {key: value for key, value in result.items() if key not in TIMES}


def count(folder, table):
    with closing(sqlite3.connect(folder / "run.sqlite")) as database:
        return database.execute(f"SELECT count(*) FROM {table}").fetchone()[0]


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """The result of the run on one machine, with one worker."""
    folder = tmp_path_factory.mktemp("alone")
    words = [*RUN, "executor.workers=1", f"hydra.run.dir={folder / 'alone'}"]
    finish(_start(folder, os.environ, *words))
    return result_of(folder / "alone")


@pytest.mark.parametrize("number", [1, 2, 4])
def test_any_number_of_nodes_comes_to_the_same_result(alone, number, start, tmp_path):
    with cluster(tmp_path, number) as nodes:
        run = tmp_path / f"{number} nodes"
        on = ["executor=ray", f"executor.address={nodes.address}"]
        finish(start(tmp_path, nodes.environment, *RUN, *on, f"hydra.run.dir='{run}'"))
        assert result_of(run) == alone


def test_a_node_is_killed_and_another_one_joins(alone, start, tmp_path):
    with cluster(tmp_path, 2) as nodes:
        run = tmp_path / "changing"
        on = ["executor=ray", f"executor.address={nodes.address}", "executor.workers=2"]
        going = start(tmp_path, nodes.environment, *RUN, *on, f"hydra.run.dir={run}")
        wait_until(lambda: stored(run) >= CANDIDATES // 10, going)
        nodes.kill(1)
        nodes.add()
        finish(going)
        assert result_of(run) == alone


def test_the_head_is_killed_and_the_run_goes_on_with_another_one(
    alone, start, tmp_path
):
    with cluster(tmp_path, 2) as nodes:
        run = tmp_path / "resumed"
        on = ["executor=ray", f"executor.address={nodes.address}"]
        going = start(tmp_path, nodes.environment, *RUN, *on, f"hydra.run.dir={run}")
        wait_until(lambda: stored(run) >= CANDIDATES // 10, going)
        nodes.kill(0)
        said, _ = going.communicate(timeout=PATIENCE_S)
        print(said)
        assert going.returncode != 0
        assert "Traceback" not in said
        # Ray itself ends the program after a minute, so all that it says is what it said at its start.
        assert "Failed to connect to GCS" in said
        assert f"folder: {run}" in said
        kept = stored(run)
        assert kept < CANDIDATES

        nodes.stop()
        nodes.start_head()
        words = [f"resume={run}", f"executor.address={nodes.address}"]
        print(finish(start(tmp_path, nodes.environment, *words)))
        assert result_of(run) == alone
        assert count(run, "evaluations") == CANDIDATES


def test_a_run_needs_no_shared_memory(alone, start, tmp_path):
    with cluster(tmp_path, 2, small=True) as nodes:
        nodes.fill(0)
        nodes.fill(1)
        run = tmp_path / "full"
        on = ["executor=ray", f"executor.address={nodes.address}"]
        finish(start(tmp_path, nodes.environment, *RUN, *on, f"hydra.run.dir={run}"))
        assert result_of(run) == alone


LARGE = """
import hashlib
import sys
from functools import partial

from plugins.executors.ray import RayExecutor

executor = RayExecutor(sys.argv[1], workers=2)
# A second of work, and too much for Ray to send it along with its messages.
derive = partial(hashlib.pbkdf2_hmac, "sha256", salt=b"salt", iterations=100, dklen=200_000)
for _, result in executor.map(derive, [b"x"] * 20):
    print(len(result) if isinstance(result, bytes) else repr(result))

executor.close()
"""


def test_results_in_a_lost_object_store_are_made_again(tmp_path):
    with cluster(tmp_path, 2, small=True) as nodes:
        nodes.fill(1)
        done = subprocess.run(
            [sys.executable, "-c", LARGE, nodes.address],
            env={**nodes.environment, "PYTHONPATH": str(ROOT)},
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
        )
        print(done.stderr)
        assert done.returncode == 0, done.stderr
        assert "Raylet is terminated" in done.stdout + done.stderr
        lines = [line for line in done.stdout.splitlines() if line.isdigit()]
        assert lines == ["200000"] * 20


def test_without_the_token_no_one_gets_in(start, tmp_path):
    with cluster(tmp_path, 1) as nodes:
        (tmp_path / "stranger").mkdir()
        stranger = nodes.environment | {"HOME": str(tmp_path / "stranger")}
        on = ["executor=ray", f"executor.address={nodes.address}"]
        refused = start(tmp_path, stranger, *RUN, *on, "hydra.run.dir=refused")
        said, _ = refused.communicate(timeout=PATIENCE_S)
        print(said)
        assert refused.returncode == 1
        assert "Traceback" not in said
