"""Say who bears whom in a rollout, at each of its instants. It is `Trace.support`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from core.errors import unknown
from core.geometry import Array
from core.values.jobs import Forces
from core.values.states import State

ROBOT = "the robot"
WORLD = "the world"

Flags = npt.NDArray[np.bool_]
Touching = Mapping[tuple[str, str, str], Flags]
"""At which instants things touched, by the kind of the first, and their names; see `Trace`."""

Link = tuple[str, str, npt.NDArray[Any]]  # two bodies, and how much passes between them


class Edge(NamedTuple):
    """What connects a body that can move to something else.

    Attributes:
        body: its name.
        other: another body, a part of the robot, or the world.
        does: what the body does to the other, in words; the other's name follows.
        holds: at which instants, (..., T).
        side: `ROBOT` or `WORLD`, if the other is a part of it, or fixed; else empty.
        tied: whether it holds in all directions: a joint, a bond or a pin. What only touches may be left.
        force: that passes along it, N, (..., T); None: it is not measured.
    """

    body: str
    other: str
    does: str
    holds: Flags
    side: str = ""
    tied: bool = True
    force: Array | None = None


class Support:
    """Who touches, grips, is joined, bonded or pinned to whom, and what follows: who is held, let go, or borne.

    It is a graph. Its vertices are the bodies that can move, the robot, and what is fixed; its edges come and go with
    the instants of a trace. Chains lead through bodies that can move, never through the robot or what is fixed.

    Args:
        states: complete ones (`Scene.complete`), (..., T).
        touching: see `Trace`.
        forces: likewise; None: nothing measured them.
        strains: likewise; those of bonds count.
        gripped: likewise.
    """

    def __init__(
        self,
        states: State,
        touching: Touching,
        forces: Forces | None,
        strains: Mapping[str, Array],
        gripped: Mapping[tuple[str, str], Flags],
    ) -> None:
        self._states = states
        self._forces = forces or {}
        self._always = np.ones(states.positions.shape[:-2], dtype=bool)
        self.edges = (*self._list_touches(touching), *self._list_ties(strains))
        self.edges += tuple(
            Edge(body, component, "hangs from", flags, ROBOT)
            for (component, body), flags in gripped.items()
        )

    def linked(self, body: str) -> Flags:
        """Report at which instants (..., T) the robot reaches a body: touches it, or what is connected to it."""
        return self._reach(ROBOT, body)

    def held(self, body: str) -> Flags:
        """Report at which instants (..., T) the robot alone holds a body: it reaches it, and nothing fixed does."""
        return self.linked(body) & ~self._reach(WORLD, body)

    def hangs(self, body: str) -> Flags:
        """Report at which instants (..., T) joints, bonds or pins alone connect a body to what is fixed."""
        self._check(body)
        return self._tied[body]

    def stands(self, body: str, other: str) -> Flags:
        """Report at which instants (..., T) a body stands on another one: no other thing bears it with as much force.

        What presses it from the side bears less than its weight, and what lies on it less than what it stands on.
        """
        self._check(body)
        forces = {ends: force for ends, force in self._forces.items() if body in ends}
        most = np.max([np.zeros(self._always.shape), *forces.values()], axis=0)
        below = np.zeros(self._always.shape)
        for ends, force in forces.items():
            if other in ends:
                below = np.maximum(below, force)

        return np.asarray((below > 0) & (below >= most))

    def passed_on(self, body: str, pressed: Mapping[str, Array]) -> Array:
        """Bound what bodies that are pressed press another one with, N, (..., T).

        A chain of bodies passes on as much as its weakest contact or bond bears; joints bear all. What a body lies on
        another with at the start is its weight, and is not passed on. A joint presses the body with no more than what
        else touches that answers.

        Args:
            body: that is pressed through others.
            pressed: how hard each body that can move is pressed, N, (..., T).
        """
        reached = {name: force for name, force in pressed.items() if name != body}
        passing = [*self._find_passing()]
        _spread(reached, passing)

        total = np.zeros(self._always.shape)
        for first, second, force in passing:
            through = second if first == body else first
            if body not in (first, second) or through not in reached:
                continue

            if np.isinf(force).all():
                borne = self._answer(body, through)
            else:
                borne = np.maximum(force - force[..., :1], 0.0)

            total = total + np.minimum(reached[through], borne)

        return total

    def say(self, body: str, side: str) -> str:
        """Say what connects a body to the robot or to what is fixed at the last instant; empty: nothing does.

        Args:
            body: its name; in a trace of one world.
            side: `ROBOT` or `WORLD`.
        """
        ways: dict[str, tuple[str, ...]] = {body: ()}
        waiting = [body]

        while waiting:
            name = waiting.pop(0)
            for edge in self._edges_of(name):
                if not edge.holds[-1]:
                    continue

                force = "" if edge.force is None else f" ({edge.force[-1]:.3g} N)"
                way = (*ways[name], f"{edge.body} {edge.does} {edge.other}{force}")
                if edge.side == side:
                    return ", ".join(way)

                other = edge.other if edge.body == name else edge.body
                if not edge.side and other not in ways:
                    ways[other] = way
                    waiting.append(other)

        return ""

    def _edges_of(self, body: str) -> Iterator[Edge]:
        for edge in self.edges:
            if body in (edge.body, edge.other):
                yield edge

    def _list_touches(self, touching: Touching) -> Iterator[Edge]:
        free = self._states.names
        for (kind, toucher, other), flags in touching.items():
            body = other
            partner = toucher
            side = ROBOT
            if kind == "body":
                if body not in free:
                    body, partner = partner, body
                side = "" if partner in free else WORLD
            if body not in free:
                continue

            force = self._forces.get((toucher, other))
            yield Edge(body, partner, "touches", flags, side, False, force)

    def _list_ties(self, strains: Mapping[str, Array]) -> Iterator[Edge]:
        states = self._states
        for name, placed in states.joints.items():
            joint = placed.joint
            does = f"is joined by {name} to"
            yield self._tie(joint.body, joint.parent, does, self._always)

        for name, bond in states.bonds.items():
            does = f"is bonded by {name} to"
            strain = strains.get(name)
            holds = self._always
            force = None
            if strain is not None:
                holds = np.maximum.accumulate(strain, axis=-1) <= 1
                force = strain * bond.breaks_n

            yield self._tie(bond.body, bond.parent, does, holds, force)

        for name in states.pinned:
            yield self._tie(name, None, "is pinned to", self._always)

    def _tie(
        self,
        body: str,
        parent: str | None,
        does: str,
        holds: Flags,
        force: Array | None = None,
    ) -> Edge:
        """Make the edge of what ties a body to a parent; None: to the world."""
        side = "" if parent in self._states.names else WORLD
        return Edge(body, parent or WORLD, does, holds, side, True, force)

    @cached_property
    def _reached(self) -> dict[str, dict[str, Flags]]:
        """When (..., T) the robot, and what is fixed, reach each body that can move."""
        return {side: self._spread_from(side, self.edges) for side in (ROBOT, WORLD)}

    @cached_property
    def _tied(self) -> dict[str, Flags]:
        """When (..., T) each body that can move hangs from what is fixed."""
        return self._spread_from(WORLD, [edge for edge in self.edges if edge.tied])

    def _spread_from(self, side: str, edges: Iterable[Edge]) -> dict[str, Flags]:
        """Report when (..., T) each body that can move is connected to the robot, or to what is fixed."""
        reached = dict.fromkeys(self._states.names, ~self._always)
        between = []
        for edge in edges:
            if edge.side == side:
                reached[edge.body] = reached[edge.body] | edge.holds
            elif not edge.side:
                between.append((edge.body, edge.other, edge.holds))

        _spread(reached, between)
        return reached

    def _reach(self, side: str, body: str) -> Flags:
        self._check(body)
        return self._reached[side][body]

    def _find_passing(self) -> Iterator[Link]:
        """Yield each two bodies of which one passes a force on to the other, and how much at most, N, (..., T)."""
        states = self._states
        bodies = {*states.names, *states.places}
        for (presser, other), force in self._forces.items():
            if presser in bodies:
                yield presser, other, force

        for edge in self.edges:
            if edge.tied and not edge.side:
                most = np.full(self._always.shape, np.inf)
                force = most if edge.force is None else edge.force
                yield edge.body, edge.other, force

    def _answer(self, body: str, through: str) -> Array:
        """Sum what else touches a body that a joint presses, and what hangs from it, N, (..., T).

        What it lay on at the start, and no longer does, the joint bears now.
        """
        group = [body]
        for name in group:
            for edge in self._edges_of(name):
                if not edge.tied or through in (edge.body, edge.other):
                    continue
                if edge.side:
                    return np.full(self._always.shape, np.inf)

                other = edge.other if edge.body == name else edge.body
                if other not in group:
                    group.append(other)

        total = np.zeros(self._always.shape)
        for ends, force in self._forces.items():
            if len({*ends} & {*group}) == 1:
                total = total + np.maximum(force, force[..., :1])

        return total

    def _check(self, body: str) -> None:
        if body not in self._states.names:
            raise unknown("body", body, "that moves in the trace", self._states.names)


def _spread(values: dict[str, npt.NDArray[Any]], links: Iterable[Link]) -> None:
    """Pass each body's value on to others, as much as the weakest link of a chain lets through.

    Args:
        values: of each body, numbers or flags (..., T). They are changed.
        links: between bodies, either way.
    """
    ways = [(giver, taker, link) for giver, taker, link in links]
    ways += [(taker, giver, link) for giver, taker, link in links]
    known = [way for way in ways if way[0] in values and way[1] in values]
    changed = True

    while changed:
        changed = False
        for giver, taker, link in known:
            more = np.maximum(values[taker], np.minimum(values[giver], link))
            changed |= bool((more != values[taker]).any())
            values[taker] = more
