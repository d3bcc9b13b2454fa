"""What is read of run folders, and what is not: finished, failed, unfinished, broken."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from core.errors import UserError
from core.values.messages import Bill
from plugins.results.pages.best_tool import best_tool
from plugins.results.pages.runs import FinishedRun, LeftOutRun, find_runs, read_run
from tests.core.run_folders import result, write_run

pytestmark = pytest.mark.slow


def folder_state(folder):
    return {
        str(p.relative_to(folder)): (p.stat().st_mtime_ns, p.stat().st_size)
        for p in sorted(folder.rglob("*"))
    }


def test_a_finished_run(tmp_path):
    folder = write_run(
        tmp_path / "run", "seed=4", rewards=[[0.2, None], [0.5, 0.1]], cost_usd=0.25
    )
    run = read_run(folder)
    assert isinstance(run, FinishedRun)
    assert (run.task, run.seed) == ("BringCube", 4)
    assert vars(run.best) == result(folder)["best"]
    assert run.best_so_far(3) == [0.2, 0.5, 0.5]
    assert [g.n_rejected for g in run.figures.generations] == [1, 0]
    assert run.config["budget"]["name"] == "quick"
    bill = Bill.of([reply for _, reply in run.store.answers()])
    assert (bill.replies, bill.prompt_tokens, bill.cost_usd) == (2, 200, 0.5)
    assert run.recordings() == {}


def test_reading_leaves_a_folder_as_it_was(tmp_path):
    folder = write_run(tmp_path / "run")
    before = folder_state(folder)
    run = read_run(folder)
    best_tool(run)
    run.store.requests()
    assert folder_state(folder) == before


# --- runs that do not count ---------------------------------------------------------------------------------------


def test_a_run_that_was_killed_is_unfinished(tmp_path):
    folder = write_run(tmp_path / "run", rewards=[[0.3, 0.6]], finish=False)
    run = read_run(folder)
    assert isinstance(run, LeftOutRun)
    assert (run.status, run.task) == ("unfinished", "BringCube")
    assert (
        run.reason
        == "2 candidates done, in generation 0, best reward so far 0.600; it goes on"
    )


def test_a_run_in_which_nothing_could_be_tried_failed(tmp_path):
    run = read_run(write_run(tmp_path / "run", rewards=[[None, None]]))
    assert (run.status, run.reason) == (
        "failed",
        "no candidate could be tried; the first reason: it is too heavy",
    )


@pytest.mark.parametrize("name", ["run.sqlite", "run.sqlite-wal"])
def test_a_pipe_in_a_strangers_folder_is_not_waited_for(tmp_path, name):
    folder = write_run(tmp_path / "run")
    (folder / name).unlink(missing_ok=True)
    os.mkfifo(folder / name)
    (run,) = find_runs([tmp_path])[1]
    assert run.status == "unreadable"


def test_a_store_that_is_none(tmp_path):
    folder = write_run(tmp_path / "run")
    (folder / "run.sqlite").write_bytes(b"this is no database of any length " * 100)
    run = read_run(folder)
    assert run.status == "unreadable"
    assert "run.sqlite can't be read: file is not a database" in run.reason


WRITER = """
import sys
sys.path.insert(0, {root!r})
from pathlib import Path
from core.design import Candidate
from core.values.plans import NO_PLAN
from core.trial import Evaluation
from tests.core.run_folders import write_run
write_run(Path({folder!r}), rewards=[[0.3, 0.6]], finish=False)
print("written", flush=True)
sys.stdin.readline()
unread = Evaluation(Candidate(None, NO_PLAN, 7, problem="no tool"))
write_run.open[0].hook.candidate_evaluated(evaluation=unread)
print("written", flush=True)
sys.stdin.readline()
"""


def test_a_store_that_is_being_written(tmp_path):
    """It is read as far as it has come, the writer can go on, and what it wrote is there."""
    script = WRITER.format(
        root=str(Path(__file__).parents[4]), folder=str(tmp_path / "run")
    )
    writer = subprocess.Popen(
        [sys.executable, "-c", script],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert writer.stdout.readline() == "written\n"
        assert (tmp_path / "run" / "run.sqlite-wal").stat().st_size > 0
        assert read_run(tmp_path / "run").reason.startswith(
            "2 candidates done, in generation 0"
        )
        writer.stdin.write("go on\n")
        writer.stdin.flush()
        assert writer.stdout.readline() == "written\n"
        assert read_run(tmp_path / "run").reason.startswith(
            "3 candidates done, in generation 7"
        )
    finally:
        writer.kill()
        writer.wait()
    before = folder_state(tmp_path / "run").keys()
    # Of its log.
    assert read_run(tmp_path / "run").reason.startswith(
        "3 candidates done, in generation 7"
    )
    assert folder_state(tmp_path / "run").keys() == before


# --- where runs are -----------------------------------------------------------------------------------------------


def test_runs_are_found_below_and_a_multiruns_by_number(tmp_path):
    for name in ("10_seed=2", "9_seed=1", "2_seed=0"):
        shutil.copytree(
            write_run(tmp_path / "one", f"seed={name[-1]}"),
            tmp_path / "multirun" / "sunday" / name,
        )
        shutil.rmtree(tmp_path / "one")
    (tmp_path / "multirun" / "sunday" / "multirun.yaml").write_text("")
    (
        tmp_path / "multirun" / "sunday" / ".hydra"
    ).mkdir()  # notes of the whole are no run
    finished, left_out = find_runs([tmp_path / "multirun"])
    assert [run.seed for run in finished] == [0, 1, 2]
    assert not left_out
    again, _ = find_runs(
        [tmp_path / "multirun" / "sunday" / "9_seed=1", tmp_path / "multirun"]
    )
    assert [run.seed for run in again] == [1, 0, 2]  # each once, in the order asked for


def test_a_folder_without_runs_is_refused(tmp_path):
    with pytest.raises(UserError, match="no folder"):
        find_runs([tmp_path / "nowhere"])
    with pytest.raises(UserError, match="holds no run"):
        find_runs([tmp_path])
