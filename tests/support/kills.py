"""``python -m tests.support.kills FOLDER N SETTING``: a run with toys, several models and a critic, and N more.

These are killed at different moments and resumed. A setting is one of `SETTINGS`.

It is a separate process because it forks, which saves starting Python for each run. A moment is the beginning of an
operation on the disk: an SQL statement, a file that is written, renamed or made, a line in the notes. FOLDER gets
``whole/`` and ``0/``, ``1/`` ..., each with ``run/``, ``notes``, and ``killed/``, the store as the kill left it. Until
then replies are received before candidates are tried, in one thread, so that moments have the same order in all runs.
Each is killed again while it is resumed, with its threads.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import traceback
from collections.abc import Iterator, Sequence
from pathlib import Path

from omegaconf import DictConfig, OmegaConf

import core.search.model_requests
import plugins.vlms.ensemble
from core.plugins import installed
from core.search.orchestration import resume, run
from core.store.reader import StoredRun
from plugins.executors.ray import RayExecutor
from tests.support.toys import Notes, composed, note_chunks, offer, several

LAYOUTS = (
    "task.variation=near",
    "fitness=layouts",
    "fitness.layouts=3",
    "fitness.unseen=0",
    "budget.elite_s=1",
    "budget.final_s=2",
)
PLAYED = (
    "sim=mujoco",
    "budget.n_action=2",
    "prompt.picture=false",
    "prompt.critic=0",
)
"""Rollouts of an engine, which take their time. It draws nothing, since its threads don't survive a fork."""

SETTINGS: dict[str, Sequence[str]] = {
    "ensemble": (),
    "archive": ("evolution=map_elites", *LAYOUTS),
    "islands": ("evolution=islands", *LAYOUTS),
    "refined": ("evolution.refine=12",),
    "several": ("task=multitask", "task.of=[BringCube,ElevatePlate]"),
    "lean": (*LAYOUTS, "fitness=lean"),
    "guards": ("action=anchored", *PLAYED, *LAYOUTS),
    "soft": ("task=PullRope", *PLAYED),
    "ray": ("executor=ray", "executor.workers=1", *PLAYED, *LAYOUTS),
}
"""The words of each run that is killed."""


class Moments:
    """Count moments, and kill the process when number ``last`` begins."""

    def __init__(self, folder: Path, last: int | None) -> None:
        self.folder = str(folder)
        self.last = last
        self.number = 0
        self.connect = sqlite3.connect
        sqlite3.connect = self.connected
        sys.addaudithook(self.audit)

    def connected(self, *arguments, **settings):
        connection = self.connect(*arguments, **settings)
        connection.set_trace_callback(lambda _: self.begin())
        return connection

    def audit(self, event, arguments):
        if event in ("open", "os.rename", "os.mkdir", "os.remove") and str(
            arguments[0]
        ).startswith(self.folder):
            writes = event != "open" or arguments[2] & (os.O_WRONLY | os.O_RDWR)
            if writes:
                self.begin()

    def begin(self):
        self.number += 1
        if self.number == self.last:
            os.kill(os.getpid(), signal.SIGKILL)


def run_at_once(function, ended, name):
    """Stand in for `core.support.threads.run_in_thread`, in the caller's thread."""
    try:
        function()
    except Exception as error:
        ended(error)
    else:
        ended(None)


def session(
    folder: Path, words: Sequence[str], *, resumed: bool, last: int | None
) -> int:
    """Run or resume in a forked process; return the number of moments, or 0 if it was killed."""
    notes = Notes(str(folder / "notes"))
    notes.add("session")
    count = folder / "moments"
    child = os.fork()
    if child == 0:
        code = 1
        try:
            note_chunks(RayExecutor, notes)
            moments = Moments(folder, last)
            with (
                Path(os.devnull).open("w") as nowhere,
                contextlib.redirect_stdout(nowhere),
            ):
                if resumed and has_begun(folder / "run"):
                    address = "executor.address="  # which a resumed run asks for again
                    again = [word for word in words if word.startswith(address)]
                    resume(folder / "run", again)
                else:
                    core.search.model_requests.run_in_thread = run_at_once
                    plugins.vlms.ensemble.run_in_thread = run_at_once
                    run(configure(folder / "notes", words), folder / "run")
            count.write_text(str(moments.number))
            code = 0
        except BaseException:  # the child must end here in any case
            traceback.print_exc()
        os._exit(code)
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        assert os.WTERMSIG(status) == signal.SIGKILL
        return 0
    assert os.WEXITSTATUS(status) == 0
    return int(count.read_text())


def configure(notes: Path, words: Sequence[str]) -> DictConfig:
    """Return the configuration of a run with toys, but for an engine or an executor that is named."""
    config = several(notes, *words)
    for kind in ("sim", "executor"):
        if any(word.startswith(f"{kind}=") for word in words):
            chosen = composed(tuple(words))[kind]
            OmegaConf.update(config, kind, chosen, merge=False)

    return config


def main(folder: Path, points: int, setting: str) -> None:
    offer(installed())
    words = SETTINGS[setting]
    with contextlib.ExitStack() as ended:
        if setting == "ray":
            words = (*words, f"executor.address={ended.enter_context(cluster())}")
        warm = folder / "warm"
        # What it leaves in caches, each child inherits.
        if setting != "ray":  # whose connection can't be inherited
            run(configure(warm / "notes", words), warm / "run")
        kill(folder, points, words)


def kill(folder: Path, points: int, words: Sequence[str]) -> None:
    """Make one run whole, and kill and resume more."""
    (folder / "whole").mkdir()
    moments = session(folder / "whole", words, resumed=False, last=None)
    for point in range(points):
        at = folder / str(point)
        at.mkdir()
        last = 1 + point * (moments - 2) // max(points - 1, 1)
        assert session(at, words, resumed=False, last=last) == 0
        (at / "killed").mkdir()
        for file in (at / "run").glob("run.sqlite*"):
            shutil.copy(file, at / "killed")
        session(at, words, resumed=True, last=(moments - last) // 2)
        assert session(at, words, resumed=True, last=None) > 0


CLUSTER = """
import sys
from ray.cluster_utils import Cluster
nodes = Cluster(True, head_node_args={"num_cpus": 1, "include_dashboard": False})
print("at", nodes.address, flush=True)
sys.stdin.read()
nodes.shutdown()
"""


@contextlib.contextmanager
def cluster() -> Iterator[str]:
    """Start a cluster of one node, which all runs use; give its address. Its threads would not survive a fork here."""
    command = [sys.executable, "-c", CLUSTER]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen(command, text=True, **pipes) as nodes:
        lines = iter(nodes.stdout)
        yield next(line for line in lines if line.startswith("at ")).split()[1]


def has_begun(folder: Path) -> bool:
    """Report whether there is a run to resume: one that was killed earlier is started again."""
    store = StoredRun(folder)
    return store.exists and store.config() != {}


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3])
