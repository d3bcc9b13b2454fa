"""Define conditions, trials and what a fitness makes of them.

A trial is one candidate in one condition. It is complete when it is made (`core.simulation.play`), and nothing is tried
twice (`core.search.trials`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from typing import Any, Literal, NamedTuple, Protocol, TypeVar

import numpy as np

from core.design import Candidate, Tool
from core.errors import Refusal
from core.scene import Scene
from core.task import Task
from core.values.efforts import Effort, Held, holds, least_share
from core.values.jobs import Outcome, RolloutSettings
from core.values.margins import Margin
from core.values.motions import Motion
from core.values.observations import Observation
from core.values.torques import TorqueShare, find_hardest

TIE = 0.005
"""The default of ``evolution.tie``, see `best_first`."""

ROOM_TIE = 0.02
"""Shares of room that differ by no more count as equal."""

NOTHING = 0.0005
"""A reward below it is shown as 0.000, and has its cause said as one of 0 has."""

Status = Literal["ok", "rejected", "failed"]
T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)
Rewards = dict[str, tuple[float, ...]]
"""What a candidate earned in several layouts, by engine."""


class Part(Protocol[T_co]):
    """A part by its name and settings (`core.plugins.PluginPart`): small, hashable and picklable."""

    @property
    def name(self) -> str: ...

    @property
    def settings(self) -> tuple[tuple[str, Any], ...]: ...

    def shared(self) -> T_co:
        """Return the part, which a process makes once."""

    def declared(self, name: str, default: Any) -> Any:
        """Return an attribute of the part's class, without making the part."""


class Change(Protocol):
    """A perturbation of scenes and tools: hashable and picklable."""

    @property
    def number(self) -> int: ...

    def __call__(self, scene: Scene) -> Scene:
        """Return the perturbed scene, the same each time."""

    def perturb_tool(self, tool: Tool) -> Tool:
        """Return the perturbed tool, the same each time."""


class Examiner(Protocol):
    """What a fitness adds to trials, where they are played: hashable and picklable."""

    def refuse(self, condition: Condition, candidate: Candidate) -> str | None:
        """Say what speaks against a candidate before it is played; None: nothing does."""

    def examine(
        self, condition: Condition, candidate: Candidate, trial: Trial
    ) -> Trial:
        """Return a trial that was played, with what is found out beside it."""


@dataclass(frozen=True)
class Making:
    """Whether a design's tool can be made.

    Attributes:
        possible: whether it can; None: it is not known.
        words: in how many pieces and hours, or else why not.
        problem: why not, alone; empty: it can.
    """

    possible: bool | None
    words: str
    problem: str = ""


class Where(NamedTuple):
    """What distinguishes the trials of a candidate; it is stored with each."""

    task: str  # its name
    engine: str  # its name, as the fitness shows it
    layout: int  # the seed of the layout
    change: int | None = (
        None  # the number of the scene's perturbation; None: the scene as it is
    )


TrialKey = tuple[str, Where]
"""What distinguishes the trials of a run: a design's content, of its plan for the condition's task alone, and where."""


@dataclass(frozen=True)
class Condition:
    """Where and how a candidate is tried.

    Attributes:
        task: makes the task.
        sim: makes the engine, a `core.interfaces.Simulator`.
        layout: the seed of the layout.
        settings: how plans are executed.
        change: perturbs the scene; None: it is as the task has it.
        engine: the name under which the engine is shown; empty: its own.
        examiner: looks at candidates before and after they are played; None: nobody does.
    """

    task: Part[Task]
    sim: Part[Any]
    layout: int = 0
    settings: RolloutSettings = field(default_factory=RolloutSettings)
    change: Change | None = None
    engine: str = ""
    examiner: Examiner | None = None

    @property
    def batch(self) -> int:
        """The number of candidates that the engine takes at once (`Simulator.batch`)."""
        return int(self.sim.declared("batch", 1))

    @property
    def where(self) -> Where:
        """Return what distinguishes the condition from a run's others."""
        number = None if self.change is None else self.change.number
        return Where(
            self.task.shared().name, self.engine or self.sim.name, self.layout, number
        )

    def scene(self) -> Scene:
        """Make the scene: the task's layout, perturbed if this is asked for."""
        scene = self.task.shared().scene(self.layout)
        return scene if self.change is None else self.change(scene)

    def perturb(self, candidate: Candidate) -> Candidate:
        """Return a candidate as it is played: with its plan for the task, its tool perturbed if this is asked for."""
        played = candidate.of(self.where.task)
        if self.change is None or played.tool is None:
            return played
        return replace(played, tool=self.change.perturb_tool(played.tool))


@dataclass(frozen=True)
class Figure:
    """A number that is measured of each rollout that comes to its end, and kept in `Trial.measured`.

    A plugin offers one under its name by the hook `figures`. For example, the time that the motion takes::

        MOTION_S = Figure(lambda task, motion, outcome: motion.trajectory.duration, "time (s)", digits=1)

    Attributes:
        measure: computes it of the task, the motion as it was played, and what the engine made of it.
        column: the head of its column in reports, with the unit; empty: it has none.
        digits: after the point, in reports.
        words: what it is, for a model that is told of an elite's; empty: models aren't.
        less_is_better: whether of two designs that earn alike the one with less is better (``fitness.tie_by``).
    """

    measure: Callable[[Task, Motion, Outcome], float]
    column: str = ""
    digits: int = 2
    words: str = ""
    less_is_better: bool = True


@dataclass(frozen=True)
class Trial:
    """What came of one candidate in one condition.

    Attributes:
        where: the condition.
        candidate: the id of the candidate that was played; others with the same tool and plan share its trials.
        status: ``ok``; ``rejected``: the design breaks a rule there; or ``failed``: the rollout failed.
        reward: 0..1; 0 where it was rejected or failed.
        reason: why it was rejected, failed, or earns nothing; or empty.
        refusals: why it was rejected, for programs, as far as there are codes; the store does not keep it.
        solved: whether it did what the task wants (`Task.is_solved`).
        moved_m: the distance of each free body's end from its start.
        warnings: what else is to be said of it.
        objections: what `Condition.examiner` found to speak against the candidate.
        margins: how far it stayed from the task's limits, the least first; none: the task says none.
        goals: where several goals count, how far each was fulfilled, 0..1, by name.
        touch_m: see `Observation.touch_m`; None: not observed, or nothing was touched.
        outcome: what became of the goal's bodies, and of which; empty: not observed.
        observation: what was observed of the rollout; None: nothing.
        measured: of each `Figure` what it was, by name; empty: nothing was played to its end.
        figures: what `Condition.examiner` found out, by name.
        torques: the greatest share of its torque limit that each joint of the arm used, by name; empty: the engine does
            not say.
    """

    where: Where
    candidate: str = ""
    status: Status = "ok"
    reward: float = 0.0
    reason: str = ""
    solved: bool = False
    moved_m: dict[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    objections: tuple[str, ...] = ()
    margins: tuple[Margin, ...] = ()
    goals: tuple[tuple[str, float], ...] = ()
    touch_m: float | None = None
    outcome: str = ""
    observation: Observation | None = None
    measured: dict[str, float] = field(default_factory=dict)
    figures: dict[str, float] = field(default_factory=dict)
    torques: dict[str, float] = field(default_factory=dict)
    refusals: tuple[Refusal, ...] = field(default=(), compare=False)

    @property
    def task(self) -> str:
        return self.where.task

    @property
    def engine(self) -> str:
        return self.where.engine

    @property
    def layout(self) -> int:
        return self.where.layout

    def figure(self, name: str) -> float:
        """Return what a `Figure` was; nan: it is not known, as where nothing was played to its end."""
        return self.measured.get(name, float("nan"))

    @property
    def distance_m(self) -> float:
        """The way of the end-effector's origin from home through all waypoints; nan: it is not known."""
        return self.figure("distance_m")

    @property
    def motion_s(self) -> float | None:
        """The time of the motion, s; None: nothing was played to its end."""
        return self.measured.get("motion_s")

    @property
    def cause(self) -> str:
        """Why it earns what it earns: the reason, or what became of the goal's bodies; or empty."""
        return self.reason or self.outcome


@dataclass(frozen=True)
class Score:
    """What a fitness makes of a candidate's trials.

    Attributes:
        reward: 0..1, of all trials together.
        figures: further numbers, by name.
        shown: the number of the trial that stands for all.
        warnings: what is to be said beside the warnings of the trial that is shown.
        reason: why the reward is less than the trials earned; or empty.
        cost: the figure that the user named to decide between those that earn alike, less is better; None: room and
            distance do.
    """

    reward: float
    figures: Mapping[str, float] = field(default_factory=dict)
    shown: int = 0
    warnings: tuple[str, ...] = ()
    reason: str = ""
    cost: float | None = None


@dataclass(eq=False)
class Tally:
    """What came of a candidate in the layouts of a race, by their numbers; it grows while the race goes on.

    Attributes:
        trials: in each layout.
        losses: what it missed of a reward of 1 in each layout, by engine.
    """

    trials: dict[int, tuple[Trial, ...]] = field(default_factory=dict)
    losses: dict[int, dict[str, float]] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """In how many layouts it was tried."""
        return len(self.losses)

    @property
    def loss(self) -> float:
        """What it lost in all layouts, in the engine where that is most."""
        return self.loss_in(self.losses)

    def loss_in(self, numbers: Iterable[int]) -> float:
        """What it lost in the layouts of these numbers, in the engine where that is most."""
        by_engine: dict[str, float] = {}
        for number in numbers:
            for engine, lost in self.losses[number].items():
                by_engine[engine] = by_engine.get(engine, 0.0) + lost

        return max(by_engine.values(), default=0.0)

    @classmethod
    def of_trials(cls, trials: Iterable[Trial]) -> Tally:
        """Tally the trials of a candidate in further layouts, as they are stored: each by its mean in an engine."""
        groups: dict[tuple[int, int | None], list[Trial]] = {}
        for trial in trials:
            place = (trial.layout, trial.where.change)
            groups.setdefault(place, []).append(trial)

        tally = cls()
        for number, group in enumerate(groups.values()):
            losses = {}
            for engine, rewards in rewards_by_engine(group).items():
                there = [trial for trial in group if trial.engine == engine]
                losses[engine] = count_lost(float(np.mean(rewards)), there, TIE)

            tally.trials[number] = tuple(group)
            tally.losses[number] = losses

        return tally

    def count_held(self, first: int = 0) -> Held:
        """Count the layouts from a number on in which it was solved, in each engine."""
        layouts = [self.trials[number] for number in self.trials if number >= first]
        held = sum(all(trial.solved for trial in trials) for trials in layouts)
        return Held(held, len(layouts))

    def in_order(self) -> tuple[Trial, ...]:
        """Return all trials, in the order of the layouts."""
        return tuple(
            trial for number in sorted(self.trials) for trial in self.trials[number]
        )


@dataclass(frozen=True, eq=False)
class Evaluation:
    """A candidate, its trials, and their score.

    Attributes:
        candidate: what was tried.
        trials: in the order of the conditions; none: the candidate breaks a rule in any condition. Where it was clearly
            behind others, some are missing.
        score: what the fitness made of the trials.
        finals: what came of it in further layouts.
    """

    candidate: Candidate
    trials: tuple[Trial, ...] = ()
    score: Score = Score(0.0)
    finals: Tally = field(default_factory=Tally)

    @property
    def shown(self) -> Trial | None:
        """The trial that stands for all; None: there is none."""
        return self.trials[self.score.shown] if self.trials else None

    @property
    def status(self) -> Status:
        """The status of the trial that is shown; without trials ``rejected``."""
        return self.shown.status if self.shown is not None else "rejected"

    @property
    def solved(self) -> bool:
        """Whether all its trials were solved."""
        return bool(self.trials) and all(trial.solved for trial in self.trials)

    @property
    def holds(self) -> bool:
        """Whether nearly all its trials were solved in each engine (`holds`)."""
        by_engine: dict[str, list[bool]] = {}
        for trial in self.trials:
            by_engine.setdefault(trial.engine, []).append(trial.solved)

        shares = [sum(solved) / len(solved) for solved in by_engine.values()]
        return holds(min(shares, default=0.0))

    @property
    def reason(self) -> str:
        """Why it was rejected, failed, or earns nothing; or empty."""
        if self.shown is None:
            return self.candidate.problem or ""
        return self.score.reason or self.shown.reason

    @property
    def refusals(self) -> tuple[Refusal, ...]:
        """Why it was rejected, for programs, as far as there are codes."""
        if self.shown is None:
            return self.candidate.refusals
        return self.shown.refusals

    @property
    def why_nothing(self) -> str:
        """Why it earns nothing, if it does, as far as that is known; or empty."""
        if self.reward >= NOTHING:
            return ""
        return self.reason or (self.shown.cause if self.shown is not None else "")

    @property
    def reward(self) -> float:
        """0..1, of all trials together."""
        return self.score.reward

    @property
    def figures(self) -> Mapping[str, float]:
        """Further numbers of the fitness, by name."""
        return self.score.figures

    @cached_property
    def distance_m(self) -> float:
        """The mean way of the end-effector's origin over the trials that were played; nan: there is none."""
        return mean_figure(self.trials, "distance_m")

    @property
    def cost(self) -> float:
        """What decides at last between those that earn alike: less is better, and nan is the worst."""
        return self.distance_m if self.score.cost is None else self.score.cost

    @property
    def room(self) -> float:
        """How much room it leaves, as `room_left`, as far as that decides."""
        return self.room_left if self.score.cost is None else 0.0

    @property
    def room_left(self) -> float:
        """How much room it leaves to the limit that it came nearest to, -1..1; 0: the task says no limits.

        What earns nothing for a reason of its own, such as solids that passed through each other, leaves none at all.
        """
        if self.reason:
            return -1.0

        least = self.least_margin
        return 0.0 if least is None else least.margin

    @property
    def warnings(self) -> tuple[str, ...]:
        """What else is to be said of it."""
        found = self.score.warnings
        if self.shown is not None:
            found = (*self.shown.warnings, *self.shown.objections, *found)

        return found

    @property
    def observation(self) -> Observation | None:
        """What was observed of the trial that is shown; None: nothing."""
        return self.shown.observation if self.shown is not None else None

    @property
    def combined(self) -> bool:
        """Whether it has several trials."""
        return len(self.trials) > 1 or bool(self.finals.trials)

    @property
    def tasks(self) -> tuple[str, ...]:
        """The names of the tasks in which it was tried."""
        return tuple(dict.fromkeys(trial.task for trial in self.trials))

    @property
    def hardest(self) -> TorqueShare | None:
        """The joint that used most of its torque in one of its trials; None: the engine does not say."""
        found = [find_hardest(trial.torques) for trial in self.trials]
        known = [share for share in found if share is not None]
        return max(known, key=lambda share: share.share, default=None)

    @property
    def least_margin(self) -> Margin | None:
        """The least margin of its trials; None: the task says none."""
        least = [trial.margins[0] for trial in self.trials if trial.margins]
        return min(least, key=lambda margin: margin.margin, default=None)

    @property
    def effort(self) -> Effort | None:
        """What the design costs, over its trials; None: none came to its end, or there is no tool."""
        times = [trial.motion_s for trial in self.trials if trial.motion_s is not None]
        if not times or self.candidate.tool is None:
            return None
        margins = [trial.margins[0].margin for trial in self.trials if trial.margins]
        least = [max(margin, 0.0) for margin in margins]
        return Effort(
            motion_s=float(np.mean(times)),
            mass_kg=self.candidate.tool.mass,
            margin=float(np.mean(least)) if least else None,
        )

    @property
    def by_engine(self) -> Rewards:
        """The rewards of its trials in each engine."""
        return rewards_by_engine(self.trials)

    @property
    def rollouts(self) -> int:
        """The number of rollouts that were played for it, in further layouts too."""
        trials = (*self.trials, *self.finals.in_order())
        return count_rollouts(self.candidate.id, trials)

    @property
    def layouts(self) -> int:
        """In how many layouts or changes it was tried in the search."""
        return len({(trial.layout, trial.where.change) for trial in self.trials})

    @property
    def mean(self) -> float:
        """What it earned on the mean over all layouts that it was tried in, in the search and further ones."""
        count = self.layouts + self.finals.count
        return 1 - self._lost / count if count else self.reward

    @property
    def assured(self) -> float:
        """What it earns in another layout at least, by what it earned in all that it was tried in.

        So little that is known counts for little: 3 layouts of 3 assure less than 10 of 13 (`least_share`).
        """
        count = self.layouts + self.finals.count
        return least_share(count - self._lost, self._lost)

    @property
    def _lost(self) -> float:
        """What it missed of a reward of 1 in all layouts."""
        return self.layouts * (1 - self.reward) + self.finals.loss

    def in_task(self, task: str) -> Evaluation:
        """Return what the candidate earned in one of its tasks, as the evaluation of its plan for that task alone."""
        if task not in self.figures:
            return replace(self, candidate=self.candidate.of(task))
        trials = tuple(trial for trial in self.trials if trial.task == task)
        shown = min(
            range(len(trials)),
            key=lambda n: (trials[n].status != "ok", trials[n].reward),
        )
        return Evaluation(
            self.candidate.of(task), trials, Score(self.figures[task], shown=shown)
        )


def rewards_by_engine(trials: Iterable[Trial]) -> Rewards:
    """Return the rewards in each engine, in the order of the trials."""
    rewards: Rewards = {}
    for trial in trials:
        rewards[trial.engine] = (*rewards.get(trial.engine, ()), trial.reward)
    return rewards


def count_lost(reward: float, trials: Iterable[Trial], slack: float) -> float:
    """Compute what a candidate missed of a reward of 1 in a layout; nothing where it solved the task within ``slack``.

    Args:
        reward: that it earned there.
        trials: for which it earned that.
        slack: what misses 1 by no more counts as 1, if it is solved.
    """
    solved = all(trial.solved for trial in trials)
    lost = 1.0 - reward
    return 0.0 if solved and lost <= slack else lost


def mean_figure(trials: Iterable[Trial], name: str) -> float:
    """Return the mean of a figure over the trials that were played to their end; nan: there is none."""
    found = [trial.figure(name) for trial in trials if trial.status == "ok"]
    return float(np.mean(found)) if found else float("nan")


def summarise_rewards(rewards: Sequence[float]) -> dict[str, Any]:
    """Summarise rewards, as JSON: their mean, standard deviation, and the rewards."""
    return {
        "mean": float(np.mean(rewards)),
        "std": float(np.std(rewards)),
        "rewards": list(rewards),
    }


def count_rollouts(candidate: str, trials: Iterable[Trial]) -> int:
    """Count the rollouts that were played for the candidate of an id: not those that it shares with another one."""
    return sum(
        trial.status != "rejected" and trial.candidate == candidate for trial in trials
    )


class Criterion(NamedTuple):
    """A step of the order in which designs are ranked.

    Attributes:
        value: of a design; more is better, and nan is the least.
        words: what the better one has, for prompts and messages; empty: prompts say it elsewhere.
        tie: values within it of the highest count as equal.
    """

    value: Callable[[Evaluation], float]
    words: str = ""
    tie: float = 0.0


def rank(
    evaluations: Iterable[Evaluation], criteria: Sequence[Criterion]
) -> list[Evaluation]:
    """Sort designs by one criterion after the other, the best first.

    What is within a criterion's tie of the highest counts as equal, and the next criterion decides there. What is left
    is sorted by the same rule, and so on. Designs that are equal in all keep their order.
    """
    if not criteria:
        return list(evaluations)

    criterion, *further = criteria
    valued = [(criterion.value(e), e) for e in evaluations]
    known = [(-np.inf if np.isnan(value) else value, e) for value, e in valued]
    known.sort(key=lambda pair: -pair[0])

    groups: list[list[Evaluation]] = []
    highest = np.inf
    for value, evaluation in known:
        if not groups or value < highest - criterion.tie:
            groups.append([])
            highest = value
        groups[-1].append(evaluation)

    return list(chain.from_iterable(rank(group, further) for group in groups))


WHAT_DECIDES = (
    Criterion(lambda design: float(design.solved)),
    Criterion(lambda design: design.room, "the most room to its limits", ROOM_TIE),
    Criterion(lambda design: -design.cost, "the shortest way"),
)
"""What decides between designs that earn alike, in this order; all who choose between designs ask `best_first`.

A figure that the user names (``fitness.tie_by``) decides in place of room and way.
"""


BY_REWARD = (Criterion(lambda design: design.reward), *WHAT_DECIDES)
"""The order of designs of which none was tried in further layouts, without ties of rewards."""


def best_first(evaluations: Iterable[Evaluation], tie: float = TIE) -> list[Evaluation]:
    """Sort the evaluations with status ``ok``, the best first: by reward, then by `WHAT_DECIDES`.

    Where some were tried in further layouts, what each earns in another one at least counts (`Evaluation.assured`), and
    then its mean. Designs that are equal in all are sorted by `Candidate.key`.

    Args:
        evaluations: of any candidates.
        tie: the largest difference from the highest reward that counts as none.
    """
    tried = [evaluation for evaluation in evaluations if evaluation.status == "ok"]
    tried.sort(key=lambda evaluation: evaluation.candidate.key)
    raced = any(evaluation.finals.count for evaluation in tried)

    earned = [Criterion(lambda design: design.reward, tie=tie)]
    if raced:
        earned = [
            Criterion(lambda design: design.assured, tie=tie),
            Criterion(lambda design: design.mean, tie=tie),
        ]

    return rank(tried, (*earned, *WHAT_DECIDES))


def best_tools(ranking: Iterable[Evaluation]) -> list[Evaluation]:
    """Keep the first evaluation of each tool; those of a curve count as one."""
    found: dict[str, Evaluation] = {}
    for evaluation in ranking:
        found.setdefault(evaluation.candidate.idea, evaluation)
    return list(found.values())
