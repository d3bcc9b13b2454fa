"""Several models: who is asked, by what was earned for the cost, within limits, and the same again after a resume."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from omegaconf import OmegaConf

from core.config.compose import load
from core.config.trust import refuse_keys
from core.design import Candidate
from core.errors import UsageError, UserError
from core.events import Generation
from core.hooks import hookimpl
from core.interfaces import VLM, Reply, Waypoints
from core.plugins import Offer, installed
from plugins.conformance.evaluations import tried_once
from plugins.conformance.suites import SUITES
from plugins.vlms.ensemble import Ensemble
from tests.plugins.vlms.asking import until_limit
from tests.plugins.vlms.servers import Say, request, serving

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[3]
SOLUTION = (ROOT / "tests/tasks/solutions/BringCube.json").read_text()


class Priced(VLM):
    """Answers at a cost; ``earns`` is what tests let its designs earn."""

    def __init__(self, model="one", earns=0.5, cost=None):
        self.model = model
        self.earns = earns
        self.cost = cost
        self.heard = []

    def complete(self, requests):
        for one in requests:
            yield Reply(one.id, "{}", self.model, cost_usd=self.cost)

    @hookimpl
    def reply_received(self, request, reply):
        self.heard.append(request.id)


@pytest.fixture
def priced(monkeypatch):
    """The name of a model for members."""
    offers = dict(installed().offers) | {
        ("vlm", "priced"): Offer("vlm", "priced", "tests", "tests", Priced)
    }
    monkeypatch.setattr(installed(), "offers", offers)


def member(model, earns, cost=None):
    return {"name": "priced", "model": model, "earns": earns, "cost": cost}


def requests_of(generation, agents):
    found = [request(agent) for agent in range(agents)]
    return [
        replace(
            r,
            id=f"g{generation}-a{r.brief.agent}",
            brief=replace(r.brief, generation=generation),
        )
        for r in found
    ]


def generation(index, earned):
    """What each agent's design earned."""
    plan = Waypoints([[0.5, 0.0, 0.4, 0.0, 0.0, 0.0]])
    evaluations = [
        tried_once(Candidate(None, plan, index, a), "ok", reward)
        for a, reward in earned.items()
    ]
    return Generation(index, tuple(evaluations))


def played(vlm, members, generations=25, agents=4, stored=()):
    """Deal as in a run, whose replies are perhaps ``stored`` already; return all replies by generation."""
    earns = {m["model"]: m["earns"] for m in members}
    replies = [dict(past) for past in stored]
    for index in range(generations):
        asked = requests_of(index, agents)
        if index == len(replies):
            replies.append({reply.request_id: reply for reply in vlm.complete(asked)})
        for one in asked:
            vlm.reply_received(one, replies[index][one.id])
        vlm.generation_finished(
            generation(
                index, {r.brief.agent: earns[replies[index][r.id].model] for r in asked}
            )
        )
    return replies


def dealt(replies):
    return Counter(reply.model for of in replies for reply in of.values())


# --- who is asked -----------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("priced")
def test_the_better_member_is_asked_most_and_each_at_least_once():
    members = [member("bad", 0.1), member("good", 0.9), member("fair", 0.5)]
    replies = played(Ensemble(members, seed=3), members)
    assert {reply.model for reply in replies[0].values()} == {"bad", "good", "fair"}
    counts = dealt(replies)
    assert counts["good"] > 70 > 25 > counts["bad"] > 0


@pytest.mark.usefixtures("priced")
def test_reward_counts_for_its_cost():
    members = [member("dear", 0.9, 0.5), member("cheap", 0.6, 0.05)]
    assert dealt(played(Ensemble(members), members))["cheap"] > 80
    for unknown in (None, 0.0):  # then by reward alone
        members = [member("dear", 0.9, 0.5), member("free", 0.3, unknown)]
        assert dealt(played(Ensemble(members), members))["dear"] > 75


@pytest.mark.usefixtures("priced")
def test_a_resumed_run_deals_as_the_undisturbed_one():
    members = [member("a", 0.4, 0.01), member("b", 0.6, 0.03)]
    whole = played(Ensemble(members, seed=7), members)
    assert played(Ensemble(members, seed=7), members, stored=whole[:9]) == whole
    assert played(Ensemble(members, seed=8), members) != whole


# --- settings ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({}, "vlm.members is empty; name models"),
        ({"members": ["ofline"]}, "no vlm 'ofline'.*did you mean 'offline'"),
        ({"members": ["offline", "offline"]}, "'offline' is repeated"),
        ({"members": [{"model": "x"}]}, "names no vlm"),
        (
            {"members": [{"name": "offline", "size": 3}]},
            "no setting 'size' in vlm=offline",
        ),
        (
            {"members": [{"name": "ensemble", "members": ["offline"]}]},
            "an ensemble can't be a member",
        ),
        (
            {"members": ["offline"], "max_cost_usd": 0},
            "vlm.max_cost_usd must be greater than 0",
        ),
    ],
)
def test_settings_that_can_not_be_used(settings, said):
    with pytest.raises(UsageError, match=said):
        installed().create("vlm", "ensemble", settings)


def test_a_key_of_a_member_is_refused_before_anything_is_written():
    for words in (
        ["vlm=ensemble", "vlm.members=[{name: openai, api_key: abcdefgh}]"],
        [
            "vlm=ensemble",
            "vlm.members=[{name: openai, api_base: 'http://me:sk-0123456789abcdef@x/v1'}]",
        ],
    ):
        with pytest.raises(UserError, match="is a key or holds one") as error:
            load("config", words)
        assert "abcdef" not in str(error.value)
    config = OmegaConf.create(
        {
            "vlm": {
                "name": "ensemble",
                "members": [{"name": "openai", "api_key": "abcdefgh"}],
            }
        }
    )
    with pytest.raises(
        UserError, match=r"vlm\.members\.api_key of the configuration is a key"
    ):
        refuse_keys(config)


@pytest.mark.parametrize("check", SUITES["vlm"], ids=lambda check: check.__name__)
def test_it_conforms(check):
    check(Ensemble(["offline"]))


# --- limits and failures, with servers that speak the providers' protocols ---------------------------------------


def two(open_ai, google, **more):
    """Members of both protocols, one call at a time."""
    return [
        {
            "name": "openai",
            "model": "openai/gpt-4.1",
            "api_base": f"{open_ai.url}/v1",
            "concurrency": 1,
            **more,
        },
        {"name": "gemini", "api_base": google.url, "concurrency": 1, **more},
    ]


@pytest.mark.thorough
@pytest.mark.usefixtures("planted", "warm")
def test_the_others_go_on_where_a_member_reaches_its_limit():
    with serving(lambda call: Say()) as first, serving(lambda call: Say()) as second:
        members = two(first, second)
        members[0]["max_tokens_total"] = 1500  # two answers
        vlm = Ensemble(members)
        replies = list(vlm.complete(requests_of(0, 12)))
        assert sorted(reply.request_id for reply in replies) == sorted(
            r.id for r in requests_of(0, 12)
        )
        assert [len(first.calls), len(second.calls)] == [2, 10]
        assert Counter(reply.model for reply in replies) == {
            "openai/gpt-4.1": 2,
            "gemini/gemini-2.5-pro": 10,
        }
        members[1]["max_tokens_total"] = 2500
        replies, said = until_limit(Ensemble(members), requests_of(0, 12))
        assert len(replies) == 5
        assert (
            "openai/gpt-4.1: vlm.max_tokens_total=1500 is reached: 2014 tokens are used"
            in said
        )
        assert "gemini/gemini-2.5-pro: vlm.max_tokens_total=2500 is reached" in said
        assert said.endswith("; 7 of 12 requests are left without a reply")


LIMITS = ({"max_tokens_total": 5000}, {"max_cost_usd": 0.0})


@pytest.mark.thorough
@pytest.mark.usefixtures("planted", "warm")
@pytest.mark.parametrize("limit", LIMITS)
def test_one_limit_holds_for_all_members_also_for_what_a_resumed_run_had_spent(limit):
    with serving(lambda call: Say()) as first, serving(lambda call: Say()) as second:
        if "max_cost_usd" in limit:
            limit = {
                "max_cost_usd": 4.5
                * max(
                    r.cost_usd
                    for r in Ensemble(two(first, second)).complete(requests_of(0, 2))
                )
            }
            first.calls.clear()
            second.calls.clear()
        replies, said = until_limit(
            Ensemble(two(first, second), **limit), requests_of(0, 20)
        )
        assert 5 <= len(replies) == len(first.calls) + len(second.calls) <= 9
        assert f"vlm.{next(iter(limit))}=" in said
        resumed = Ensemble(two(first, second), **limit)
        for reply in replies:
            resumed.reply_received(
                next(r for r in requests_of(0, 20) if r.id == reply.request_id), reply
            )
        again, _ = until_limit(resumed, requests_of(0, 20)[-3:])
        assert again == []
        with pytest.raises(
            UserError, match=r"can't be applied: .* no price for openai/my-own"
        ):
            Ensemble(
                [
                    {
                        "name": "litellm",
                        "model": "openai/my-own",
                        "api_base": f"{first.url}/v1",
                    }
                ],
                max_cost_usd=1.0,
            )
