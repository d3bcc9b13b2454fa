"""A limit: bodies that stay in place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain
from typing import ClassVar, Self

import numpy as np

from core.errors import refuse
from core.geometry import Array
from core.goals.evidence import Evidence
from core.goals.goal import Given
from core.goals.keys import AboveZero, KeptNames, Key, Names
from core.goals.limit import Breach, Limit
from core.goals.reaching import Reach
from core.goals.sites import FREE_BODY, Site
from core.scene import Body, Scene
from core.values.joints import rotate
from core.values.margins import Margin
from core.values.states import State

KEPT_M = 0.02  # a body to keep may move so far
KEPT_DEG = 10.0  # and turn so far
STRAYED = 5  # and where it moved or turned so many times as far, nothing is earned
THROUGHOUT = "throughout"


@dataclass(frozen=True)
class Kept(Limit):
    """Bodies that must stay in place, as in ``Kept(("glass",), kept_m=0.01)``.

    Attributes:
        keep: their names.
        kept_m: how far each may move, m. The reward falls beyond that, to nothing at five times as far.
        throughout: whether the farthest place and turn of the whole motion count, or only those at the end.
        kept_deg: how far each may turn, degrees, likewise.
        balls: bodies whose turn can't be seen.
        rounds: bodies of which only the turn of the axis can be seen.
    """

    keep: Names
    kept_m: float = KEPT_M
    throughout: bool = False
    kept_deg: float = KEPT_DEG
    balls: Names = ()
    rounds: Names = ()

    orients: ClassVar = True
    keys: ClassVar = {
        "keep": Key(KeptNames, "Bodies to leave in place, or throughout", head=True),
        "kept_m": Key(AboveZero, "How far they may move, m"),
        "kept_deg": Key(AboveZero, "How far a body to keep may turn, degrees"),
        "throughout": Reach.keys["throughout"],
    }
    asks = (
        "leave {{ goal.keep | join(', ') }} in place{% if goal.throughout %} throughout{% endif %}: less is earned "
        "beyond {{ goal.kept_m | g }} m, nothing from {{ goal.lost_m | g }} m on"
    )
    names: ClassVar = {"keep": FREE_BODY}
    holds_untouched: ClassVar = True

    def __post_init__(self) -> None:
        problems = {
            "kept_m must be above 0": not self.kept_m > 0,
            "kept_deg must be above 0": not self.kept_deg > 0,
        }
        refuse("a goal's ", problems)

    @property
    def needs_trace(self) -> bool:
        """Whether it looks at what happened before the end."""
        return self.throughout

    @property
    def lost_m(self) -> float:
        """How far a body may move until nothing is earned, m."""
        return STRAYED * self.kept_m

    def _strayed(self, name: str, evidence: Evidence) -> tuple[Array, Array]:
        """Measure how far a body got from its start, m, and was turned, degrees, (...) each."""
        moved = evidence.moved(name)
        turned = self._turns(name, evidence.start, evidence.end)

        if self.throughout:
            start = evidence.start.each(lambda array: array[..., None, :, :])
            turns = self._turns(name, start, evidence.film.states)
            moved = np.maximum(moved, evidence.ways(name).max(axis=-1))
            turned = np.maximum(turned, turns.max(axis=-1))

        return moved, turned

    def _turns(self, name: str, start: State, now: State) -> Array:
        """Measure how far a body is turned from its start, degrees, (...)."""
        begin = start.quaternion(name)
        end = now.quaternion(name)
        if name in self.balls or name in start.soft:
            return np.zeros(now.positions.shape[:-2])

        cosines = np.abs((begin * end).sum(axis=-1))
        angles: Array = 2 * np.arccos(np.clip(cosines, 0.0, 1.0))
        if name in self.rounds:
            axis = np.array([0.0, 0.0, 1.0])
            along = (rotate(begin, axis) * rotate(end, axis)).sum(axis=-1)
            angles = np.arccos(np.clip(along, -1.0, 1.0))

        return np.asarray(np.degrees(angles))

    def share(self, evidence: Evidence) -> Array:
        share = np.ones(())
        for name in self.keep:
            moved, turned = self._strayed(name, evidence)
            most = np.maximum(moved / self.kept_m, turned / self.kept_deg)
            left = STRAYED - most
            share = share * np.clip(left / (STRAYED - 1), 0.0, 1.0)

        return share

    def margins(self, evidence: Evidence) -> list[Margin]:
        found = []
        for name in self.keep:
            moved, turned = map(float, self._strayed(name, evidence))
            found.append(Margin.at_most(f"{name} moved", moved, self.kept_m, "m"))
            found.append(Margin.at_most(f"{name} turned", turned, self.kept_deg, "deg"))

        return found

    def breaches(self, evidence: Evidence) -> Iterator[Breach]:
        times = evidence.film.times

        for name in self.keep:
            moved, turned = map(float, self._strayed(name, evidence))
            if turned > self.kept_deg:
                text = (
                    f"{name} turned by {turned:.0f} degrees, {self.kept_deg:g} allowed"
                )
                yield Breach(turned / self.kept_deg, float(times[-1]), text)
            if moved > self.kept_m:
                late = evidence.ways(name) > self.kept_m
                begun = times[late.argmax()] if late.any() else times[-1]
                allowed = f"{1000 * self.kept_m:g} mm allowed"
                text = f"{name} moved by {1000 * moved:.0f} mm, {allowed}"
                yield Breach(moved / self.kept_m, float(begun), text)

    @classmethod
    def prepare(cls, given: Given) -> Given:
        """Read ``bodies: NAMES`` and ``keep: throughout`` as ``keep: NAMES`` and ``throughout: true``."""
        if given.get("keep") != THROUGHOUT:
            return given

        kept = {key: value for key, value in given.items() if key != "bodies"}
        if "bodies" not in given or kept.keys() - {"keep", "kept_m", "kept_deg"}:
            raise ValueError(
                "keep needs names here; to say that bodies stay all the time, write keep: [NAME, ...] and throughout: "
                "true"
            )

        return {**kept, "keep": given["bodies"], THROUGHOUT: True}

    def fit(self, site: Site) -> Self:
        bodies = [site.scene[name] for name in self.keep]
        balls = [body.name for body in bodies if _is_round(body, ball=True)]
        rounds = [body.name for body in bodies if _is_round(body)]
        return replace(self, balls=tuple(balls), rounds=tuple(rounds))

    def find_warnings(self, where: str, scene: Scene) -> Iterator[str]:
        for name in self.keep:
            if scene[name].launched:
                yield f"{name} is to be kept, and begins to move"

    def find_conflict(self, wanted: Reach, scene: Scene) -> str:
        if wanted.ever and not self.throughout:  # it may come back
            return ""

        start = scene.state()
        moving = [part for part in wanted.parts if part.moves]
        far = dict[str, float]()
        for body in (body for body in wanted.bodies if body in self.keep):
            measures = chain(*(part.measures(body, start) for part in moving))
            way = max((float(measure.left(start)) for measure in measures), default=0)
            if way > self.kept_m:
                far[body] = way

        if not wanted.needs_some(len(wanted.bodies), len(far)):
            return ""

        body = min(far)
        return (
            f"{body} must get {far[body]:.3g} m from where it starts, and is to be kept within {self.kept_m:g} m of "
            "it; leave it out of keep, or give kept_m"
        )


def _is_round(body: Body, *, ball: bool = False) -> bool:
    """Report whether a body looks the same however it turns about its z; a ball: about any axis."""
    for part in body.collisions:
        offset = part.pose.position if ball else part.pose.position[:2]
        turned = part.pose.rotation.apply([0.0, 0.0, 1.0])
        upright = abs(float(turned[2])) > 1 - 1e-9
        alike = part.shape.is_ball or (not ball and part.shape.is_round and upright)
        if not alike or np.abs(offset).max() > 1e-9:
            return False

    return bool(body.collisions)
