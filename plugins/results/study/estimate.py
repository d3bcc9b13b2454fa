"""Estimate what runs take before they start: requests, rollouts, time and dollars."""

from __future__ import annotations

import math
import operator
import os
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass
from typing import Any

from omegaconf import DictConfig

from core.config.compose import load
from core.interfaces import VLM, Estimate
from core.plugins import installed
from core.search.assignment import Team
from core.search.builder import build_asking, estimate_request
from core.search.finalists import rollouts_in
from core.store.reader import StoredRun
from core.support.cli import print_table, say
from plugins.results.pages.runs import AnyRun, FinishedRun, LeftOutRun
from plugins.results.study.study_files import StudyRun, is_done, read_state

# Of a language model's answer; measured of an earlier embedded designer's designs, as text.
TOOL_TOKENS = 2000
PLAN_TOKENS = 350

START_S = 10.0  # of a run, on one core: imports, scene, pictures
ROLLOUT_S = 0.5  # on one core, until runs of the study say better
ANSWER_S = 120.0  # for all answers of a generation, which come side by side


@dataclass(frozen=True)
class Need:
    """What one or more runs take.

    Attributes:
        requests: to the model, without those that send designs back.
        rollouts: at most.
        deciding: of these, those that decide between the best.
        busy_s: seconds of one core.
        wait_s: seconds for answers of a model.
        usd: US dollars; infinite: the model has no known price.
    """

    requests: int = 0
    rollouts: int = 0
    deciding: int = 0
    busy_s: float = 0.0
    wait_s: float = 0.0
    usd: float = 0.0

    def __add__(self, other: Need) -> Need:
        return Need(*map(operator.add, astuple(self), astuple(other)))


@dataclass(frozen=True)
class Outlook:
    """What a study will take.

    Attributes:
        runs: all of them.
        needs: of those that are not at their end.
        jobs: how many go on at a time, which wait for answers side by side.
        cores: that they share.
    """

    runs: Sequence[StudyRun]
    needs: Mapping[StudyRun, Need]
    jobs: int
    cores: int

    @property
    def whole(self) -> Need:
        return sum(self.needs.values(), Need())

    def hours(self, need: Need) -> float:
        """Return how long this takes."""
        return (need.busy_s / self.cores + need.wait_s / self.jobs) / 3600

    def show(self) -> None:
        """Print what each method takes, and all together."""
        rows = []
        for method in dict.fromkeys(run.method for run in self.runs):
            runs = [run for run in self.runs if run.method == method]
            missing = [self.needs[run] for run in runs if run in self.needs]
            rows.append(
                self._row(method, len(runs), len(missing), sum(missing, Need()))
            )

        rows.append(self._row("all", len(self.runs), len(self.needs), self.whole))
        head = ("method", "runs", "to do", "requests", "rollouts", "hours", "dollars")
        print_table(head, rows, head[1:])
        if self.whole.deciding:
            say(
                f"up to {self.whole.deciding:,} of these rollouts decide between the best, in a generation and at "
                "the end: seconds of the machine, which budget.elite_s and budget.final_s set; 0: none"
            )

    def _row(self, method: str, runs: int, todo: int, need: Need) -> tuple[str, ...]:
        usd = "unknown" if math.isinf(need.usd) else f"{need.usd:,.2f}"
        numbers = (runs, todo, need.requests, need.rollouts)
        hours = f"{self.hours(need):.1f}"
        return (method, *(f"{number:,}" for number in numbers), hours, usd)


def look_ahead(runs: Sequence[StudyRun], jobs: int) -> Outlook:
    """Estimate the runs that are not at their end, ``jobs`` at a time.

    Raises:
        UserError: the words of a run can't be used.
    """
    states = {run: read_state(run) for run in runs}
    done = [state for state in states.values() if isinstance(state, FinishedRun)]
    rollouts = sum(run.rollouts for run in done)
    seconds = sum(run.figures.wall_time_s * workers(run.config) for run in done)
    rollout_s = seconds / rollouts if rollouts else None

    configs: dict[tuple[str, str], DictConfig] = {}
    demands: dict[str, _Demand] = {}  # of each method, on the first task that comes
    needs = {}
    for run, state in states.items():
        if is_done(state):
            continue

        place = (run.method, run.task)
        if place not in configs:
            configs[place] = load("config", run.words)
        if run.method not in demands:
            demands[run.method] = _measure(configs[place])

        needs[run] = _estimate(configs[place], demands[run.method], state, rollout_s)

    power = min(cores(), jobs * workers(load("config", runs[0].words)))

    return Outlook(runs, needs, jobs, power)


@dataclass(frozen=True)
class _Demand:
    """What a candidate of a method takes, and a request.

    Attributes:
        conditions: in which a candidate is tried.
        given: the tool is given, so that plans alone are asked for.
        finals: rollouts to decide between the best, in a generation and at the end.
        prompt: the size and the prices of a request; None: it costs nothing.
    """

    conditions: int
    given: bool
    finals: tuple[int, int]
    prompt: Estimate | None

    def price(self, tools: int, plans: int) -> float:
        """Return the dollars of a request and its answer; infinite: not known."""
        if self.prompt is None:
            return 0.0

        sent = self.prompt.usd_per_prompt_token
        answered = self.prompt.usd_per_completion_token
        if sent is None or answered is None:
            return math.inf

        answer = tools * (TOOL_TOKENS + PLAN_TOKENS * plans)
        return self.prompt.prompt_tokens * sent + answer * answered


def _estimate(
    cfg: DictConfig, demand: _Demand, state: AnyRun | None, rollout_s: float | None
) -> Need:
    """Estimate a run, or what is left of one that has begun.

    Args:
        cfg: its configuration.
        demand: of its method.
        state: what is known of it.
        rollout_s: of one core, as runs of the study took; None: none is there.
    """
    budget = cfg.budget
    generations = budget.n_iteration + 1
    tools = 1 if demand.given else budget.n_tool
    candidates = budget.n_agent * tools * budget.n_action * generations
    candidates += cfg.evolution.get("refine", 0)
    often, last = demand.finals
    deciding = often * generations + last
    rollouts = candidates * demand.conditions + deciding
    requests = budget.n_agent * generations
    if isinstance(state, LeftOutRun) and state.status == "unfinished":
        store = StoredRun(state.folder)
        answered = sum(request.purpose == "designs" for request, _ in store.answers())
        requests = max(requests - answered, 0)
        rollouts = max(rollouts - len(store.trials()), 0)

    busy_s = START_S + rollouts * (rollout_s or ROLLOUT_S)
    waits = reads_words(cfg) and rollout_s is None
    wait_s = ANSWER_S * requests / budget.n_agent if waits else 0.0
    usd = requests * demand.price(tools, budget.n_action)

    return Need(requests, rollouts, min(deciding, rollouts), busy_s, wait_s, usd)


def _measure(cfg: DictConfig) -> _Demand:
    """Find what a candidate and a request of a configuration take, without a call of its model."""
    designer, fitness = build_asking(cfg)
    budget = designer.assignment.budget
    finals = (0, 0)
    if next(iter(fitness.finals()), None) is not None:
        elites = 0 if fitness.finals_check else rollouts_in(fitness, budget.elite_s)
        finals = (elites, rollouts_in(fitness, budget.final_s))

    prompt = None
    if reads_words(cfg):
        (request, *_) = designer.requests(0, Team([0]))
        _, prompt = estimate_request(cfg, request)

    given = designer.assignment.given is not None
    return _Demand(len(fitness.conditions()), given, finals, prompt)


def reads_words(cfg: DictConfig) -> bool:
    """Report whether the model of a configuration reads what it is told, as language models do."""
    factory = installed().factory("vlm", cfg.vlm.name)
    return bool(getattr(factory, "sees", VLM.sees))


def workers(cfg: Mapping[Any, Any]) -> int:
    """Return how many workers a run with this configuration has on this machine."""
    return int(cfg["executor"].get("workers") or cores())


def cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))

    return os.cpu_count() or 1
