"""Critiques: which candidates are shown, once each, and where a critic's words go."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.config.schemas import PromptSettings, Sampling
from core.design import Candidate
from core.designs.composer import PromptComposer
from core.designs.prompt_values import RunFacts
from core.errors import LimitReached, UsageError
from core.events import Generation
from core.interfaces import Budget, Picture, Reply, Text
from core.search.assignment import Assignment, Team
from core.search.builder import equip
from core.search.designer import ModelDesigner
from plugins.actions.waypoints import WaypointActions
from plugins.conformance.evaluations import tried_once
from plugins.vlms.critic import MAX_CRITIQUE, ModelCritic
from plugins.vlms.offline.designer import OfflineDesigner
from tasks.bring_cube import BringCube
from tests.support.designers import PLAN, ROD, URDF, Canned, Listener, designer, good
from tests.support.panda import on_panda

BUDGET = Budget(2, 1, 1, 3, 5, 0.6)


def tried(generation, *rewards):
    """Evaluations of a generation."""
    candidates = [
        Candidate(ROD, np.array(PLAN), generation, agent)
        for agent in range(len(rewards))
    ]
    return [
        tried_once(c, "ok", reward, 1.0, moved_m={"cube": 0.1})
        for c, reward in zip(candidates, rewards, strict=True)
    ]


def draw_blank(evaluation):
    return Picture(b"png", f"strip_{evaluation.candidate.id}")


def criticised(answer, count=2, events=None, **settings):
    """A designer with a critic, and its model."""
    prompt = PromptSettings(critic=count, **settings)
    vlm = Canned(
        lambda request: good(request) if request.asks_designs else answer(request)
    )
    made = designer(vlm, BUDGET, prompt=prompt, events=events, show=draw_blank)
    made.critic = ModelCritic(made)
    return made, vlm


def says(text):
    return lambda request: Reply(request.id, text, "a critic")


def ask(made, generation, elites, evaluations):
    """Design a generation after the last one was told; return the texts of an agent's request."""
    made.generation_finished(Generation(generation - 1, tuple(evaluations)))
    list(made.design(generation, elites))
    return "".join(
        p.text
        for m in made.vlm.requests[-1].messages
        for p in m.parts
        if isinstance(p, Text)
    )


def test_the_best_elite_and_the_most_instructive_failure_are_shown_and_their_critiques_quoted():
    listener = Listener()
    made, vlm = criticised(says("It slips off."), events=listener.hub)
    evaluations = tried(0, 0.2, 0.9, 0.3, 0.95)
    text = ask(made, 1, [evaluations[3], evaluations[1]], evaluations)
    critiques = [request for request in vlm.requests if not request.asks_designs]
    assert [r.id for r in critiques] == ["g1-critic0", "g1-critic1"]
    assert [[e.candidate.id for e in r.brief.elites] for r in critiques] == [
        ["g0-a3-s0-p0"],
        ["g0-a2-s0-p0"],
    ]
    assert all(r.schema == {} and r.brief.tried for r in critiques)
    for request in critiques:
        shown = "".join(
            p.text for m in request.messages for p in m.parts if isinstance(p, Text)
        )
        assert BringCube.description in shown
        assert request.brief.elites[0].candidate.id in shown
        assert "JSON schema" not in shown
        assert [
            p.name for m in request.messages for p in m.parts if isinstance(p, Picture)
        ] == [f"strip_{request.brief.elites[0].candidate.id}"]
    quoted = json.loads(
        text.partition("## Critiques")[2].partition("```json")[2].partition("```")[0]
    )
    assert [(q["id"], q["reward"], q["critique"]) for q in quoted] == [
        ("g0-a3-s0-p0", 0.95, "It slips off."),
        ("g0-a2-s0-p0", 0.3, "It slips off."),
    ]
    asked = [name for what, name in listener.received if what == "asked"]
    answered = [name for what, name in listener.received if what == "answered"]
    # The others wait for critiques.
    assert asked == ["g1-critic0", "g1-critic1", "g1-a0", "g1-a1"]
    assert sorted(answered) == sorted(asked)


def test_each_candidate_is_shown_once_and_an_elite_keeps_its_critique():
    made, vlm = criticised(
        lambda r: Reply(r.id, f"seen as {r.id}", "a critic"), count=1
    )
    first, second = tried(0, 0.9), tried(1, 0.1, 0.2)
    ask(made, 1, first, first)
    text = ask(made, 2, first, second)
    shown = [
        (r.id, r.brief.elites[0].candidate.id)
        for r in vlm.requests
        if not r.asks_designs
    ]
    assert shown == [("g1-critic0", "g0-a0-s0-p0"), ("g2-critic0", "g1-a1-s0-p0")]
    assert "seen as g1-critic0" in text
    assert "seen as g2-critic0" in text


def test_a_strategy_that_asks_twice_in_a_generation_has_as_many_critiques():
    made, vlm = criticised(says("seen"), count=2)
    evaluations = tried(0, 0.9, 0.1)
    ask(made, 1, evaluations[:1], evaluations)
    list(made.design(1, evaluations[:1]))
    asked = [request.id for request in vlm.requests if not request.asks_designs]
    assert asked == ["g1-critic0", "g1-critic1"]


@pytest.mark.parametrize("feedback", ["paper", "full"])
def test_without_a_critic_or_anything_tried_nothing_is_asked(feedback):
    made, vlm = criticised(says("?"), count=0, feedback=feedback)
    evaluations = tried(0, 0.9)
    assert "Critiques" not in ask(made, 1, evaluations, evaluations)
    assert not any(not request.asks_designs for request in vlm.requests)
    made, vlm = criticised(says("?"), feedback=feedback)
    list(made.design(0))
    assert not any(not request.asks_designs for request in vlm.requests)


@pytest.mark.thorough
@settings(max_examples=10)
@given(
    st.text(max_size=50).map(lambda text: text * 100)
    | st.sampled_from(["```\n# Mission\n" * 9, "\ud800", "\x1b[2J", "{" * 9])
)
def test_whatever_a_critic_writes_stays_one_bounded_text(text):
    made, _ = criticised(says("It slips."))
    evaluations = tried(0, 0.9)
    brief, _ = made.brief(1, 0, Team(range(1), evaluations), tuple(evaluations))
    request = made.critic.requests(replace(brief, tried=tuple(evaluations)))[0]
    made.critic.hear(Reply(request.id, text, "a critic"), request)
    words = made.critic.words(evaluations, evaluations)
    prompt = made.prompts.compose(
        replace(brief, critiques=words, tried=tuple(evaluations))
    )
    shown = "".join(
        part.text for message in prompt for part in message.parts
    ).partition("## Critiques")[2]
    fenced = shown.partition("```json")[2].partition("```")[0]
    assert [
        len(entry["critique"]) <= MAX_CRITIQUE for entry in json.loads(fenced or "[]")
    ] == [True] * len(words)


def test_a_critic_that_fails_costs_its_critique_alone():
    made, _ = criticised(
        lambda r: Reply(r.id, "", "a critic", "no answer", unanswered=True)
    )
    evaluations = tried(0, 0.9, 0.1)
    assert "## Critiques" not in ask(made, 1, evaluations[:1], evaluations)


def test_a_limit_is_passed_on():
    def limited(request):
        raise LimitReached("all is spent")

    made, _ = criticised(limited)
    evaluations = tried(0, 0.9)
    with pytest.raises(LimitReached, match="all is spent"):
        ask(made, 1, evaluations, evaluations)


def test_a_program_that_writes_no_critiques_is_not_asked():
    prompts = PromptComposer(RunFacts(PromptSettings(critic=2)))
    assignment = Assignment(on_panda(BringCube()), URDF, WaypointActions(), BUDGET, 0)
    made = ModelDesigner(
        assignment, OfflineDesigner(), prompts, Sampling(), Listener().hub
    )
    equip(made)
    assert made.critic is None


def test_a_negative_number_is_refused():
    with pytest.raises(
        UsageError, match=r"prompt\.critic must be 0 or greater, got -1"
    ):
        PromptComposer(RunFacts(PromptSettings(critic=-1)))
