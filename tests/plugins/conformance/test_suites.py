"""Every built-in part passes the checks of its kind, and the checks find what is wrong."""

import importlib
import itertools
import pkgutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

import plugins.conformance
from core.design import Component, Tool
from core.errors import UsageError, UserError
from core.geometry import Pose
from core.goals import Placed, Reach, Untouched, goals_reward
from core.hooks import Command, hookimpl
from core.interfaces import (
    VLM,
    EvolutionStrategy,
    Executor,
    Fitness,
    GivenTools,
    Reply,
    Score,
    Task,
    Text,
    ToolRepresentation,
)
from core.plugins import KINDS, Offer, PluginPart, installed
from core.scene import Body, Box, Scene, Sphere, floor, table
from plugins.conformance import conformance_command as conformance
from plugins.conformance import executor
from plugins.conformance.shared import ready
from plugins.conformance.suites import SUITES, examine, subject
from plugins.conformance.worlds import GREY
from tests.support.panda import on_panda
from tests.support.rare import mostly

pytestmark = pytest.mark.slow

TASKS = ready("task")
SLOW = [
    ("command", "run"),
    ("evolution", "refined"),
    ("fitness", "robust"),
    ("listener", "rerun"),
    *(("task", name) for name in TASKS[1:-1]),
]
PARTS = [("task", name) for name in TASKS]
PARTS += [("tool", name) for name in ready("tool") if name != "known"]  # needs a file
PARTS += [
    ("evolution", name)
    for name in installed().names("evolution")
    if name != "agent"  # which waits for one
]
PARTS += [("fitness", "nominal"), ("fitness", "robust")]
PARTS += [("command", name) for name in installed().names("command")]
PARTS += [("listener", name) for name in ("progress", "rerun", "summary")]
PARTS += [("vlm", "offline")]  # the others need a key, a folder or a person


def test_every_kind_of_part_has_a_suite():
    assert set(SUITES) == set(KINDS)


@pytest.mark.parametrize(("kind", "name"), mostly(PARTS, *SLOW))
def test_built_in_parts_conform(kind, name):
    checked = subject(PluginPart(kind, name))
    for check in SUITES[kind]:
        check(checked)


def test_a_task_whose_reward_reads_a_trace_conforms():
    problems = {
        verdict.check: verdict.problem for verdict in examine("task", on_panda(Grasp()))
    }
    assert {
        check: problem for check, problem in problems.items() if problem is not None
    } == {}


@pytest.mark.thorough
def test_the_local_executor_conforms():
    checked = subject(PluginPart("executor", "local", (("workers", 2),)))
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


class RollsHome(Task):
    """Solves itself: the ball stands on a slope that leads to the goal."""

    name = "RollsHome"
    description = "A ball stands on a ramp, and is wanted at its foot, half a metre nearer to the robot."
    goals = (Placed(bodies=("ball",), place=(0.6, None, None)),)

    def scene(self, seed):
        ramp = Body.of(
            "ramp",
            Box((1.0, 0.4, 0.02)),
            (0.9, 0, 0.16),
            mass=0,
            color=GREY,
            rpy=(0, -0.2, 0),
        )
        ball = Body.of(
            "ball", Sphere(0.04), ramp.pose.apply([0.2, 0, 0.051]), mass=0.3, color=GREY
        )
        return Scene((floor(), table(), ramp, ball))

    def reward(self, start, end):
        way = start.position("ball")[..., 0] - end.position("ball")[..., 0]
        return np.clip(way / 0.5, 0.0, 1.0)


class Grasp(Task):
    """Its reward reads a trace."""

    name = "Grasp"
    description = (
        "A cube on a table must be held at the end, and the table not be touched."
    )
    goals = (
        Reach(bodies=("cube",), held=True, rest=True),
        Untouched(untouched=("table",)),
    )
    every = True

    def scene(self, seed):
        return Scene(
            (
                floor(),
                table(),
                Body.of(
                    "cube", Box((0.1, 0.1, 0.1)), (0.6, 0, 0.05), mass=1, color=GREY
                ),
            )
        )

    def reward(self, start, end, trace):
        return goals_reward(self, start, end, trace)


class Afar(Grasp):
    name = "Afar"
    home = Pose.xyz_rpy((3.0, 0.0, 0.5), (0.0, 0.0, 0.0))


class Crammed(Task):
    name = "Crammed"
    description = (
        "Two cubes are put into one place, from which an engine throws them apart."
    )
    goals = ()

    def scene(self, seed):
        cubes = (
            Body.of(name, Box((0.1, 0.1, 0.1)), (0.6, 0, z), mass=1, color=GREY)
            for name, z in CRAMMED
        )
        return Scene((floor(), table(), *cubes))

    def reward(self, start, end):
        return np.zeros(end.positions.shape[:-2])


CRAMMED = (("low", 0.05), ("high", 0.07))


class Mute(VLM):
    model = " "

    def complete(self, requests):
        return iter([Reply("another", "", "")] if requests else [])


class Floating(GivenTools):
    """Gives a box in the air, far from the flange."""

    def given(self, task):
        return Tool(
            (
                Component(
                    "box",
                    "tool_mount",
                    Pose.xyz_rpy((0.0, 0.0, -0.2)),
                    Box((0.1, 0.1, 0.1)),
                ),
            )
        )


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
        return (
            candidate
            for candidate in list(self.designer.design(int(rng.integers(1000))))
        )

    def tell(self, evaluations):
        pass


class Greedy(Executor):
    def map(self, function, chunks):
        return iter([(chunk, function(chunk)) for chunk in list(chunks)[:-1]])

    def close(self):
        pass


class Deaf(Executor):
    """Has one worker, which is waited for when the executor is closed."""

    def map(self, function, chunks):
        return ((chunk, function(chunk)) for chunk in chunks)

    def close(self):
        pass


class Doomed(Executor):
    """Takes all that follows for lost when a chunk's worker died."""

    def map(self, function, chunks):
        local = installed().create("executor", "local", workers=1)
        lost = None
        with local:
            for chunk, result in local.map(function, chunks):
                lost = result if isinstance(result, RuntimeError) else lost
                yield chunk, lost or result

    def close(self):
        pass


class Throws(VLM):
    model = "throws"

    def complete(self, requests):
        for request in requests:
            for part in request.messages[-1].parts:
                if not isinstance(part, Text):
                    raise TypeError("can't read the picture")
            yield Reply(request.id, "", self.model, "no")


class Threads(Executor):
    """Keeps all rules of an executor but that one thread of a process plays at a time."""

    def map(self, function, chunks):
        chunks = iter(chunks)
        with ThreadPoolExecutor(2) as pool:
            for begin in iter(lambda: [*itertools.islice(chunks, 2)], []):
                futures = [(chunk, pool.submit(function, chunk)) for chunk in begin]
                for chunk, future in futures:
                    yield chunk, future.exception() or future.result()

    def close(self):
        pass


class Careless(Fitness):
    """Repeats a condition, shows the search what it calls unseen, and has conditions that can't travel."""

    def __init__(self, condition):
        self.condition = replace(condition, examiner=lambda: None)

    def conditions(self):
        return [self.condition, self.condition]

    def score(self, candidate, trials):
        return Score(trials[0].reward)

    def unseen(self):
        return [self.condition]


class Fickle(Fitness):
    """Perturbs the scene in another way each time, and can't do without a trial."""

    races = True
    number = 0

    def __init__(self, condition):
        self.condition = replace(condition, change=self)

    def __call__(self, scene):
        first, *others = scene.bodies
        x = np.random.default_rng().uniform(0.3, 0.4)
        moved = replace(first, pose=Pose.xyz_rpy((x, 0.0, 1.0)))
        return replace(scene, bodies=(moved, *others))

    def perturb_tool(self, tool):
        return tool

    def conditions(self):
        return [self.condition, replace(self.condition, layout=1)]

    def score(self, candidate, trials):
        return Score((trials[0].reward + trials[1].reward) / 2)


class Picky(Fitness):
    """Has another opinion each time, whatever the trials earned."""

    calls = itertools.count(1)

    def __init__(self, condition):
        self.condition = condition

    def conditions(self):
        return [self.condition]

    def score(self, candidate, trials):
        return Score(next(self.calls) / 3)


class Trusting:
    """A listener that takes what it receives for sound."""

    @hookimpl
    def run_started(self, run):
        self.file = (run.folder / "names.txt").open("x")

    @hookimpl
    def candidate_evaluated(self, evaluation):
        self.file.write(evaluation.candidate.tool.name)

    @hookimpl
    def run_ended(self):
        self.file.close()


SULLEN = Command("does nothing\nat all", lambda words: 3)

WRONG = {
    ("command", SULLEN): {
        "its help is one line": "help has more than one line",
        "help prints its usage": "with --help its exit status is 3 instead of 0",
        "an unknown word is one line": "an unknown word raises no UsageError: exit status 3",
    },
    ("listener", Trusting): {
        "it receives a whole run": "candidate_evaluated raised AttributeError: 'NoneType' object has no attribute",
        "a run may break off": "run_started raised FileExistsError",
        "a run may end before it starts": "run_ended raised AttributeError",
    },
    ("fitness", Careless): {
        "it names conditions": "conditions repeats Where(task=",
        "the search does not see the unseen": "the search sees what should be unseen: Where(task=",
        "conditions travel to workers": "a condition can't be pickled, and workers need a copy",
    },
    ("fitness", Fickle): {
        "a change is the same each time": "a change gives another scene each time",
        "a race may leave trials out": "IndexError",
    },
    ("fitness", Picky): {
        "scores are rewards": "a reward is 1.3333333333333333, not in [0, 1]",
        "the same trials score the same": "a score follows from the trials alone",
        "what fails earns nothing": "a candidate whose trials were all rejected scores",
    },
    ("task", RollsHome): {
        "nothing happens while the arm waits": "in mujoco 'ball' moves",
    },
    ("task", Crammed): {
        "nothing overlaps at spawn": "with seed 0 low and high overlap by 80 mm"
    },
    ("task", Idle): {
        "one seed gives one layout": "nothing in the scene can move",
        "rewards work for one world or many": "the reward of 5 worlds has the shape (3,), not (5,)",
    },
    ("vlm", Mute): {
        "it has a name": "model is ' '",
        "each request has its reply": "the requests g0-a0, g0-a1 had replies to another",
    },
    ("tool", Floating): {
        "given tools keep the rules": "tool 'wrong' of tests (hook 'tool_representations'): the tool that it gives for "
    },
    ("tool", Forgetful): {
        "the instructions name every field": "the instructions don't name 'tool'",
        "tools survive dump and parse": "what dump returned can't be written as JSON",
        "nonsense is refused with a reason": "parse raised KeyError on '{}', not a DesignError",
    },
    ("evolution", Moody): {
        "the same again": "the same evaluations gave different candidates",
        "a limit is passed on": "candidates before the limit are lost",
    },
    ("executor", Greedy): {
        "each chunk comes back with its result": "12 chunks went in, 11 came out",
        "chunks are not read all at once": "before the first result was taken, 1000 of 1000 chunks were read",
    },
    ("vlm", Throws): {
        "a request that it cannot serve has its reply too": "TypeError: can't read the picture",
    },
    ("executor", Threads): {
        "rollouts side by side are those played one by one": "two threads of one process play at once",
    },
}


@pytest.fixture
def offered(monkeypatch):
    """Offer a part under the name ``wrong``."""

    def offer(kind, part):
        monkeypatch.setitem(
            installed().offers,
            (kind, "wrong"),
            Offer(kind, "wrong", "tests", "tests", part),
        )
        return PluginPart(kind, "wrong")

    return offer


@pytest.mark.parametrize(("kind", "part"), WRONG)
def test_what_is_wrong_is_reported(offered, kind, part, monkeypatch):
    monkeypatch.setattr(executor, "LONGEST_START_S", 1.0)
    monkeypatch.setattr(executor, "LONGEST_S", 0.2)
    problems = {
        verdict.check: verdict.problem
        for verdict in examine(kind, subject(offered(kind, part)))
    }
    assert len(problems) == len(SUITES[kind])
    for check, problem in WRONG[kind, part].items():
        assert problems[check] is not None, check
        assert problem in problems[check]


def test_an_executor_that_cannot_be_closed_is_reported(monkeypatch):
    monkeypatch.setattr(executor, "LONGEST_S", 0.2)
    with pytest.raises(AssertionError, match="close was called, and map waits on"):
        executor.check_map_ends_when_another_thread_closes(Deaf)


def test_an_executor_that_loses_more_than_a_dead_worker_had_is_reported():
    with pytest.raises(AssertionError, match="a worker that died took other chunks"):
        executor.check_a_dead_worker_costs_its_chunk_alone(Doomed)


def test_a_home_out_of_reach_is_reported_once():
    verdicts = list(examine("task", on_panda(Afar())))
    (problem,) = [
        verdict.problem for verdict in verdicts if verdict.problem is not None
    ]
    assert "can't reach the task's home (3, 0, 0.5)" in problem
    assert (
        sum(
            verdict.remark == "left out: the arm does not reach home"
            for verdict in verdicts
        )
        == 1
    )


def test_listeners_are_checked_by_name(monkeypatch, capsys):
    conformance.main(["listener=[summary,progress]", "listener.summary.top=1"])
    out = capsys.readouterr().out
    assert out.startswith("listener summary\n")
    assert "\nlistener progress\n" in out
    assert out.count(": ok") == 2 * len(SUITES["listener"])


def test_the_command_counts_what_failed(offered, monkeypatch, capsys):
    offered("task", Idle)
    with pytest.raises(UserError, match=r"^\d of 14 checks failed$"):
        conformance.main(["tool=none", "task=wrong"])
    out = capsys.readouterr().out
    assert "tool none\n" in out
    assert "one seed gives one layout: FAILED: nothing in the scene can move" in out
    # With the place in the code.
    assert "(" in next(line for line in out.splitlines() if "TypeError" in line)


def test_checks_that_python_leaves_out_are_not_said_to_pass():
    words = [sys.executable, "-O", "-m", "core", "conformance", "tool=none"]
    found = subprocess.run(words, capture_output=True, text=True)
    assert found.returncode != 0
    assert "checks are assertions, which python -O leaves out" in found.stderr


def test_something_must_be_named(monkeypatch):
    with pytest.raises(
        UsageError,
        match=r"name a part to check; usage: vlmgineer conformance \{sim\|task\|",
    ):
        conformance.main([])


def test_no_check_is_forgotten():
    """A check that stands in no list is never run."""
    listed = {check for checks in SUITES.values() for check in checks}
    for info in pkgutil.iter_modules(
        plugins.conformance.__path__, "plugins.conformance."
    ):
        for name, check in vars(importlib.import_module(info.name)).items():
            if name.startswith("check_") and check.__module__ == info.name:
                assert check in listed, f"{info.name}.{name}"
