"""On real clusters on this machine: one of a node, and one of two of which one is killed."""

import os
import signal
import socket
import time

import pytest

from core.errors import UsageError, UserError
from core.evolution import evaluate_all
from core.plugins import installed
from core.rollout import Bench, Part
from tests.benchmarks.throughput import designs

pytest.importorskip("ray", reason="executor=ray is an extra: pip install 'vlmgineer[ray]'")


def executor(**settings):
    return installed().create("executor", "ray", settings)


def double(chunk):
    return [2 * x for x in chunk]


def misfortune(chunk):
    match chunk[0]:
        case "raise":
            raise ValueError("this chunk is bad")
        case "exit":
            os._exit(3)
        case "hang":
            time.sleep(60)
    return chunk


class Slowly:
    """A bench that takes its time, so that the loss of a node comes in the middle."""

    def __init__(self, bench):
        self.bench = bench

    def __call__(self, candidates):
        time.sleep(0.5)
        return self.bench(candidates)


def test_what_befalls_a_chunk_befalls_no_other():
    before = signal.getsignal(signal.SIGTERM)
    chunks = [["a"], ["raise"], ["b"], ["exit"], ["c"], ["hang"], ["d"]]
    with executor(workers=1, timeout_s=5.0, retries=1) as pool:
        found = {chunk[0]: result for chunk, result in pool.map(misfortune, chunks)}
        own = [[1, 2], [3]]
        doubled = list(pool.map(double, own))
    assert {name: found[name] for name in "abcd"} == {name: [name] for name in "abcd"}
    assert isinstance(found["raise"], ValueError)
    assert str(found["raise"]) == "this chunk is bad"
    assert "lost 2 times" in str(found["exit"])
    assert "executor.timeout_s" in str(found["hang"])
    assert sorted(result for _, result in doubled) == [[2, 4], [6]]
    assert all(any(chunk is mine for mine in own) for chunk, _ in doubled)
    assert signal.getsignal(signal.SIGTERM) is before


def test_a_node_that_is_lost_changes_no_result():
    from ray.cluster_utils import Cluster

    candidates = designs("BringCube", 3, 3, 0)
    bench = Bench(Part("task", "BringCube"), Part("sim", "pybullet", (("time_step", 0.004),)))
    with installed().create("executor", "local", {"workers": 1}) as pool:
        here = {e.candidate.id: (e.reward, e.distance_m, e.moved_m) for e in evaluate_all(candidates, bench, pool)}
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    try:
        other = cluster.add_node(num_cpus=1)
        there = {}
        with executor(address=cluster.address) as pool:
            for evaluation in evaluate_all(iter(candidates), Slowly(bench), pool):
                there[evaluation.candidate.id] = (evaluation.reward, evaluation.distance_m, evaluation.moved_m)
                if other is not None:
                    cluster.remove_node(other, allow_graceful=False)
                    other = None
    finally:
        cluster.shutdown()
    assert there == here


def test_settings_that_make_no_sense():
    for wrong in ({"workers": 0}, {"retries": -1}, {"num_cpus": 0}, {"timeout_s": 0}, {"address": "nowhere"}):
        with pytest.raises(UsageError, match=next(iter(wrong))):
            executor(**wrong)


def test_a_cluster_that_is_not_there():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(UserError, match=rf"127.0.0.1:{port}: nobody answers there"):
        executor(address=f"127.0.0.1:{port}")
