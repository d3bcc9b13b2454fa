"""Define tools, and candidates: a tool with an action plan."""

# ruff: noqa: I001 - names that are handed on (`X as X`) stand together

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from core.errors import Refusal
from core.values.contents import digest
from core.values.plans import ActionPlan, Waypoints
from core.values.tools import (
    GRIPPER_MOUNTS as GRIPPER_MOUNTS,
    MAX_JOINTS as MAX_JOINTS,
    RIGID_MOUNT as RIGID_MOUNT,
    TOOL_FRICTION as TOOL_FRICTION,
    Bearer as Bearer,
    Component as Component,
    ConvexPart as ConvexPart,
    DesignError as DesignError,
    Fixture as Fixture,
    Tool as Tool,
    ToolJoint as ToolJoint,
)
from core.values.harmless import Harmless


@dataclass(frozen=True)
class Varied:
    """What a candidate of a curve differs in from the design that asked for the curve (`core.designs.curves`).

    Attributes:
        base: the id of that design's candidate.
        names: of the numbers that are varied.
        added: to each of them, m or rad.
    """

    base: str
    names: tuple[str, ...]
    added: tuple[float, ...]


@dataclass(frozen=True)
class Fork:
    """Where a candidate's trials go on from: a waypoint of an earlier candidate, which begins as it does.

    What comes of a trial is the same as if it was played from the start, in an engine that can go on (`Ability.FORKS`).

    Attributes:
        candidate: the earlier one.
        waypoint: its number, from 1.
        content: of the candidate, by which forks are compared.
    """

    candidate: Candidate = field(compare=False)
    waypoint: int
    content: str = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "content", self.candidate.content)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A tool and one action plan, which are tried together; a plan may differ by task (`ActionPlan.of`).

    An array (N, 6) or (N, 7) as ``plan`` stands for literal `Waypoints`.
    ``problem`` says which rule the design breaks, so that it can't be tried, and ``refusals`` say so to programs, as
    far as there are codes; then ``tool`` may be None and ``plan`` empty. `id` is made of ``generation``, ``agent``,
    ``design`` and ``action``. ``varied`` is set in a curve, and ``fork`` where a trial goes on from another one's.
    """

    tool: Tool | None
    plan: ActionPlan
    generation: int = 0
    agent: int = 0
    design: int = 0
    action: int = 0
    design_name: str = ""
    design_description: str = ""
    action_description: str = ""
    parents: tuple[str, ...] = ()
    problem: str | None = None
    varied: Varied | None = None
    fork: Fork | None = None
    refusals: tuple[Refusal, ...] = ()

    def __post_init__(self) -> None:
        if isinstance(self.plan, np.ndarray):  # for short: literal waypoints
            object.__setattr__(self, "plan", Waypoints(self.plan))

    @property
    def key(self) -> tuple[int, int, int, int]:
        """Sorts candidates in one order, however they arrived."""
        return (self.generation, self.agent, self.design, self.action)

    @property
    def id(self) -> str:
        """For example ``g0-a3-s1-p7``: generation, agent, design, plan."""
        return "g{}-a{}-s{}-p{}".format(*self.key)

    @property
    def idea(self) -> str:
        """What is equal for the plans of a tool, and for the designs of a curve over one of them: such as g0-a3-s1."""
        base = self.id if self.varied is None else self.varied.base
        return base.rpartition("-")[0]

    @cached_property
    def content(self) -> str:
        """A hash of what is tried: equal where tools and plans are equal to the last bit, in every process."""
        return digest((self.tool and self.tool.content, self.plan.content))

    def of(self, task: str) -> Candidate:
        """Return the candidate with its plan for a task alone; without one, that is its problem."""
        plan = self.plan.of(task)
        if plan is self.plan:
            return self
        if isinstance(plan, str):
            return replace(self, problem=self.problem or plan)
        return replace(self, plan=plan)


@dataclass(unsafe_hash=True)
class Budget:
    """How many candidates are tried, and which of them become elites (the paper's parameters).

    Attributes:
        n_agent: requests in a generation.
        n_tool: tools in a request.
        n_action: action plans for each tool.
        n_iteration: generations after the first.
        k_top: candidates that may become elites.
        reward_save: an elite earns more than this.
        stop_reward: the run ends when a reward reaches it, from 0.95 on that of a solved task; None: never.
        final_s: for how long, s, candidates are tried in more layouts at the end; 8 rollouts count as a second, with
            soft bodies 1. 0: what is known then decides.
        elite_s: for how long they are after each generation. 0: the reward and the distance choose elites, and all
            candidates are tried in all layouts of the search.
        n_rollouts: in the layouts of the search, all generations together; the search ends before a candidate that
            may take more. None: as many as its candidates take.
        curves: so many designs are tried of a curve that a design may ask for (`core.designs.curves`); 0: it may not.
        k_least: so many of the best tools are elites even if they earned no more than ``reward_save``, or nothing.
        name: of its file.
    """

    n_agent: int
    n_tool: int
    n_action: int
    n_iteration: int
    k_top: int
    reward_save: float
    stop_reward: float | None = None
    final_s: float = 60.0
    elite_s: float = 10.0
    n_rollouts: int | None = None
    k_least: int = 2
    curves: int = 0
    name: Harmless[str] = ""

    def admits(self, place: int, reward: float) -> bool:
        """Report whether a tool becomes an elite: the one at a place of the ranking, from 0, with this reward."""
        return reward > self.reward_save or place < min(self.k_least, self.k_top)

    @property
    def population(self) -> int:
        """The number of candidates in a generation."""
        return self.n_agent * self.n_tool * self.n_action
