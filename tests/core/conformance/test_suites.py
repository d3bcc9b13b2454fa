"""Every built-in part does what every part of its kind must; and the checks see what is wrong."""

import importlib
import pkgutil

import numpy as np
import pytest

import core.conformance
from core.conformance import __main__ as conformance
from core.conformance.suites import SUITES, subject, verdicts
from core.errors import UsageError, UserError
from core.interfaces import VLM, EvolutionStrategy, Executor, Reply, Task, ToolRepresentation
from core.plugins import Offer, installed
from core.scene import Scene, table
from core.simulation.rollout import Part

PARTS = [("task", name) for name in installed().names("task")]
PARTS += [("tool", name) for name in installed().names("tool")]
PARTS += [("evolution", name) for name in installed().names("evolution")]
PARTS += [("vlm", "offline")]  # the others need a key, a folder or a person


@pytest.mark.parametrize(("kind", "name"), PARTS)
def test_built_in_parts_conform(kind, name):
    checked = subject(Part(kind, name))
    for check in SUITES[kind]:
        check(checked)


def test_the_local_executor_conforms():
    checked = subject(Part("executor", "local", (("workers", 1),)))
    for check in SUITES["executor"]:
        check(checked)


# --- wrong ones -------------------------------------------------------------------------------------------------


class Idle(Task):
    name = "Idle"
    description = "Nothing is to be done here, and that is enough."
    goals = ()

    def scene(self, seed):
        return Scene((table(),))

    def reward(self, start, end):
        return np.ones(3)


class Mute(VLM):
    model = " "

    def complete(self, requests):
        return iter([Reply("another", "", "")] if requests else [])


class Forgetful(ToolRepresentation):
    def instructions(self, brief):
        return ""

    def schema(self):
        return {"tool": {"type": "string"}}

    def parse(self, data, *, gripper):
        return data["tool"]

    def dump(self, tool):
        return {"tool": tool}


class Moody(EvolutionStrategy):
    def ask(self):
        rng = np.random.default_rng()
        return (candidate for candidate in list(self.designer.design(int(rng.integers(1000)))))

    def tell(self, evaluations):
        pass


class Greedy(Executor):
    def map(self, function, chunks):
        return iter([(chunk, function(chunk)) for chunk in list(chunks)[:-1]])

    def close(self):
        pass


WRONG = {
    ("task", Idle): {
        "the scene is the seeds": "nothing in the scene can move",
        "rewards are of one world or many": "the reward of 5 worlds has the shape (3,)",
    },
    ("vlm", Mute): {
        "it has a name": "model is ' '",
        "each request has its reply": "the requests g0-a0, g0-a1 had replies to another",
    },
    ("tool", Forgetful): {
        "a model is told how to write it": "the instructions don't speak of 'tool'",
        "tools come back as they were": "what dump gave can't be written as JSON",
        "nonsense is refused with a reason": "parse raised KeyError on {}, not a DesignError",
    },
    ("evolution", Moody): {
        "the same again": "two searches that were told the same asked for different candidates",
        "a limit is passed on": "candidates that came before the limit was reached are lost",
    },
    ("executor", Greedy): {
        "each chunk comes back with its result": "12 chunks went in, 11 came out",
        "chunks are not read all at once": "before the first result was taken, 1000 of 1000 chunks were read",
    },
}


@pytest.fixture
def wrong(monkeypatch):
    for kind, part in WRONG:
        monkeypatch.setitem(installed().offers, (kind, "wrong"), Offer(kind, "wrong", "tests", "tests", part))


@pytest.mark.parametrize(("kind", "part"), WRONG)
def test_what_is_wrong_is_told(wrong, kind, part):
    told = {verdict.check: verdict.problem for verdict in verdicts(Part(kind, "wrong"))}
    assert len(told) == len(SUITES[kind])
    for check, problem in WRONG[kind, part].items():
        assert told[check] is not None, check
        assert problem in told[check]


def test_the_command_counts_what_failed(wrong, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["core.conformance", "tool=none", "task=wrong"])
    with pytest.raises(UserError, match=r"^\d of 11 checks failed$"):
        conformance.main()
    out = capsys.readouterr().out
    assert "tool none\n" in out
    assert "the scene is the seeds: FAILED: nothing in the scene can move" in out
    assert "(" in next(line for line in out.splitlines() if "TypeError" in line)  # with the place in the code


def test_something_must_be_named(monkeypatch):
    monkeypatch.setattr("sys.argv", ["core.conformance"])
    with pytest.raises(UsageError, match=r"what is to be checked\? usage: python -m core.conformance \{sim\|task\|"):
        conformance.main()


def test_no_check_is_forgotten():
    """One that stands in no list is never run, and nobody notices."""
    listed = {check for checks in SUITES.values() for check in checks}
    for info in pkgutil.iter_modules(core.conformance.__path__, "core.conformance."):
        for name, check in vars(importlib.import_module(info.name)).items():
            if name.startswith("check_") and check.__module__ == info.name:
                assert check in listed, f"{info.name}.{name}"
