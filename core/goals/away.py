"""A goal: bodies away from where they start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

from core.geometry import Array
from core.goals.evidence import length
from core.goals.keys import AT, NODE, Key, Most
from core.goals.measures import SLIP_M, Measure
from core.goals.reaching import Reach
from core.goals.sites import ANY_BODY
from core.goals.wants import Want
from core.scene import Scene
from core.values.states import State


@dataclass(frozen=True, kw_only=True)
class Away(Reach):
    """Bodies that must end at least ``away`` m from where they start, in any direction.

    A lid that must end 0.1 m from its jar: ``Away(("lid",), away=0.1, at="jar")``.

    Attributes:
        at: the body or mark that they leave, as a hint to planners; the distance counts from their start.
        node: of soft bodies, the number of the node that counts; None: the centre of mass.
    """

    away: float
    at: str | None = None
    node: int | None = None

    keys: ClassVar = {
        "away": Key(Most, "How far from the start they must end, m", way=True),
        "at": AT,
        "node": NODE,
    }
    asks = "must get {{ goal.away | g }} m away from where it starts"
    short = "move {{ bodies }} by {{ goal.away | g(2) }} m"
    names: ClassVar = {"at": ANY_BODY}
    moves = True
    from_start = True

    def measures(self, body: str, start: State) -> Sequence[Measure]:
        begin = start.position(body, self.node)

        def way(state: State) -> Array:
            return length(state.position(body, self.node) - begin)

        return [Measure(f"way of {body}", way, self.away, SLIP_M, "m", at_least=True)]

    def add_want(self, want: Want, scene: Scene) -> Want:
        return replace(want, away=self.away, reference=self.at or want.reference)
