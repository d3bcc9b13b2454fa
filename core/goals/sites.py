"""Find what goals name in a scene, and say what they ask of where they are to be met."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from fnmatch import fnmatchcase
from typing import Protocol

import numpy as np

from core.errors import choices
from core.geometry import Array
from core.scene import FIXTURE, Scene
from core.values.tools import Fixture

NO_WAY_M = 1.0  # what leads into no space counts as so long
_GLOB = re.compile(r"[*?\[]")

FREE_BODY = "body that can move"
SOLID_BODY = "body that can be touched"
ANY_BODY = "body"
JOINT = "joint"
BREAKABLE = "thing that breaks"


class Space:
    """What bodies can be inside of, in the frame of the body or mark that has it. By itself it is empty."""

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


class Site(Protocol):
    """A scene, and what goals ask of it that takes geometry to find."""

    @property
    def scene(self) -> Scene: ...

    def find_space(self, name: str) -> Space:
        """Find the hollow of a body, or the space of a mark.

        Raises:
            UsageError: it has none.
        """

    def find_foot(self, name: str) -> float:
        """Measure how far the frame of a body is above its lowest point as gravity draws, m."""

    def find_touching(self, names: Iterable[str]) -> Iterable[tuple[str, str]]:
        """Find the pairs of bodies that touch, of which one has such a name."""


def list_names(what: str, scene: Scene) -> list[str]:
    """List the names that a scene has of a sort of things, such as `FREE_BODY`."""
    if what == JOINT:
        return [joint.name for joint in scene.joints]
    if what == FREE_BODY:
        return [body.name for body in scene.free]
    if what == SOLID_BODY:
        # A mark can't be touched, unless a design's fixture takes its place.
        solid = [b for b in scene.bodies if b.collides or b.name == FIXTURE]
        return [body.name for body in solid]
    if what == BREAKABLE:
        return [*scene.breakable]

    return [body.name for body in scene.bodies]


def find_names(patterns: Sequence[str], names: Sequence[str]) -> tuple[str, ...]:
    """Return the names that patterns such as ``grain*`` fit, in order; what is no pattern is taken as it is.

    Raises:
        UsageError: a pattern fits none.
    """
    found = dict[str, None]()
    for pattern in patterns:
        fitting = [pattern]
        if _GLOB.search(pattern):
            fitting = [name for name in names if fnmatchcase(name, pattern)]
        if not fitting:
            raise choices("name like", pattern, names)

        found |= dict.fromkeys(fitting)

    return tuple(found)
