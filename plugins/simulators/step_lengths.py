"""How long the steps of engines may be."""

from __future__ import annotations

import math

import numpy as np

from core.design import Tool
from core.designs.springs import bound_speeds, measure_lightness
from core.errors import UsageError, check_positive
from core.scene import Body, Scene
from core.solids.standing import MOST_HZ, list_flights

LONGEST_S = 0.02
WALL_M = 0.01  # what springs move goes no farther in a step than walls are thick
CARD_M = 0.004  # thinner bodies that fall on each other may pass through
GRIPS_HZ = (
    1000.0  # of what a tool holds: softer springs would let it sag by millimetres
)
MILD = 0.5  # of a joint's speed: what a damper may take of it in a step


def check_time_step(time_step: float) -> None:
    """Refuse a step, seconds, that no contact bears.

    Raises:
        UsageError: it is not above 0, or so long that contacts would break.
    """
    check_positive("sim.", time_step=time_step)
    if time_step > LONGEST_S:
        raise UsageError(
            f"sim.time_step must be at most {LONGEST_S} s, got {time_step}: contacts would break"
        )


def choose_step(
    tool: Tool, scene: Scene, time_step: float, steps_hz: float = 0.0
) -> float:
    """Return the time step that a tool and what moves by itself in a scene need, s, where others get ``time_step``.

    It is an integer part of that. There are ``steps_hz`` or more in a second.
    """
    rate = max(
        _find_rate_of_springs(tool),
        _find_rate_of_flights(tool, scene),
        GRIPS_HZ if tool.gripping else 0.0,
        steps_hz,
    )
    return time_step / max(1, math.ceil(rate * time_step))


def _find_rate_of_flights(tool: Tool, scene: Scene) -> float:
    """Return how many steps a second are needed so that what falls or is thrown goes through nothing.

    What it may hit is of the scene or of the tool.
    """
    thin = min((part.shape.thickness for part in tool.components), default=math.inf)
    rates = [
        flight._replace(thin=min(flight.thin, thin)).rate
        for flight in list_flights(scene)
    ]
    return min(max(rates, default=0.0), MOST_HZ)


def _find_rate_of_springs(tool: Tool) -> float:
    """Return how many steps a second the springs and dampers of a tool need.

    What they move turns by no more than a radian of its swing in a step.
    """
    if not tool.bearers:
        return 0.0
    joints = [bearer.joint for bearer in tool.bearers]
    lightness = measure_lightness(tool)
    swings = np.sqrt(lightness * [joint.stiffness for joint in joints])
    decays = lightness * [joint.damping / MILD for joint in joints]
    return float(np.max([swings, decays, bound_speeds(tool) / WALL_M]))


def spare_cards(scene: Scene, time_step: float) -> float:
    """Return the time step that a scene's cards need, s, where others get ``time_step``: half of it for two or more.

    A card that falls by a few centimetres sinks so far into another in one step that it may be pushed out below.
    """
    return time_step / 2 if sum(map(_is_card, scene.free)) > 1 else time_step


def _is_card(body: Body) -> bool:
    """Report whether a body is one thin shape."""
    shapes = [part.shape for part in body.collisions]
    return len(shapes) == 1 and shapes[0].thickness < CARD_M
