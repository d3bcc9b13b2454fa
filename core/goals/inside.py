"""A goal: bodies in the hollow of another one, or in the space of a mark."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from core.geometry import Array, Vector
from core.goals.base import SLIP_M, Measure, Reach
from core.values.joints import rotate, rotate_back
from core.values.states import State
from core.values.tools import Fixture

NO_WAY_M = 1.0  # what leads into no space counts as so long


class Space:
    """What bodies can be inside of, in the frame of the body or mark that has it. By itself it is empty.

    Attributes:
        passage: the radius of the largest ball whose middle may get into it, m; 0: no way leads in.
    """

    passage: float = np.inf

    def within(self, fixture: Fixture | None) -> Space | None:
        """Return the space in a scene to which a design adds a fixture, or adds nothing; None: there is none."""
        return self

    def room(self, points: Array) -> Array:
        """Measure how deep inside points (..., 3) are, m, (...); below 0: how long the way in is."""
        return np.full(points.shape[:-1], -NO_WAY_M)

    def rest(self, down: Array, foot: float) -> Array:
        """Find where a body's frame (3,) is that rests below the middle; in free fall it is the middle.

        Args:
            down: where gravity draws, (3,) in its frame; zeros: nowhere.
            foot: how far the body's frame is above its lowest point, m.
        """
        length = float(np.linalg.norm(down))
        return np.asarray(-foot * down / length if length else down)


EMPTY = Space()


@dataclass(frozen=True, kw_only=True)
class Inside(Reach):
    """Bodies whose middles must end in the hollow of a body, or in the space of a mark; soft ones with all their nodes.

    On the way less than half is earned, by how long the way in still is: off the opening, above it, and through it. A
    body that lies at the foot of a bottle has to get up to its neck.

    Attributes:
        inside: the name of the body or mark.
        space: its hollow or space, in its frame; it moves with it. A scene file's are found where it is read.
        feet: by body, how far its frame is above its lowest point at the start, m.
        down: where gravity draws, (3,) in the world.
    """

    inside: str
    space: Space = field(default=EMPTY, repr=False, compare=False)
    feet: Mapping[str, float] = field(default_factory=dict, repr=False, compare=False)
    down: Vector = field(default=(0.0, 0.0, -1.0), repr=False, compare=False)

    @property
    def at(self) -> str:
        """What the place is given by."""
        return self.inside

    def can_enter(self, fixture: Fixture) -> bool:
        """Report whether there is a space for bodies with a design's fixture in the scene."""
        return self.space.within(fixture) is not None

    def _find_space(self, start: State) -> Space:
        """Return the space in the layout that begins so."""
        return self.space.within(start.fixture) or EMPTY

    def measures(self, body: str, start: State) -> Iterator[Measure]:
        space = self._find_space(start)

        def room(state: State) -> Array:
            if body in state.soft:
                rooms = space.room(state.nodes(body, self.inside))
                return np.asarray(rooms.min(axis=-1))

            return space.room(state.relative(body, self.inside))

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
