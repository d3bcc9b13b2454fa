"""A goal: bodies in the hollow of another one, or in the space of a mark."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from core.geometry import Array, Vector
from core.goals.keys import Key
from core.goals.measures import SLIP_M, Measure
from core.goals.reaching import Reach
from core.goals.sites import ANY_BODY, Site, Space
from core.values.joints import rotate, rotate_back
from core.values.states import State
from core.values.tools import Fixture

EMPTY = Space()
SINKS_M = 2e-4
"""What rests on something sinks into it by micrometres, and is still inside a space that ends at its surface."""


@dataclass(frozen=True, kw_only=True)
class Inside(Reach):
    """Bodies whose middles must end in the hollow of a body or the space of a mark; of soft bodies, all nodes.

    On the way less than half is earned, by how long the way in still is: off the opening, above it, and through it. A
    body that lies at the foot of a bottle has to get up to its neck.

    Attributes:
        inside: the name of the body or mark.
        space: the hollow or space, in the frame of that body, with which it moves. A scene file finds it by itself.
        feet: by body, how far its frame is above its lowest point at the start, m.
        down: the direction of gravity, (3,) in the world.
    """

    inside: str
    space: Space = field(default=EMPTY, repr=False, compare=False)
    feet: Mapping[str, float] = field(default_factory=dict, repr=False, compare=False)
    down: Vector = field(default=(0.0, 0.0, -1.0), repr=False, compare=False)

    keys: ClassVar = {
        "inside": Key(
            str,
            "The body or mark in whose hollow or space the middle of each must end, on the way to which less than half "
            "is earned; what a body lacks of walls, the table or what is fixed may have",
            way=True,
        )
    }
    asks = (
        "must end inside {{ goal.inside }}: the middle of each in its hollow; on the way in, through its opening, less "
        "than half is earned by it"
    )
    short = "bring {{ bodies }} into {{ goal.inside }}"
    names: ClassVar = {"inside": ANY_BODY}
    moves = True

    @property
    def at(self) -> str:
        """What the place is given by."""
        return self.inside

    def _find_space(self, start: State) -> Space:
        """Return the space in the layout that begins so."""
        return self.space.within(start.fixture) or EMPTY

    def measures(self, body: str, start: State) -> Iterator[Measure]:
        space = self._find_space(start)

        def room(state: State) -> Array:
            if body in state.soft:
                rooms = space.room(state.nodes(body, self.inside))
                left = np.asarray(rooms.min(axis=-1))
            else:
                left = space.room(state.relative(body, self.inside))

            is_sunk = (left < 0) & (left >= -SINKS_M)
            return np.where(is_sunk, 0.0, left)

        name = f"{body} inside {self.inside}, from its wall"
        yield Measure(name, room, 0.0, SLIP_M, "m", at_least=True, whole=True)

    def place_of(self, body: str, start: State) -> Array:
        """Return where a body's frame is when it rests in the hollow, below its middle as gravity draws."""
        frame = start.quaternion(self.inside)
        local = rotate_back(frame, np.array(self.down))
        # Worlds of one layout have it alike.
        down = local.reshape(-1, 3)[0]
        space = self._find_space(start)
        place = space.rest(down, self.feet.get(body, 0.0))
        return start.position(self.inside) + rotate(frame, place)

    def fit(self, site: Site) -> Self:
        found = super().fit(site)
        return replace(
            found,
            space=site.find_space(self.inside),
            feet={name: site.find_foot(name) for name in self.bodies},
            down=site.scene.gravity,
        )

    def find_fixture_fault(self, fixture: Fixture) -> str:
        if self.space.within(fixture) is not None:
            return ""

        return (
            "bodies must end inside it, and it has no hollow with walls all around; close its walls, on a side that is "
            "open like a cup's or a tube's"
        )

    def find_faults(self, site: Site) -> Iterator[str]:
        yield from super().find_faults(site)
        if self.inside in self.bodies:
            yield f"{self.inside} can't be inside itself; name another body"
