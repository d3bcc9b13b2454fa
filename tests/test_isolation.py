"""A rollout that breaks costs that candidate alone."""

import numpy as np
import pytest

from core.interfaces import Condition
from core.plugins import Offer, PluginPart, installed
from core.plugins.blame import PluginError
from core.simulation.play import play
from tests.conftest import POPULATION
from tests.support import faults, toys
from tests.support.faults import FAULTS, SLIDE, Faulty, Slide, candidate
from tests.support.playing import evaluate_all

COUNT, BAD = POPULATION, POPULATION // 10


def population():
    """Two candidates of a tool each; one in ten breaks, in one way or another, never both of a tool."""
    chosen = np.random.default_rng(7).choice(COUNT // 2, BAD, replace=False)
    kinds = [kind for kind in FAULTS if kind != "hang"]
    faults_of = dict(
        zip(2 * chosen, ["hang", *(kinds[i % 5] for i in range(BAD - 1))], strict=True)
    )
    return [
        candidate(number, faults_of.get(number)) for number in range(COUNT)
    ], faults_of


@pytest.mark.weekly
def test_where_one_in_ten_breaks_the_sound_ones_earn_what_they_earn_alone():
    candidates, fates = population()
    settings = {"workers": 2, "timeout_s": 5.0, "memory_mb": 1500}
    with installed().create("executor", "local", settings) as pool:
        found = {e.candidate.key: e for e in evaluate_all(candidates, SLIDE, pool)}
    assert len(found) == COUNT
    sound = [c for n, c in enumerate(candidates) if n not in fates]
    assert len(sound) == COUNT - BAD
    for one in sound:
        (alone,) = play(SLIDE, [one])
        there = found[one.key]
        assert (there.status, there.reward, there.distance_m) == (
            "ok",
            alone.reward,
            alone.distance_m,
        )
        assert there.reward > 0
    why = {
        "abort": "exit code -6",
        "segfault": "exit code -11",
        "hang": "executor.timeout_s",
        "nan": "the reward nan is not in [0, 1]",
        "leak": "executor.memory_mb=1500",
        "raise": "the solver gave up",
    }
    for number, fault in fates.items():
        broken = found[candidates[number].key]
        assert (broken.status, broken.reward) == ("failed", 0.0)
        assert why[fault] in broken.reason


# --- which plugin is named ------------------------------------------------------------------------------------------


class Clumsy(Slide):
    def reward(self, start, end):
        return [][0]


def condition(monkeypatch, name, task=Slide, sim=Faulty):
    """Offer a task and an engine under a name that no other test has: a process makes each part once."""
    for kind, factory in (("task", task), ("sim", sim)):
        offer = Offer(kind, name, "theirs", "their-distribution", factory)
        monkeypatch.setitem(installed().offers, (kind, name), offer)
    return Condition(PluginPart("task", name), PluginPart("sim", name))


def test_a_simulator_that_raises_is_named(monkeypatch):
    monkeypatch.setattr(faults.Slide, "__module__", "elsewhere")
    with pytest.raises(
        PluginError,
        match="sim 'tired' of their-distribution raised ArithmeticError: the solver",
    ):
        play(condition(monkeypatch, "tired"), [candidate(0, "raise")])


def test_the_reason_that_a_person_reads_names_the_plugin(monkeypatch, tmp_path):
    here = toys.Here(str(tmp_path / "notes"))
    (failed,) = evaluate_all(
        [candidate(0)], condition(monkeypatch, "clumsy", task=Clumsy), here
    )
    assert failed.status == "failed"
    assert (
        failed.reason
        == "task 'clumsy' of their-distribution raised IndexError: list index out of range"
    )
