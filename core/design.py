"""Define tools, candidates (a tool with an action plan) and their evaluations, and how these are ranked."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal, NamedTuple, TypeVar

import numpy as np

from core.geometry import Compound, Pose, Shape
from core.plans import ActionPlan, Waypoints, content_of, digest

RIGID_MOUNT = "tool_mount"
GRIPPER_MOUNTS = ("left_finger", "right_finger")
TOOL_FRICTION = 0.5  # of printed plastic

TIE = 0.005  # the default of ``evolution.tie``, see `ranked`
SAVED, STOPPED, SAME_AS = "saved", "stopped", "same_as"  # keys of `Evaluation.details`, see there

Status = Literal["ok", "rejected", "failed"]
T = TypeVar("T")


class DesignError(ValueError):
    """A design breaks a rule. The message says what is wrong, where, and how to mend it."""


@dataclass(frozen=True)
class ToolJoint:
    """A joint without a motor, by which a component moves against its parent. Units are SI, angles radians.

    Attributes:
        kind: ``hinge`` or ``slider``.
        axis: (3,) the direction that it turns about or moves along, in the component's frame; it becomes a unit vector.
        lower: with ``upper`` its range; at 0 the component is where its pose says.
        origin: (3,) a point of a hinge's axis, in the component's frame.
        damping: N m s/rad, or N s/m.
        friction: the largest torque or force of dry friction, N m or N.
        stiffness: of a spring, N m/rad or N/m; 0: there is none.
        rest: where the spring is relaxed.

    Raises:
        DesignError: the axis has no length, 0 is not in the range, or a number is negative that must not be.
    """

    kind: Literal["hinge", "slider"]
    axis: tuple[float, float, float]
    lower: float
    upper: float
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    damping: float = 0.0
    friction: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0

    def __post_init__(self) -> None:
        length = float(np.linalg.norm(self.axis))
        if not 1e-6 < length < np.inf:
            raise DesignError("a joint's axis needs a length: give for example 0 0 1")
        x, y, z = (float(value) / length for value in self.axis)
        object.__setattr__(self, "axis", (x, y, z))
        if not self.lower <= 0 <= self.upper or self.lower == self.upper:
            raise DesignError(f"a joint's range must hold 0, and more than 0; it is {self.lower:g} to {self.upper:g}")
        for name in ("damping", "friction", "stiffness"):
            if not getattr(self, name) >= 0:
                raise DesignError(f"a joint's {name} must be 0 or more, not {getattr(self, name):g}")


@dataclass(frozen=True)
class Component:
    """One solid of a tool, its pose given in the frame of its parent: another component, or a mount link of the robot.

    A `Mesh` is closed and convex. With a ``joint`` it moves against its parent, and bears its own children.
    """

    name: str
    parent: str
    pose: Pose
    shape: Shape | Compound
    mass: float = 0.005
    color: tuple[float, float, float, float] = (0.2, 0.45, 0.8, 1.0)
    joint: ToolJoint | None = None

    @property
    def link(self) -> Pose:
        """The frame of the component's link in its own frame: at the joint's origin, if it has one."""
        return Pose() if self.joint is None else Pose(np.array(self.joint.origin))


class Part(NamedTuple):
    """A convex shape of a tool and the name of its component.

    ``pose`` is in the frame of ``bearer``: a mount, or a component with a joint, whose frame is `Component.link`.
    """

    component: str
    shape: Shape
    bearer: str
    pose: Pose


class Bearer(NamedTuple):
    """A component with a joint: its frame in that of the bearer before it, its joint at 0."""

    name: str
    parent: str
    pose: Pose
    joint: ToolJoint


@dataclass(frozen=True)
class Tool:
    """Joined solids: a tool on `RIGID_MOUNT`, or with ``gripper`` attachments to the fingers `GRIPPER_MOUNTS`.

    Without components it is the bare arm (with ``gripper``: the bare hand). Parents come before their children.
    ``friction`` is that of a rigid tool; attachments to the fingers have that of the fingers.

    Raises:
        DesignError: a name is used twice, or a parent is neither a component before it nor a mount.
    """

    components: tuple[Component, ...] = ()
    gripper: bool = False
    name: str = ""
    description: str = ""
    friction: float = TOOL_FRICTION

    def __hash__(self) -> int:  # many things are kept by tool, and poses take long
        return hash((self.name, self.gripper, tuple((c.name, c.mass) for c in self.components)))

    def __post_init__(self) -> None:
        known = set(self.mounts)
        for component in self.components:
            if component.name in known:
                raise DesignError(f"two parts of the tool are named {component.name!r}; each needs its own name")
            if component.parent not in known:
                raise DesignError(
                    f"component {component.name!r} hangs from {component.parent!r}, which is neither a component "
                    f"before it nor the mount ({' or '.join(self.mounts)})"
                )
            known.add(component.name)

    @property
    def mounts(self) -> tuple[str, ...]:
        return GRIPPER_MOUNTS if self.gripper else (RIGID_MOUNT,)

    @property
    def mass(self) -> float:
        return sum(component.mass for component in self.components)

    @cached_property
    def content(self) -> str:
        """A hash of what is simulated: equal for tools that differ in name and description only."""
        return digest(content_of(replace(self, name="", description="")))

    def placed(self) -> dict[str, tuple[str, Pose]]:
        """Return for each component its mount and its pose in the mount's frame, with all joints at 0."""
        return dict(self._placed)

    @cached_property
    def _placed(self) -> dict[str, tuple[str, Pose]]:
        placed: dict[str, tuple[str, Pose]] = {mount: (mount, Pose()) for mount in self.mounts}
        for component in self.components:
            mount, pose = placed[component.parent]
            placed[component.name] = (mount, pose @ component.pose)
        return {component.name: placed[component.name] for component in self.components}

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """The convex shapes that collide, in the order of the components."""
        borne = self.borne
        return tuple(Part(c.name, shape, *borne[c.name]) for c in self.components for shape in c.shape.convex_parts())

    @cached_property
    def borne(self) -> dict[str, tuple[str, Pose]]:
        """For each component the mount or the component with a joint that bears it, and its pose in that frame."""
        borne: dict[str, tuple[str, Pose]] = {mount: (mount, Pose()) for mount in self.mounts}
        for c in self.components:
            bearer, pose = borne[c.parent]
            borne[c.name] = (bearer, pose @ c.pose) if c.joint is None else (c.name, c.link.inverse())
        return {component.name: borne[component.name] for component in self.components}

    @property
    def borne_on(self) -> tuple[str, ...]:
        """The links that its components are part of: its mounts, and its components with a joint."""
        return (*self.mounts, *(c.name for c in self.components if c.joint is not None))

    @cached_property
    def bearers(self) -> tuple[Bearer, ...]:
        """The K components with a joint, in the order of the joints' values."""
        ends = {mount: (mount, Pose()) for mount in self.mounts} | self.borne
        return tuple(
            Bearer(c.name, ends[c.parent][0], ends[c.parent][1] @ c.pose @ c.link, c.joint)
            for c in self.components
            if c.joint is not None
        )


@dataclass(frozen=True, eq=False)
class Candidate:
    """A tool and one action plan, which are tried in one rollout.

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


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The outcome of trying a candidate.

    ``status`` is ``ok``; ``rejected``: the design breaks a rule; or ``failed``: the rollout failed. ``reason`` says
    why, or is empty. ``distance_m`` is the way of the end-effector's origin from home through all waypoints.
    ``ik_error_m`` and ``ik_error_rad`` are the largest misses of the inverse kinematics along the plan;
    ``tracking_error_rad`` is the largest lag of a joint behind its target. ``moved_m`` is the distance of each free
    body's end from its start. Without a rollout, numbers are nan. ``details`` holds further figures of a fitness, as
    JSON: among them `SAVED`, the rollouts that were not needed and their seconds of processor time, an estimate;
    `STOPPED`, after how many trials it was given up, and of how many; and `SAME_AS`, the id of the near-duplicate that
    was tried in its place.
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
    details: dict[str, Any] = field(default_factory=dict)

    @property
    def stopped(self) -> bool:
        """Whether it was given up before its last trial; its reward is what is certain."""
        return STOPPED in self.details


def count_rollouts(status: str, details: Mapping[str, Any]) -> int:
    """Count the rollouts of an `Evaluation`: one for each trial that was simulated; none of what was not tried."""
    if SAME_AS in details or status == "rejected":
        return 0
    engines, stopped = details.get("engines"), details.get(STOPPED)
    trials = sum(len(of["rewards"]) for of in engines.values()) if engines else 1
    foreseen = details.get(SAVED, {}).get("rollouts", 0) - (stopped["of"] - stopped["after"] if stopped else 0)
    return trials - int(foreseen)


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
    """Sort the evaluations with status ``ok``, the best first (`ranked`), at last by `Candidate.key`.

    Those that stopped early come after all others.
    """
    tried = sorted((e for e in evaluations if e.status == "ok"), key=lambda e: e.candidate.key)
    parts = ([e for e in tried if e.stopped is stopped] for stopped in (False, True))
    return [e for part in parts for e in ranked(part, lambda e: (e.reward, e.distance_m), tie)]


def best_tools(ranking: Iterable[Evaluation]) -> list[Evaluation]:
    """Keep the first evaluation of each tool."""
    found: dict[tuple[int, ...], Evaluation] = {}
    for evaluation in ranking:
        found.setdefault(evaluation.candidate.key[:3], evaluation)
    return list(found.values())
