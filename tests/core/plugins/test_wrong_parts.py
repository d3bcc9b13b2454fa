"""Parts that return something wrong: one line names the part, and the rest goes on."""

import re

import pytest

from core.design import Candidate, Tool
from core.designs.reading import read_designs
from core.errors import UserError
from core.interfaces import EvolutionStrategy
from core.plugins import Offer, installed, parts
from core.search.orchestration import run
from tests.support import toys


class Few(toys.ToyEngine):
    def rollout(self, task, jobs):
        return super().rollout(task, jobs)[1:]


class Numbers(toys.ToyEngine):
    def rollout(self, task, jobs):
        return [0.5 for _ in jobs]


class Chatty(toys.ToyModel):
    def complete(self, requests):
        for reply in super().complete(requests):
            yield reply
            yield reply
        yield "that is all"


class Raising(toys.ToyModel):
    """Answers once in a generation, and then raises what a model may not."""

    def complete(self, requests):
        yield next(super().complete(requests))
        raise KeyError("choices")


class Losing(toys.Here):
    def map(self, function, chunks):
        return (
            pair for number, pair in enumerate(super().map(function, chunks)) if number
        )


@pytest.fixture
def play(tmp_path, monkeypatch):
    """Run with toys, and with one part in the place of another; the candidates' reasons."""

    def play_with(kind, name, part, *words):
        parts._shared.cache_clear()  # made once per process; here it is another one in each test
        for key, offer in toys.offered().items():
            monkeypatch.setitem(installed().offers, key, offer)
        monkeypatch.setitem(
            installed().offers,
            (kind, name),
            Offer(kind, name, "shoddy", "shoddy-parts", part),
        )
        result = run(toys.config(tmp_path / "notes", *words), tmp_path / "run")
        return [
            e.reason
            for generation in result.generations
            for e in generation.evaluations
            if e.status == "failed"
        ]

    yield play_with
    parts._shared.cache_clear()


@pytest.mark.parametrize(
    ("part", "said"),
    [
        (Few, r"rollout gave '\[\]'; expected a list of Outcome"),
        (Numbers, r"rollout gave '\[0\.5\]'; expected a list of Outcome"),
    ],
)
def test_a_simulator_that_gives_something_else(play, part, said):
    reasons = play("sim", "toy", part)
    assert len(reasons) > 5
    for reason in reasons:
        assert reason.startswith("sim 'toy' of shoddy-parts (hook 'simulators'): ")
    assert re.search(said, reasons[0])


def test_a_model_that_raises_costs_its_replies_and_is_named(play, capfd):
    play("vlm", "toy", Raising)
    named = (
        "vlm 'toy' of shoddy-parts (hook 'vlms'): complete raised KeyError: 'choices'"
    )
    said = [line for line in capfd.readouterr().err.splitlines() if named in line]
    assert said
    assert said[0].endswith("requests have no reply")


def test_replies_without_a_request_are_left_out(play, capfd):
    play("vlm", "toy", Chatty)
    said = [
        line
        for line in capfd.readouterr().err.splitlines()
        if line.startswith("vlm 'toy' of shoddy-parts")
    ]
    for what in ("'Reply(request_id=", "\"'that is all'\""):
        words = f"complete gave {what}"
        assert any(
            words in line and "no Reply to a request that waits" in line
            for line in said
        )


def test_an_executor_that_loses_chunks_ends_the_run(play):
    with pytest.raises(
        UserError,
        match=r"executor 'here' of shoddy-parts .*: map gave no result for \d+ trials",
    ):
        play("executor", "here", Losing)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda pairs: [(chunk, None) for chunk, _ in pairs], "expected pairs of"),
        (lambda pairs: [5 for _ in pairs], "map gave '5'; expected pairs of a chunk"),
        (lambda pairs: [(c, [*r, *r]) for c, r in pairs], "6 trials for a chunk of 3"),
        (
            lambda pairs: [(chunk, trials[::-1]) for chunk, trials in pairs],
            "map gave a chunk the result of another",
        ),
    ],
)
def test_an_executor_that_gives_something_else_ends_the_run(play, change, said):
    class Strange(toys.Here):
        def map(self, function, chunks):
            return change(list(super().map(function, chunks)))

    with pytest.raises(UserError, match="executor 'here' of shoddy-parts") as error:
        play("executor", "here", Strange)
    assert said in str(error.value)


@pytest.mark.parametrize(
    ("reward", "said"),
    [
        ("one", r"reward gave .*one.*; expected an array \(\d+,\)"),
        (1j, r"reward gave .*1j.*; expected an array \(\d+,\)"),
        ([[0.5]], r"reward gave .*0\.5.*; expected an array \(\d+,\)"),
    ],
)
def test_a_reward_that_is_something_else_names_its_task(play, reward, said):
    task = type(installed().create("task", "BringCube"))
    strange = type("BringCube", (task,), {"reward": lambda *_: reward})
    reasons = play("task", "BringCube", strange)
    strange = [reason for reason in reasons if "reward gave" in reason]
    assert strange
    assert strange[0].startswith("task 'BringCube' of shoddy-parts (hook 'tasks'): ")
    assert re.search(said, strange[0])


@pytest.mark.parametrize(("asked", "said"), [
    (lambda self: iter(["a hammer"]), "ask gave \"'a hammer'\" among its candidates; expected a Candidate"),
    (lambda self: None, "ask gave None; expected an iterator of Candidate"),
    (lambda self: 2 * [Candidate(None, None, 0, 0, 0, 0, problem="no")], "ask gave two candidates g0-a0-s0-p0; number"),
])  # fmt: skip
def test_a_strategy_that_asks_for_something_else_ends_the_run(play, asked, said):
    part = type(
        "Strays",
        (EvolutionStrategy,),
        {"ask": asked, "tell": lambda self, evaluations: None},
    )
    with pytest.raises(
        UserError, match="evolution 'vlmgineer' of shoddy-parts"
    ) as error:
        play(
            "evolution",
            "vlmgineer",
            part,
            "evolution=sampling",
            "evolution.name=vlmgineer",
        )
    assert said in str(error.value)


@pytest.mark.parametrize(("parse", "said"), [
    (lambda data: data["tool_urdf"]["x"], "parse raised TypeError: "),
    (lambda data: None, "parse gave 'None'; expected Tool"),
    (lambda data: Tool(gripper=True), "parse gave a tool for the fingers, and gripper=False was asked for"),
])  # fmt: skip
def test_a_representation_that_reads_something_else_loses_the_design(
    monkeypatch, parse, said
):
    made = installed().create("tool", "urdf")
    monkeypatch.setattr(type(made), "parse", lambda self, data, *, gripper: parse(data))
    document = {
        "strategies": [{"tool_urdf": "", "action_sets": [[[0.5, 0, 0.5, 0, 0, 0]]]}]
    }
    task = installed().create("task", "BringCube")
    (candidate,) = read_designs(document, made, task)
    assert candidate.problem.startswith(
        f"tool 'urdf' of vlmgineer (hook 'tool_representations'): {said}"
    )
