"""An ensemble of models: deals requests to its members, and goes on with the others where one reaches its limit."""

from __future__ import annotations

import threading
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import fsum
from statistics import fmean
from typing import Annotated, Any

import numpy as np

from core.config.compose import read_parts
from core.errors import LimitReached, UsageError, check_positive
from core.events import Generation, Run
from core.hooks import PartsOf, hookimpl
from core.interfaces import VLM, Reply, Request, Spending
from core.plugins import MODEL, event_hub
from core.plugins.blame import add_listener
from core.support.text import clean
from core.support.threads import merge

_LONGEST = 150  # characters of a label


class Ensemble(VLM):
    """Deals each request to a member, by what its answers have earned for their cost (`Dealer`).

    An answer earns the best reward among its candidates. A second request of an agent goes to the same member. Replies
    bear the member's label, which is its model. Of a run's events members hear its start, and their own replies.

    Args:
        members: names, as in ``vlm=NAME``, or mappings of a ``name`` and settings.
        max_cost_usd: limit of what all members cost together, beside their own; None: no limit.
        max_tokens_total: limit of their prompts and answers together; None: no limit.
        seed: of the draws.

    Raises:
        UserError: a member or a limit that can't be used.
    """

    def __init__(
        self,
        members: Annotated[list[str | dict[str, Any]], PartsOf("vlm")] = [],  # noqa: B006 - read as a configuration's default
        max_cost_usd: float | None = None,
        max_tokens_total: int | None = None,
        seed: int = 0,
    ) -> None:
        if not members:
            raise UsageError(
                "vlm.members is empty; name models, such as vlm.members=[gemini,openai]"
            )

        check_positive(
            "vlm.", max_cost_usd=max_cost_usd, max_tokens_total=max_tokens_total
        )
        limits = Spending(max_cost_usd, max_tokens_total)
        self._members: dict[str, VLM] = {}
        self._events = event_hub()

        for member in read_parts(MODEL, members).values():
            vlm = member.create()
            if isinstance(vlm, Ensemble):
                raise UsageError(
                    "vlm.members: an ensemble can't be a member of one; name its members here"
                )

            label = clean(vlm.model, _LONGEST)
            if label in self._members:
                label = f"{label} ({len(self._members) + 1})"

            self._members[label] = vlm
            vlm.share(limits)
            add_listener(self._events, vlm, label)

        vlms = self._members.values()
        self.model = f"ensemble of {', '.join(self._members)}"
        self.takes_schema = all(vlm.takes_schema for vlm in vlms)
        self.repairs = any(vlm.repairs for vlm in vlms)
        self.criticises = any(vlm.criticises for vlm in vlms)
        self.sees = all(vlm.sees for vlm in vlms)
        self._dealer = Dealer(list(self._members), seed)
        # by generation and agent
        self._replies: dict[tuple[int, int], list[Reply]] = defaultdict(list)

    def complete(self, requests: Sequence[Request]) -> Iterator[Reply]:
        """See `VLM.complete`. What a member leaves at its limit goes to the others."""
        left = list(requests)

        closed: dict[str, LimitReached] = {}
        while left:
            if len(closed) == len(self._members):
                limits = [f"{label}: {closed[label].limit}" for label in closed]
                raise LimitReached(
                    ", ".join(limits),
                    f"{len(left)} of {len(requests)} requests are left without a reply",
                )

            hands: dict[str, list[Request]] = defaultdict(list)
            for request in left:
                label = self._choose(request, closed)
                if label is not None:
                    hands[label].append(request)
                    continue

                # A limit ends no run that can go on.
                error = "no member that writes critiques is left"
                yield Reply(request.id, "", self.model, error=error)

            answered = set()
            for label, reply in self._ask(hands, closed):
                answered.add(reply.request_id)
                yield replace(reply, model=label)

            left = []
            for label, hand in hands.items():
                if label in closed:
                    left += [request for request in hand if request.id not in answered]

    def _choose(
        self,
        request: Request,
        closed: Mapping[str, LimitReached],
    ) -> str | None:
        """Choose the member that is to answer a request; None: all that can have reached their limit.

        Args:
            request: of designs, or of a critique, which not all members write.
            closed: the members that have reached a limit.
        """
        for label in self._dealer.ranking(request):
            is_able = self._members[label].criticises or request.asks_designs
            if is_able and label not in closed:
                return label

        return None

    def _ask(
        self,
        hands: Mapping[str, list[Request]],
        closed: dict[str, LimitReached],
    ) -> Iterator[tuple[str, Reply]]:
        """Yield the replies of all members as they arrive, and add those that reach a limit to ``closed``.

        Each member answers in a thread of its own.

        Args:
            hands: the requests of each member.
            closed: to which members are added.
        """
        stop = threading.Event()

        def receive(label: str) -> Iterator[tuple[str, Reply]]:
            try:
                for reply in self._members[label].complete(hands[label]):
                    yield label, reply
                    if stop.is_set():
                        return
            except LimitReached as limit:
                closed[label] = limit

        try:
            yield from merge({label: partial(receive, label) for label in hands})
        finally:
            stop.set()

    @hookimpl
    def run_started(self, run: Run) -> None:
        self._events.hook.run_started(run=run)

    @hookimpl
    def reply_received(self, request: Request, reply: Reply) -> None:
        """Pass a reply on to the member that gave it, by its label: a resumed run repeats those that are stored."""
        if reply.model not in self._members:
            return

        others = [
            self._events.get_plugin(label)
            for label in self._members
            if label != reply.model
        ]

        hear = self._events.subset_hook_caller("reply_received", others)
        hear(request=request, reply=reply)

        if request.asks_designs:
            asked = (request.brief.generation, request.brief.agent)
            self._replies[asked].append(reply)

    @hookimpl
    def generation_finished(self, generation: Generation) -> None:
        """Count what each agent's answers earned. Nothing is counted before, so that a resumed run deals alike."""
        earned: dict[int, float] = {}
        for evaluation in generation.evaluations:
            agent = evaluation.candidate.agent
            earned[agent] = max(earned.get(agent, 0.0), evaluation.reward)

        for index, agent in sorted(self._replies):
            replies = self._replies.pop((index, agent))
            free = any(reply.error is None and not reply.cost_usd for reply in replies)
            cost = None if free else fsum(reply.cost_usd or 0.0 for reply in replies)
            self._dealer.hear(replies[-1].model, earned.get(agent, 0.0), cost)


class Dealer:
    """Ranks members by Thompson sampling for bandits with a budget.

    Y. Xia et al., "Thompson Sampling for Budgeted Multi-armed Bandits", IJCAI 2015: of each member the mean reward is
    drawn from its Beta posterior, and the highest ratio of reward and cost goes first. The cost is not drawn, but the
    mean of what was paid, since a model's calls cost much alike. A reward between 0 and 1 counts as that fraction of a
    success. If the cost of a member that has answered is unknown or 0, rewards alone count.

    A draw depends on the seed, the request and what was heard, in any order: not on when it is made.
    """

    def __init__(self, members: Sequence[str], seed: int) -> None:
        """Begin with no answers heard.

        Args:
            members: their labels, in the order in which they have their first request.
            seed: of the draws.
        """
        self._seed = seed
        self._rewards: dict[str, list[float]] = {name: [] for name in members}
        self._costs: dict[str, list[float]] = {name: [] for name in members}
        self._priced = True

    def hear(
        self,
        member: str,
        reward: float,
        cost_usd: float | None,
    ) -> None:
        """Take what an answer earned, and its cost; None: it is not known. An answer that failed may have cost 0.

        Args:
            member: that answered.
            reward: what the best of the answer's candidates earned, 0..1.
            cost_usd: of the answer, and of those that were asked for again.
        """
        self._rewards[member].append(reward)
        if cost_usd:
            self._costs[member].append(cost_usd)

        self._priced &= cost_usd is not None

    def ranking(self, request: Request) -> list[str]:
        """Order the members for a request, the first choice first.

        Members that have not answered yet come first, each for another agent. A critique earns nothing: there only the
        draw counts.
        """
        brief = request.brief
        numbers = [
            self._seed,
            brief.generation,
            brief.agent,
            int(not request.asks_designs),
        ]
        rng = np.random.default_rng(numbers)

        costs: dict[str, float] = {}
        default = 1.0
        if self._priced and any(self._costs.values()):
            costs = {name: fmean(paid) for name, paid in self._costs.items() if paid}
            default = fmean(costs.values())  # of a member that nothing was paid to yet

        draws = {}
        for name, rewards in self._rewards.items():
            earned = fsum(rewards)
            worth = rng.beta(1 + earned, 1 + len(rewards) - earned)
            draws[name] = worth / costs.get(name, default)

        ranked = sorted(draws, key=lambda name: -draws[name])
        untried = [name for name, rewards in self._rewards.items() if not rewards]

        if brief.agent < len(untried) and request.asks_designs:
            ranked.sort(key=lambda name: name != untried[brief.agent])

        return ranked
