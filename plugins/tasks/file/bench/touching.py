"""What touches in a scene while it is fitted: it goes on touching, and the rest stays apart."""

from __future__ import annotations

import numpy as np

from core.geometry import Array
from core.scene import Scene
from core.solids.standing import OVERLAP_M, TOUCHES_M
from plugins.tasks.file.contacts import (
    Meeting,
    Shapes,
    find_meetings,
    measure_shapes,
)

_SAME = 0.7  # the least cosine of two directions that count as one
_STILL_M = 0.006  # apart in a first fit: what touched may touch still
_SUNK_M = 0.005  # what overlaps by more is a mistake, and not held


class Touching:
    """Pairs of shapes that touch, or that may not overlap.

    At first it holds only what rests on something: rough places say little about what stands beside it. What was
    written slightly within another body is held so that it touches.

    Args:
        scene: as it was written.
        names: of the bodies that are fitted.

    Attributes:
        pairs: of shapes.
        names: of the bodies that touched or overlapped at the start, of which one is fitted.
        sunk: of those that have to be lifted out of what bears them.
    """

    def __init__(self, scene: Scene, names: set[str]) -> None:
        self._fitted = names
        gravity = np.array(scene.gravity)
        self._down = gravity / max(float(np.linalg.norm(gravity)), 1e-9)
        self._fixed = {body.name for body in scene.bodies if body.fixed}
        met = [m for m in find_meetings(scene, names) if m.gap_m < TOUCHES_M]
        self.names = {name for m in met for name in (m.pair[0], m.pair[2])}
        near = list(find_meetings(scene, names | self.names))
        nearest = dict[str, float]()
        for meeting in near:
            name = self._find_borne(meeting)
            nearest[name] = min(meeting.gap_m, nearest.get(name, TOUCHES_M))

        self._began = dict[Shapes, Meeting]()
        self._held = dict[Shapes, float]()
        self.sunk = set[str]()
        for meeting in near:
            name = self._find_borne(meeting)
            # A ball that sinks into its channel does not rest on the table.
            is_next = not name or meeting.gap_m < nearest[name] + TOUCHES_M
            if not (is_next and self._touches(scene, meeting)):
                continue

            self._began[meeting.pair] = meeting
            if name:
                gap = self._find_gap(scene, meeting)
                self._held[meeting.pair] = gap
                if gap > meeting.gap_m:
                    self.sunk.add(name)

        self.pairs: list[Shapes] = list(self._held)

    def keep_apart(self, scene: Scene) -> None:
        """Hold what touched at the start and is as near in a fitted scene, and keep apart what else is near there.

        A body that rests on nothing comes to rest on what is next below it.
        """
        met = list(find_meetings(scene, self._fitted | self.names))
        for meeting in met:
            began = self._began.get(meeting.pair)
            if began is None or abs(meeting.gap_m) > _STILL_M:
                continue

            # What is now on the other side of a wall touched it by chance.
            if began.normal @ meeting.normal > _SAME:
                self._held[meeting.pair] = self._find_gap(scene, began)

        borne = {self._find_borne(m) for m in met if m.pair in self._held}
        moving = {body.name for body in scene.bodies if body.launched}
        hung = {joint.body for joint in scene.joints}
        for name in sorted(self._fitted - borne - self._fixed - moving - hung):
            below = [meeting for meeting in met if self._find_borne(meeting) == name]
            if below:
                nearest = min(below, key=lambda meeting: meeting.gap_m)
                self._held[nearest.pair] = 0.0

        apart = list[Shapes]()
        for meeting in met:
            if not self._may_overlap(scene, meeting):
                apart.append(meeting.pair)

        self.pairs = list(dict.fromkeys([*self._held, *apart]))

    def measure(self, scene: Scene) -> Array:
        """Measure by how much each pair has come apart, or overlaps, m; 0 where it is as it may be."""
        gaps = measure_shapes(scene, self.pairs)
        off = list[float]()
        for pair, gap in zip(self.pairs, gaps, strict=True):
            if pair in self._held:
                off.append(gap - self._held[pair])
            else:
                off.append(min(gap, 0.0))

        return np.array(off)

    def _touches(self, scene: Scene, meeting: Meeting) -> bool:
        may_overlap = self._may_overlap(scene, meeting)
        deepest = TOUCHES_M if may_overlap else _SUNK_M
        return -deepest < meeting.gap_m < TOUCHES_M

    def _find_gap(self, scene: Scene, meeting: Meeting) -> float:
        """Return the gap to be held, m: as it began, and 0 where that was an overlap that is a mistake."""
        if meeting.gap_m > -OVERLAP_M or self._may_overlap(scene, meeting):
            return meeting.gap_m

        return 0.0

    def _may_overlap(self, scene: Scene, meeting: Meeting) -> bool:
        pair = frozenset((meeting.pair[0], meeting.pair[2]))
        return pair <= self._fixed or pair in scene.joined

    def _find_borne(self, meeting: Meeting) -> str:
        """Return the name of the body that rests on the other one; empty: none does."""
        name, _, other, _ = meeting.pair
        steepness = float(meeting.normal @ self._down)
        if steepness > _SAME:
            return name
        if steepness < -_SAME:
            return other

        return ""
