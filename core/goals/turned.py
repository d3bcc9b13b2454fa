"""A goal: an axis of bodies along a direction."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from core.geometry import Array, Vector
from core.goals.goal import Given
from core.goals.keys import AT, AXIS, TOLERANCE_DEG, Bound, Direction, Key
from core.goals.measures import SLIP_DEG, SLIP_RAD, Measure, measure_angle
from core.goals.reaching import Reach
from core.goals.sites import ANY_BODY, Site
from core.goals.wants import Want
from core.scene import Scene
from core.values.joints import rotate
from core.values.spans import Span
from core.values.states import State

HALF_TURN_DEG = 180.0
"""The largest angle between two directions."""

FAR_DEG = 100.0  # plans aim by a tenth of it within a span of angles
ALONG = 1e-3  # of a vector across a pole: it is along it


@dataclass(frozen=True, kw_only=True)
class Turned(Reach):
    """Bodies whose ``axis`` (3,) in their own frame must end along ``points`` (3,); both default to z.

    A cup that must stand upright is ``Turned(("cup",), axis=(0.0, 0.0, 1.0))``, and one that must lie down::

        Turned(("cup",), angle_deg=Span(low=60.0))

    Attributes:
        points: in the world, or in the frame of ``at``.
        at: the body or mark whose frame in the layout ``points`` refers to; None: the world.
        tolerance_deg: how far the axis may be off, degrees.
        angle_deg: instead of a tolerance, a `Span` of the angle between the two, 0 to 180 degrees.

    Raises:
        ValueError: one of the two has no length.
    """

    axis: Vector = (0.0, 0.0, 1.0)
    points: Vector = (0.0, 0.0, 1.0)
    at: str | None = None
    tolerance_deg: float = 10.0
    angle_deg: Span | None = None

    orients: ClassVar = True
    keys: ClassVar = {
        "axis": replace(AXIS, head=True, weak=True),
        "angle_deg": Key(
            Bound,
            "The angle between the axis and where it points at the end, degrees",
            head=True,
        ),
        "points": Key(
            Direction,
            "The direction in which the axis must point, in the world or in the frame of what it is at",
        ),
        "at": AT,
        "tolerance_deg": TOLERANCE_DEG,
    }
    asks = (
        "axis {{ vector(goal.axis, 3) }} must {% if goal.angle_deg %}be at {{ goal.angle_deg }} degrees to"
        "{% else %}point along{% endif %} {{ vector(goal.points, 3) }}{{ frame(goal.at) }}"
        "{% if not goal.angle_deg %}, within {{ goal.tolerance_deg | g }} degrees{% endif %}"
    )
    short = "turn {{ bodies }}"
    names: ClassVar = {"at": ANY_BODY}
    turns = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (np.any(self.axis) and np.any(self.points)):
            raise ValueError("a goal's axis and points need a length")

    def measures(self, body: str, start: State) -> Iterator[Measure]:
        points = np.divide(self.points, np.linalg.norm(self.points))
        if self.at is not None:
            points = rotate(start.quaternion(self.at), points)

        angle = measure_angle(body, self.axis, lambda _: points)
        name = f"angle of {body}"
        if self.angle_deg is not None:

            def angle_deg(state: State) -> Array:
                return np.asarray(np.degrees(angle(state)))

            yield from Measure.within(self.angle_deg, name, angle_deg, "deg", SLIP_DEG)
            return

        most = float(np.radians(self.tolerance_deg))
        yield Measure(name, angle, most, SLIP_RAD, "rad")

    @classmethod
    def translate(cls, key: str, given: Given) -> Given:
        return read_angle(key, given) if key == "angle_deg" else {}

    def find_faults(self, site: Site) -> Iterator[str]:
        yield from super().find_faults(site)
        yield from find_angle_faults(self.angle_deg)

    def add_want(self, want: Want, scene: Scene) -> Want:
        points = self.points
        if self.at is not None:
            turned = scene[self.at].pose.rotation.apply(points)
            points = tuple(turned.tolist())

        want = replace(
            want,
            axis=self.axis,
            points=points,
            tolerance_deg=self.tolerance_deg,
            reference=self.at or want.reference,
        )
        if self.angle_deg is None:
            return want

        # Of all directions at that angle, the nearest to where the first body's axis points now.
        body = scene[want.bodies[0]]
        now = unit(body.pose.rotation.apply(self.axis))
        pole = unit(np.asarray(points))
        angle = float(np.degrees(np.arccos(np.clip(now @ pole, -1.0, 1.0))))
        aim = self.angle_deg.aim(angle, FAR_DEG)

        away = now - (now @ pole) * pole
        if np.linalg.norm(away) < ALONG:
            away = _find_aside(pole, body.pose.position)

        aside = np.sin(np.radians(aim)) * unit(away)
        nearest = np.cos(np.radians(aim)) * pole + aside
        off = abs(self.angle_deg.aim(angle, 0.0) - aim)
        return replace(want, points=tuple(nearest.tolist()), tolerance_deg=off)


def read_angle(key: str, given: Given) -> Given:
    """Read an angle of a scene file's entry as a span, within its tolerance where it is a number."""
    tolerance = given.get("tolerance_deg", Turned.tolerance_deg)
    return {key: Span.about(given[key], tolerance)}


def find_angle_faults(wanted: Span | None) -> Iterator[str]:
    """Yield a line where there are no such angles between two directions, or turns."""
    if wanted is not None and (wanted.low > HALF_TURN_DEG or wanted.high < 0):
        yield "an angle goes from 0 to 180 degrees, whatever its direction, and so never there; write it within these"


def _find_aside(pole: Array, position: Array) -> Array:
    """Find a direction (3,) across a pole: away from the world's middle, or up where that is along the pole.

    Args:
        pole: unit vector (3,).
        position: of the body, (3,).
    """
    outward = np.array([position[0], position[1], 0.0])
    for way in (outward, np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])):
        across = way - (way @ pole) * pole
        if np.linalg.norm(across) > ALONG:
            return np.asarray(across)

    raise AssertionError("one of two axes is across any pole")


def unit(direction: Array) -> Array:
    """Return a vector (3,) of length 1 along a given one."""
    return np.asarray(direction / np.linalg.norm(direction))
