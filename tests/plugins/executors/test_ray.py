"""On real clusters on this machine: one of a node, and one of two of which one is killed."""

import os
import signal
import socket
import subprocess
import sys
import time
import types
from pathlib import Path

import pytest

from core.errors import UsageError, UserError
from core.interfaces import Condition
from core.plugins import PluginPart, installed
from core.search.trials import Trials
from core.simulation.play import play
from plugins.fitness.nominal import Nominal
from tests.benchmarks.measuring import designs
from tests.support.chunks import double, misfortune
from tests.support.processes import all_gone, family
from tests.support.rare import rare

pytestmark = pytest.mark.slow

pytest.importorskip("ray", reason="executor=ray is an extra: pip install 'ray>=2.40'")


def executor(**settings):
    return installed().create("executor", "ray", settings)


def offspring(pid):
    return set(family(pid)) - {pid}


def listens_on(pids):
    """The addresses, as the kernel writes them, on which processes wait for connections."""
    sockets = set()
    for pid in pids:
        for link in Path(f"/proc/{pid}/fd").glob("*"):
            try:
                sockets.add(str(link.readlink()))
            except OSError:
                continue
    rows = [
        row.split()
        for table in ("tcp", "tcp6")
        for row in Path(f"/proc/net/{table}").read_text().splitlines()
    ]
    return {
        row[1].partition(":")[0]
        for row in rows
        if row[3] == "0A" and f"socket:[{row[9]}]" in sockets
    }


LOOPBACK = {
    "0100007F",
    "0000000000000000FFFF00000100007F",
    "00000000000000000000000001000000",
}


@pytest.fixture(scope="module")
def cluster():
    """Two nodes with a core each."""
    from ray.cluster_utils import Cluster

    cluster = Cluster(
        initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False}
    )
    try:
        cluster.add_node(num_cpus=1)
        yield cluster
    finally:
        cluster.shutdown()


@pytest.mark.thorough
def test_what_befalls_a_chunk_befalls_no_other():
    before, here = signal.getsignal(signal.SIGTERM), offspring(os.getpid())
    chunks = [["a"], ["raise"], ["b"], ["exit"], ["c"], ["hang"], ["d"]]
    with executor(workers=1, timeout_s=3.0, retries=1) as pool:
        found = {chunk[0]: result for chunk, result in pool.map(misfortune, chunks)}
        own = [[1, 2], [3]]
        doubled = list(pool.map(double, own))
        started = offspring(os.getpid()) - here
        reachable = listens_on(started | {os.getpid()})
    assert {name: found[name] for name in "abcd"} == {name: [name] for name in "abcd"}
    assert isinstance(found["raise"], ValueError)
    assert str(found["raise"]) == "this chunk is bad"
    assert "lost 2 times" in str(found["exit"])
    assert "executor.timeout_s" in str(found["hang"])
    assert sorted(result for _, result in doubled) == [[2, 4], [6]]
    assert all(any(chunk is mine for mine in own) for chunk, _ in doubled)
    assert signal.getsignal(signal.SIGTERM) is before
    assert reachable
    assert reachable <= LOOPBACK
    assert started
    assert all_gone(started)


@pytest.mark.thorough
def test_chunks_do_not_wait_for_workers_that_find_no_room(cluster):
    chunks = [[number] for number in range(8)]
    with executor(address=cluster.address, workers=4) as pool:
        assert sorted(result for _, result in pool.map(double, chunks)) == [
            [2 * number] for number in range(8)
        ]


class Many:
    """For an engine that likes many candidates at once."""

    batch = 64

    def __call__(self, chunk):
        import ray

        return [(os.getpid(), tuple(ray.get_gpu_ids()))] * len(chunk)


@pytest.mark.weekly
def test_an_engine_that_batches_has_one_worker_or_one_per_graphics_card(cluster):
    """Cards that the cluster only believes in: Ray hands them out all the same."""
    chunks = [[number] for number in range(12)]
    with executor(address=cluster.address) as pool:
        found = {answer for _, result in pool.map(Many(), chunks) for answer in result}
        assert {cards for _, cards in found} == {()}
        assert len(found) == 1
    with (
        executor(address=cluster.address, num_gpus=1) as pool,
        pytest.raises(UserError, match="has 0 graphics cards"),
    ):
        list(pool.map(Many(), chunks))
    cards = cluster.add_node(num_cpus=2, num_gpus=2)
    try:
        with executor(address=cluster.address, num_gpus=1) as pool:
            found = {
                answer for _, result in pool.map(Many(), chunks) for answer in result
            }
    finally:
        cluster.remove_node(cards)
    assert len({pid for pid, _ in found}) <= 2
    assert all(len(own) == 1 for _, own in found)


@pytest.mark.thorough
def test_nodes_that_lack_the_program(cluster, monkeypatch):
    module = types.ModuleType("only_here")
    exec("def work(chunk): return chunk", module.__dict__)
    monkeypatch.setitem(sys.modules, "only_here", module)
    with (
        executor(address=cluster.address, workers=1) as pool,
        pytest.raises(UserError, match="No module named 'only_h"),
    ):
        list(pool.map(module.work, [[1]]))


class Doomed:
    """Plays candidates, but on one node begins and never ends, and elsewhere does not begin before that."""

    def __init__(self, node, mark):
        self.node = node
        self.mark = mark

    def __call__(self, condition, candidates):
        import ray

        if ray.get_runtime_context().get_node_id() == self.node:
            self.mark.write_text(candidates[0].id)
            time.sleep(600)
        while not self.mark.exists():
            time.sleep(0.02)
        return play(condition, candidates)


@pytest.mark.weekly
def test_a_node_that_is_lost_changes_no_result(cluster, tmp_path):
    candidates = designs("BringCube", 8, 1, 0)
    coarse = PluginPart("sim", "pybullet", (("time_step", 0.004),))
    fitness = Nominal(Condition(PluginPart("task", "BringCube"), coarse))
    with installed().create("executor", "local", {"workers": 1}) as pool:
        here = {
            e.candidate.id: e.trials for e in Trials(pool).evaluate(candidates, fitness)
        }
    there = {}
    doomed = cluster.add_node(num_cpus=1)
    mark = tmp_path / "begun"
    with executor(address=cluster.address) as pool:
        trials = Trials(pool, play=Doomed(doomed.node_id, mark))
        for evaluation in trials.evaluate(iter(candidates), fitness):
            if not there:
                cluster.remove_node(doomed, allow_graceful=False)
            there[evaluation.candidate.id] = evaluation.trials
    assert mark.read_text() in there
    assert there == here


@pytest.mark.thorough
@pytest.mark.parametrize(
    "moment", rare(["running", "starting"], "running", mark="weekly")
)
def test_ctrl_c_leaves_nothing_behind(tmp_path, moment):
    words = [
        "executor=ray",
        "executor.workers=1",
        "evolution=sampling",
        "budget.n_agent=1",
        "budget.n_tool=1",
    ]
    words += [
        "budget.n_action=1",
        "budget.n_iteration=1000",
        "film=false",
        "~listener.rerun",
    ]
    command = [
        sys.executable,
        "-m",
        "core.run",
        *words,
        f"hydra.run.dir={tmp_path / 'run'}",
    ]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    started = set()
    if moment == "starting":
        while not started and process.poll() is None:
            time.sleep(0.05)
            started = offspring(process.pid)
    for line in () if started else process.stderr:
        if line.startswith("generation 0  best"):
            break
    started |= offspring(process.pid)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 130, err
    assert out == ""
    assert "interrupted" in err
    assert "Traceback" not in err
    assert started
    assert all_gone(started)


def test_settings_that_make_no_sense():
    for wrong in (
        {"workers": 0},
        {"retries": -1},
        {"num_cpus": 0},
        {"num_gpus": -1},
        {"timeout_s": 0},
        {"address": "nowhere"},
    ):
        with pytest.raises(UsageError, match=next(iter(wrong))):
            executor(**wrong)


def test_a_cluster_that_is_not_there():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(UserError, match=rf"127.0.0.1:{port}: nothing answers there"):
        executor(address=f"127.0.0.1:{port}")
