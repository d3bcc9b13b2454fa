"""Define tools, candidates (a tool with an action plan) and their evaluations, and how these are ranked."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, TypeVar

import numpy as np

from core.values.efforts import Effort, holds
from core.values.margins import Margin
from core.values.observations import Observation
from core.values.plans import ActionPlan, Waypoints, digest
from core.values.tools import GRIPPER_MOUNTS as GRIPPER_MOUNTS
from core.values.tools import RIGID_MOUNT as RIGID_MOUNT
from core.values.tools import TOOL_FRICTION as TOOL_FRICTION
from core.values.tools import Bearer as Bearer
from core.values.tools import Component as Component
from core.values.tools import ConvexPart as ConvexPart
from core.values.tools import DesignError as DesignError
from core.values.tools import Tool as Tool
from core.values.tools import ToolJoint as ToolJoint

TIE = 0.005  # the default of ``evolution.tie``, see `ranked`

Status = Literal["ok", "rejected", "failed"]
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Candidate:
    """A tool and one action plan, which are tried in one rollout; or a plan for each of several tasks (`TaskPlans`).

    An array (N, 6) or (N, 7) as ``plan`` stands for literal `Waypoints`.
    ``problem`` says which rule the design breaks, so that it can't be tried; then ``tool`` may be None and ``plan``
    empty. `id` is made of ``generation``, ``agent``, ``strategy`` and ``action``. ``varied``: a search changed the
    numbers of another candidate by a little, on purpose.
    """

    tool: Tool | None
    plan: ActionPlan
    generation: int = 0
    agent: int = 0
    strategy: int = 0
    action: int = 0
    strategy_name: str = ""
    strategy_description: str = ""
    action_description: str = ""
    parents: tuple[str, ...] = ()
    problem: str | None = None
    varied: bool = False

    def __post_init__(self) -> None:
        if isinstance(self.plan, np.ndarray):  # for short: literal waypoints
            object.__setattr__(self, "plan", Waypoints(self.plan))

    @property
    def key(self) -> tuple[int, int, int, int]:
        """Sorts candidates in one order, however they arrived."""
        return (self.generation, self.agent, self.strategy, self.action)

    @property
    def id(self) -> str:
        """For example ``g0-a3-s1-p7``: generation, agent, strategy, plan."""
        return "g{}-a{}-s{}-p{}".format(*self.key)

    @cached_property
    def content(self) -> str:
        """A hash of what is tried: equal where tools and plans are equal to the last bit, in every process."""
        return digest((self.tool and self.tool.content, self.plan.content))

    def of(self, task: str) -> Candidate:
        """Return the candidate with its plan for a task alone; without one, that is its problem."""
        plan = self.plan.of(task)
        if plan is self.plan:
            return self
        return replace(self, problem=self.problem or plan) if isinstance(plan, str) else replace(self, plan=plan)


@dataclass(frozen=True)
class Trial:
    """One trial of a candidate: a rollout in one engine and one scene.

    Attributes:
        engine: its name, as the fitness shows it.
        layout: the seed of the layout.
        change: the number of the scene's perturbation; None: the scene as it is.
        status: as that of an `Evaluation`.
        reward: what it earned; 0 where it was rejected or failed.
        reason: why, as that of an `Evaluation`.
        touch_m: see `Observation.touch_m`; None: not observed, or nothing was touched.
        outcome: what became of the goal's bodies, and of which; empty: not observed.
        observation: of several trials only the one that is shown has it.
        margins: how far it stayed from the task's limits, the least first; none: the task says none.
        motion_s: the time of the motion, s; None: nothing was played to its end.
        goals: where several goals count, how far each was fulfilled, 0..1, by name.
        task: its name, where a candidate has several; else empty.
        tried_as: the id of the candidate whose trial it was, where another one has the same plan for the task.
    """

    engine: str = ""
    layout: int = 0
    change: int | None = None
    status: Status = "ok"
    reward: float = 0.0
    reason: str = ""
    touch_m: float | None = None
    outcome: str = ""
    observation: Observation | None = None
    margins: tuple[Margin, ...] = ()
    motion_s: float | None = None
    goals: tuple[tuple[str, float], ...] = ()
    task: str = ""
    tried_as: str = ""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The outcome of trying a candidate. Without a rollout, numbers are nan.

    Attributes:
        candidate: what was tried.
        status: ``ok``; ``rejected``: the design breaks a rule; or ``failed``: the rollout failed.
        reward: 0..1, of one trial or of several together.
        distance_m: the way of the end-effector's origin from home through all waypoints.
        reason: why it was rejected, failed, or earns nothing; or empty.
        ik_error_m: with ``ik_error_rad`` the largest misses of the inverse kinematics along the plan.
        tracking_error_rad: the largest lag of a joint behind its target.
        moved_m: the distance of each free body's end from its start.
        warnings: what else is to be said of it.
        trials: in their order.
        combined: whether a fitness made it of ``trials``; else it is that of the only one.
        figures: further numbers of a fitness, by name.
        final: its trials as a finalist: of each the engine, its number there, and the reward.
    """

    candidate: Candidate
    status: Status
    reward: float = 0.0
    distance_m: float = float("nan")
    reason: str = ""
    ik_error_m: float = float("nan")
    ik_error_rad: float = float("nan")
    tracking_error_rad: float = float("nan")
    moved_m: dict[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    trials: tuple[Trial, ...] = ()
    combined: bool = False
    figures: Mapping[str, float] = field(default_factory=dict)
    final: tuple[tuple[str, int, float], ...] = ()

    @property
    def least_margin(self) -> Margin | None:
        """The least margin of its trials; None: the task says none."""
        margins = [margin for trial in self.trials for margin in trial.margins]
        return min(margins, key=lambda margin: margin.margin, default=None)

    @property
    def effort(self) -> Effort | None:
        """What the design costs, over its trials; None: none came to its end, or there is no tool."""
        times = [trial.motion_s for trial in self.trials if trial.motion_s is not None]
        if not times or self.candidate.tool is None:
            return None
        least = [max(min(m.margin for m in trial.margins), 0.0) for trial in self.trials if trial.margins]
        return Effort(float(np.mean(times)), self.candidate.tool.mass, float(np.mean(least)) if least else None)

    @property
    def holds(self) -> bool:
        """Whether its trials hold in each engine (`core.values.efforts.holds`)."""
        return bool(self.trials) and holds(min(float(np.mean(own)) for own in self.by_engine.values()))

    @property
    def shown(self) -> Trial | None:
        """The trial that was observed; None: none was."""
        return next((trial for trial in self.trials if trial.observation is not None), None)

    @property
    def observation(self) -> Observation | None:
        """What was observed of its rollout, of several that of the one that is shown; None: nothing."""
        return self.shown.observation if self.shown is not None else None

    @property
    def by_engine(self) -> dict[str, list[float]]:
        """The rewards of its trials in each engine."""
        rewards: dict[str, list[float]] = {}
        for trial in self.trials:
            rewards.setdefault(trial.engine, []).append(trial.reward)
        return rewards

    @property
    def rollouts(self) -> int:
        """The number of its rollouts."""
        return count_rollouts(self.status, self.trials)


def count_rollouts(status: str, trials: Sequence[Trial]) -> int:
    """Count the rollouts of an `Evaluation`; none of what was not tried."""
    if status == "rejected":
        return 0
    return sum(trial.status != "rejected" and not trial.tried_as for trial in trials) if trials else 1


@dataclass(frozen=True)
class Budget:
    """How many candidates are tried, and which of them become elites (the paper's parameters)."""

    n_agent: int  # requests in a generation
    n_tool: int  # tools in a request
    n_action: int  # action plans for each tool
    n_iteration: int  # generations after the first
    k_top: int  # candidates that may become elites
    reward_save: float  # an elite earns more than this
    stop_reward: float | None = None  # the run ends when the highest reward reaches it; None: never

    @property
    def population(self) -> int:
        """The number of candidates in a generation."""
        return self.n_agent * self.n_tool * self.n_action


def ranked(items: Iterable[T], figures: Callable[[T], tuple[float, float | None]], tie: float = TIE) -> list[T]:
    """Sort items by reward and distance, the best first.

    Rewards within ``tie`` of the highest count as equal: of these items the one with the shorter distance goes first,
    then the one with the higher reward. The items that are left are sorted by the same rule, and so on. Items with
    the same figures keep their order.

    Args:
        items: what is sorted.
        figures: gives an item's reward and distance in metres; a distance of None or nan is the longest.
        tie: the largest difference from the highest reward that counts as none.
    """
    groups: list[list[T]] = []
    for item in sorted(items, key=lambda item: figures(item)[0], reverse=True):
        if not groups or figures(groups[-1][0])[0] - figures(item)[0] > tie:
            groups.append([])
        groups[-1].append(item)
    return [item for group in groups for item in sorted(group, key=lambda item: _or_longest(figures(item)[1]))]


def _or_longest(distance_m: float | None) -> float:
    return np.inf if distance_m is None or np.isnan(distance_m) else distance_m


def best_first(evaluations: Iterable[Evaluation], tie: float = TIE) -> list[Evaluation]:
    """Sort the evaluations with status ``ok``, the best first (`ranked`), at last by `Candidate.key`."""
    tried = sorted((e for e in evaluations if e.status == "ok"), key=lambda e: e.candidate.key)
    return ranked(tried, lambda e: (e.reward, e.distance_m), tie)


def best_tools(ranking: Iterable[Evaluation]) -> list[Evaluation]:
    """Keep the first evaluation of each tool."""
    found: dict[tuple[int, ...], Evaluation] = {}
    for evaluation in ranking:
        found.setdefault(evaluation.candidate.key[:3], evaluation)
    return list(found.values())
