"""``action=anchored``: a plan whose waypoints stand relative to bodies and marks of the scene, with tempo.

A waypoint is an object: an anchor, an offset and an orientation in the anchor's axes, and what it says of time. Nothing
in it is computed by the model's text: there are no expressions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from core.design import DesignError
from core.designs.plan_rules import MIN_TEMPO
from core.geometry import Array, Pose
from core.goals import numbered
from core.interfaces import (
    ActionPlan,
    ActionRepresentation,
    Anchor,
    Brief,
    JsonObject,
    Numbers,
    PlannedMotion,
    Reactions,
    Seen,
    Task,
    Waypoints,
)
from core.support.inputs import check
from core.support.templates import fill
from core.support.text import count_words
from plugins.actions.blocks import (
    MAX_DEPTH,
    MAX_GUARDS,
    MAX_LOOKS,
    MAX_ROUNDS,
    Cost,
    Item,
    LookStep,
    Reader,
    block_schemas,
    change_waypoints,
    check_cost,
    dump_items,
    list_items,
    list_waypoints,
    parts_of,
)
from plugins.actions.reactions import PlannedReactions
from plugins.actions.steps import (
    GUARD_FIELDS,
    HERE,
    MAX_SECONDS,
    MAX_SPEED,
    PROPERTIES,
    UNTIMED,
    Step,
)
from plugins.actions.walk import Walk, check_names
from plugins.actions.waypoints import MOST, STEPS

STEP_LOG = 0.2
"""A small change of a speed or time, as a logarithm."""

_DIGITS = 5  # hundredths of a millimetre


@dataclass(frozen=True)
class AnchoredPlan(ActionPlan):
    """A plan of steps.

    Attributes:
        steps: the waypoints, looks and blocks as written.
        gripper: whether waypoints move the gripper.
    """

    action: ClassVar[str] = "anchored"
    steps: tuple[Item, ...]
    gripper: bool = False

    def resolve(self, seen: Seen) -> Waypoints:
        """Carry the steps out in a layout, one after another, up to the next look that is not taken yet.

        What a guard felt moves the waypoints that follow; where that is not known yet, it ends at its waypoint.
        """
        if self.looks:
            check_names(self.steps, seen)

        return self._walk(seen).waypoints()

    def _walk(self, seen: Seen) -> Walk:
        """Carry the steps out in a layout."""
        walk = Walk(seen, self.gripper)
        walk.run(self.steps)
        return walk

    @property
    def waypoints(self) -> list[Step]:
        """The waypoints as they are written, those of blocks too."""
        return list_waypoints(self.steps)

    @property
    def looks(self) -> bool:
        """Whether it has looks or blocks."""
        return any(not isinstance(step, Step) for step in self.steps)

    @property
    def cost(self) -> Cost:
        """The most that it can come to."""
        return Cost.of(self.steps)

    def outline(self) -> list[str]:
        if not self.looks:
            return []
        said = fill(
            "plugins.actions",
            "outline",
            steps=self.steps,
            cost=self.cost,
            count=count_words,
        )
        return said.splitlines()

    def most_seconds(self, look_s: float) -> float:
        if not self.looks:
            return 0.0
        return self.cost.seconds + self.cost.looks * look_s

    def make_reactions(self, planned: PlannedMotion) -> Reactions:
        return PlannedReactions(
            planned,
            feels=any(step.until for step in self.waypoints),
            looks=any(isinstance(item, LookStep) for item in list_items(self.steps)),
        )

    @property
    def anchors(self) -> tuple[Anchor, ...]:
        return _list_anchors(self.waypoints)

    @property
    def turns(self) -> Array:
        return np.array([step.rpy for step in self.waypoints])

    def dump(self) -> list[Any]:
        return dump_items(self.steps)


class AnchoredActions(ActionRepresentation):
    """Objects with an anchor, an offset, an orientation, and tempo.

    Args:
        guards: the model is told that waypoints may have guards. They are read in any case.
        looks: the model is told of looks, loops and choices. They are read in any case.
    """

    def __init__(self, guards: bool = False, looks: bool = False) -> None:
        self.guards = guards
        self.looks = looks

    def instructions(self, brief: Brief) -> str:
        scene = brief.task.scene(brief.scene_seed)
        names = ", ".join(f"`{body.name}`" for body in scene.bodies)
        return fill(
            "plugins.actions",
            "anchored",
            names=names,
            closes=brief.closes,
            fingers=brief.gripper,
            guards=MAX_GUARDS if self.guards else 0,
            looks=self.looks,
            goals=_name_goals(brief.task) if self.looks else "",
            max_rounds=MAX_ROUNDS,
            max_looks=MAX_LOOKS,
            max_depth=MAX_DEPTH,
        )

    def schema(self, *, gripper: bool) -> JsonObject:
        left_out = set() if self.guards else {*GUARD_FIELDS}
        if not gripper:
            left_out.add("grip")
        if not self.looks:
            left_out.add("meet")

        properties = {}
        for name, field in PROPERTIES.items():
            if name not in left_out:
                properties[name] = _plain(field)

        waypoint = {
            "type": "object",
            "properties": properties,
            "required": ["offset"],
            "additionalProperties": False,
        }
        item = waypoint
        if self.looks:
            item = {"anyOf": [waypoint, *block_schemas(waypoint)]}

        return {
            "type": "array",
            "items": item,
            "minItems": 1,
        }

    def parse(self, data: object, *, gripper: bool) -> AnchoredPlan:
        plan = AnchoredPlan(Reader(gripper).read_all(data), gripper)
        check_cost(plan.steps)
        _check_order(plan)
        return plan

    def dump(self, waypoints: Waypoints) -> list[Any]:
        """Anchor them to the world; a tempo is left out."""
        return self.anchor(waypoints, [Anchor()] * len(waypoints), Seen({}))

    def anchor(
        self, waypoints: Waypoints, anchors: Sequence[Anchor], seen: Seen
    ) -> list[Any]:
        guards = waypoints.guards or (None,) * len(waypoints)
        rows = zip(
            waypoints.poses, waypoints.grips.tolist(), anchors, guards, strict=True
        )
        steps = []
        for number, (row, grip, anchor, guard) in enumerate(rows, start=1):
            where = f"waypoint {number}"
            pose = Pose.xyz_rpy(row[:3], row[3:6])
            written: JsonObject = {
                "anchor": anchor.name,
                "axes": anchor.axes,
                "toward": anchor.toward,
                "share": anchor.share,
                "grip": grip,
            }
            if guard:
                written |= vars(guard)

            numbers = row[:6]

            if anchor != Anchor():
                frame = Step((0.0, 0.0, 0.0), **written).frame(seen, where)
                offset = frame.inverse() @ pose
                numbers = np.round([*offset.position, *offset.rpy], _DIGITS) + 0.0

            if guard:
                seen = Seen({**seen.poses, HERE: pose})

            place = numbers.tolist()
            written |= {"offset": place[:3], "rpy": place[3:]}

            steps.append(check(Step, written, where, DesignError).dump())

        return steps

    def parameters(self, plan: ActionPlan) -> Numbers:
        """Return offsets and angles of all steps, and the logarithms of speeds, times and waits that are given."""
        if not isinstance(plan, AnchoredPlan):
            return Numbers()

        rows = np.array([[*step.offset, *step.rpy] for step in plan.waypoints])
        found = Numbers.near(rows, STEPS, MOST)
        for _, name, value in _tempi(plan):
            most = MAX_SPEED if name == "speed" else MAX_SECONDS
            limits = np.log([MIN_TEMPO, most])
            found += Numbers(
                np.log([value]), np.array([STEP_LOG]), limits[:1], limits[1:]
            )

        return found

    def with_parameters(self, plan: ActionPlan, values: Array) -> AnchoredPlan:
        assert isinstance(plan, AnchoredPlan)
        count = 6 * len(plan.waypoints)
        changes: list[dict[str, Any]] = []
        for offset, rpy in np.round(values[:count], _DIGITS).reshape(-1, 2, 3).tolist():
            changes.append({"offset": tuple(offset), "rpy": tuple(rpy)})

        tempi = np.exp(values[count:]).tolist()
        for (number, name, _), value in zip(_tempi(plan), tempi, strict=True):
            changes[number][name] = round(value, _DIGITS)

        waiting = iter(changes)
        steps = change_waypoints(
            plan.steps, lambda step: replace(step, **next(waiting))
        )
        return replace(plan, steps=steps)


def _list_anchors(steps: Sequence[Step]) -> tuple[Anchor, ...]:
    """List what waypoints stand by."""
    return tuple(
        Anchor(
            step.anchor,
            step.axes,
            step.toward,
            step.share,
        )
        for step in steps
    )


def _tempi(plan: AnchoredPlan) -> list[tuple[int, str, float]]:
    """The speeds, times and waits of a plan that are above 0: number of the step, name, value."""
    found = []
    for number, step in enumerate(plan.waypoints):
        for name in ("speed", "seconds", "wait"):
            value = getattr(step, name)
            if value > MIN_TEMPO:
                found.append((number, name, value))

    return found


def _name_goals(task: Task) -> str:
    """Name the goals that conditions may be about, with their numbers."""
    goals = numbered(task.goals).items()
    return ", ".join(f"{number} ({goal.subject})" for number, goal in goals)


def _check_order(plan: AnchoredPlan) -> None:
    """Refuse waypoints that need what comes before, where nothing does."""
    items = list(list_items(plan.steps))
    number = 0
    guarded = False
    looked = False

    for item in items:
        if isinstance(item, LookStep):
            looked = looked or number > 0
        if not isinstance(item, Step):
            continue

        number += 1
        if HERE in (item.anchor, item.axes, item.toward) and not guarded:
            raise DesignError(
                f"waypoint {number}: 'here' is where a guard ended; none comes before"
            )
        if item.corrects and number == 1:
            raise DesignError(
                "waypoint 1: 'corrects' needs a waypoint before, from which the way leads there"
            )
        if item.meet and not looked:
            raise DesignError(
                f"waypoint {number}: 'meet' needs a look before, after a waypoint, so that the body is seen twice"
            )

        guarded = guarded or bool(item.until)

    _check_meets(plan.steps)


def _check_meets(items: Sequence[Item], before: int = 0) -> int:
    """Refuse a waypoint that meets a body after a way whose time is not known; after a block it may be known.

    Args:
        items: a list of steps.
        before: how many waypoints are written before it.

    Returns:
        How many are written up to its end.
    """
    number = before
    timed = True

    for item in items:
        if not isinstance(item, Step):
            timed = True
            for part in parts_of(item).values():
                number = _check_meets(part, number)
            continue

        number += 1
        if item.meet and not timed:
            raise DesignError(f"waypoint {number}: {UNTIMED}")
        timed = timed and item.is_timed

    return number


def _plain(schema: JsonObject) -> JsonObject:
    """A field's schema in the words that all providers know: without titles, defaults and prefixes."""
    plain = dict(schema)
    for name in ("title", "default"):
        plain.pop(name, None)

    if plain.pop("prefixItems", None):
        plain["items"] = {"type": "number"}

    return plain
