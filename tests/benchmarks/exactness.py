"""How exactly does an engine's arm move, give way under a load, and press? ``python -m tests.benchmarks.exactness``.

Writes the figures that prompts and ``vlmgineer facts`` show of a robot, as JSON, by engine.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from core.config.compose import engines
from core.design import RIGID_MOUNT, Component, Tool
from core.errors import UserError
from core.geometry import Array, Box, Pose, Vector
from core.interfaces import JointTrajectory, Robot, Rollout, Simulator
from core.plugins import installed
from core.robot.kinematics import arm_of
from core.scene import Body, State, table
from core.support.cli import command, say, write_bytes
from plugins.conformance.sample_tools import stick
from plugins.conformance.worlds import (
    GRAVITY,
    HOME,
    Bodies,
    cube,
    make_body,
    motion,
    still,
)
from tests.benchmarks import measuring

USAGE = "usage: python -m tests.benchmarks.exactness [robot=NAME] [sims=NAME,NAME,...] [output=FILE.json]"
TOOLS_KG = (0.0, 0.3, 1.0)
LOADS_KG = (
    0.3,
    1.0,
    2.0,
    3.0,
    4.0,
    5.0,
    6.0,
    8.0,
    10.0,
    11.0,
    12.0,
    13.0,
    14.0,
    16.0,
    18.0,
    20.0,
    25.0,
    30.0,
)
_HELD_M = 0.02  # a load that the arm holds lowers it by less
_STIFF_M = (
    5e-6  # by less for each kilogram, and the load is not seen in the arm's position
)
_ASIDE_M = 0.1  # of a load of 1 kg beside the flange
_STIFF_RAD = 1e-4  # by less, and it is not seen
_HANG_M = 0.25
_STICK_M = 0.15
_SIDE_M = 0.1
_INTO_M = 0.002
_HZ = 200.0

# Waypoints from home, by x, y, z, roll, pitch and yaw: far and fast, with turns.
_FAR = (
    (0.15, 0.3, -0.3, 0.0, 0.0, 0.0),
    (0.15, -0.3, -0.3, 0.0, 0.0, 0.8),
    (-0.1, -0.3, 0.1, 0.3, 0.4, 0.0),
    (-0.1, 0.3, 0.1, 0.0, -0.4, -0.8),
    (0.15, 0.0, 0.1, 0.0, -0.5, 0.0),
    (0.0, 0.0, -0.2, 0.0, 0.0, 0.0),
)


@dataclass
class Settings:
    """``output``: default is where the figures of the built-in robots lie."""

    robot: str = "panda"
    sims: list[str] = field(default_factory=lambda: ["pybullet", "sapien", "mujoco"])
    output: str = "plugins/robots/measured/{robot}.json"


class _Played:
    """A motion that was played: instants (T,), lag of joints (T, J), mount's poses (T, 4, 4) real and ordered, states.

    Raises:
        UserError: the engine failed to play it.
    """

    def __init__(
        self,
        simulator: Simulator,
        robot: Robot,
        tool: Tool,
        trajectory: JointTrajectory,
        *bodies: Body,
    ) -> None:
        (outcome,) = simulator.rollout(
            Bodies(*bodies, robot=robot), [Rollout(tool, trajectory, record_hz=_HZ)]
        )
        if outcome.error or outcome.recording is None:
            raise UserError(
                f"the arm can't be measured: {outcome.error or 'the engine recorded nothing'}"
            )
        ordered = trajectory.sample(outcome.recording.times)[0]
        self.states: State = outcome.recording.states
        self.moving = (outcome.recording.times >= 0) & (
            outcome.recording.times <= trajectory.duration
        )
        self.lag: Array = np.abs(outcome.recording.arm - ordered)
        place = arm_of(robot).forward
        self.real, self.ordered = (
            np.array([place(q).matrix for q in qs])
            for qs in (outcome.recording.arm, ordered)
        )

    def miss(self, point: Vector = (0.0, 0.0, 0.0)) -> Array:
        """Compute how far a point in the mount's frame is from where it is ordered: (T, 3), world axes."""
        miss: Array = self.at(point) - (self.ordered @ [*point, 1.0])[:, :3]
        return miss

    def at(self, point: Vector) -> Array:
        """Place a point in the mount's frame in the world: (T, 3)."""
        positions: Array = (self.real @ [*point, 1.0])[:, :3]
        return positions


def measure(simulator: Simulator, robot: Robot) -> dict[str, float | None]:
    """Measure all figures: millimetres, radians, kilograms and newtons, as their names say."""
    given_way = {**_loads(simulator, robot), **_turns(simulator, robot)}
    return {**_tracking(simulator, robot), **given_way, **_presses(simulator, robot)}


def _tracking(simulator: Simulator, robot: Robot) -> dict[str, float]:
    """Measure the largest lag in a far and fast motion, and the miss after it, with tools of some masses."""
    trajectory = motion(np.add(_FAR, [*HOME.position, 0.0, 0.0, 0.0]), robot)
    figures = {}
    for mass in TOOLS_KG:
        tool = (
            Tool((_component("weight", (0.06,) * 3, (0.0, 0.0, -0.1), mass),))
            if mass
            else Tool()
        )
        played = _Played(simulator, robot, tool, trajectory)
        miss = np.linalg.norm(played.miss(), axis=1)
        suffix = f"_{mass:g}kg" if mass else ""
        figures[f"lag_rad{suffix}"] = float(played.lag[played.moving].max())
        figures[f"lag_mm{suffix}"] = 1000 * float(miss[played.moving].max())
        figures[f"rest_mm{suffix}"] = 1000 * float(miss[-1])
    return figures


def _loads(simulator: Simulator, robot: Robot) -> dict[str, float | None]:
    """Put bodies of more and more mass below the flange, on a plate that the arm holds, until it gives way."""
    plate = _plate(0.12)
    on_it = HOME.position - (0.0, 0.0, _HANG_M - _SIDE_M / 2)
    sags: dict[float, float] = {}
    for mass in LOADS_KG:
        load = cube("load", on_it, _SIDE_M, mass)
        sag = -_Played(simulator, robot, plate, still(robot), load, _catch()).miss()[
            :, 2
        ]
        if sag.max() > _HELD_M:
            break
        sags[mass] = float(sag[-1])
    if len(sags) < 2:
        raise UserError(
            f"the arm can't be measured: a load of {LOADS_KG[len(sags)]:g} kg is too heavy for it"
        )
    half = [mass for mass in sags if mass <= max(max(sags) / 2, LOADS_KG[1])]
    per_kg = float(np.polyfit(half, [sags[mass] for mass in half], 1)[0])
    return {
        "sag_mm_1kg": 1000 * sags[1.0],
        "push_n_per_mm": GRAVITY / per_kg / 1000 if per_kg > _STIFF_M else None,
        "most_n": GRAVITY * max(sags),
    }


def _turns(simulator: Simulator, robot: Robot) -> dict[str, float | None]:
    """Put a body of 1 kg on a plate below the flange and beside that, and compare how far the arm turns about x."""
    rolls = []
    for aside in (0.0, _ASIDE_M):
        place = HOME.position + np.array([0.0, aside, _SIDE_M / 2 - _HANG_M])
        played = _Played(
            simulator,
            robot,
            _plate(0.36),
            still(robot),
            cube("load", place, _SIDE_M, 1.0),
            _catch(),
        )
        turn = played.real[-1, :3, :3] @ played.ordered[-1, :3, :3].T
        rolls.append(float(Rotation.from_matrix(turn).as_rotvec()[0]))
    turned = abs(rolls[1] - rolls[0])
    return {
        "turn_nm_per_rad": GRAVITY * _ASIDE_M / turned if turned > _STIFF_RAD else None
    }


def _catch() -> Body:
    """A fixed block below the plate, so that a load can't fall far: engines take finer steps for what can."""
    place = HOME.position - (0.0, 0.0, _HANG_M + 0.01 + 1.5 * _HELD_M + _SIDE_M / 2)
    wide = 2 * (_ASIDE_M + _SIDE_M / 2)
    return make_body("catch", Box((_SIDE_M, wide, _SIDE_M)), place)


def _plate(width: float) -> Tool:
    """A plate below the flange for loads, hung so that there is room for them."""
    return Tool(
        (
            _component("beam", (0.2, 0.04, 0.03), (-0.09, 0.0, -0.015)),
            _component("post", (0.02, 0.04, _HANG_M), (-0.18, 0.0, -_HANG_M / 2)),
            _component("plate", (0.27, width, 0.01), (-0.06, 0.0, -_HANG_M - 0.005)),
        )
    )


def _presses(simulator: Simulator, robot: Robot) -> dict[str, float]:
    """Send the tip of a stick 2 mm into the table, then 0.1 m along it; and into a cube of 0.1 kg on the table."""
    x = HOME.position[0]
    low = _STICK_M - _INTO_M
    tip = (0.0, 0.0, -_STICK_M)

    def press(top: float, *aside: float, bodies: tuple[Body, ...] = ()) -> _Played:
        way = [(x, 0.05), *((x + shift, 0.0) for shift in (0.0, *aside))]
        plan = [(at, 0.0, top + low + above, 0.0, 0.0, 0.0) for at, above in way]
        return _Played(
            simulator, robot, stick(_STICK_M), motion(plan, robot), table(), *bodies
        )

    down = press(0.0)
    slid = press(0.0, 0.1)
    heights = down.at(tip)[:, 2]
    touched = int(np.argmax(heights < max(heights[-1], 0.0) + 1e-5))
    pressed = press(
        0.05, bodies=(cube("cube", (x, 0.0, 0.025), 0.05, 0.1),)
    ).states.position("cube")
    return {
        "pressed_depth_mm": -1000 * float(heights[-1]),
        "pressed_lag_rad": float(down.lag[-1].max()),
        "pressed_slip_mm": 1000
        * float(np.linalg.norm(down.miss(tip)[touched:, :2], axis=1).max()),
        "pressed_bounce_mm": 1000 * max(0.0, float(heights[touched:].max())),
        "slid_miss_mm": 1000 * float(np.linalg.norm(slid.miss(tip)[-1, :2])),
        "pressed_cube_mm": 1000
        * float(np.linalg.norm(pressed - pressed[0], axis=1).max()),
    }


def _component(
    name: str, size: tuple[float, float, float], at: Vector, mass: float = 0.001
) -> Component:
    return Component(
        name, RIGID_MOUNT, Pose(np.asarray(at, dtype=np.float64)), Box(size), mass
    )


def main(words: list[str]) -> None:
    if words[:1] in (["--help"], ["-h"]):
        say(USAGE)
        return
    given = measuring.settings(words, Settings)
    figures = dict[str, dict[str, float | None]]()
    robot = installed().create("robot", given.robot)
    for name, sim in engines(given.sims).items():
        found = measure(sim.create(), robot)
        figures[name] = {
            key: None if figure is None else round(figure, 5) + 0.0
            for key, figure in found.items()
        }
    file = Path(given.output.format(robot=given.robot))
    write_bytes(file, (json.dumps(figures, indent=1) + "\n").encode())
    say(str(file))


if __name__ == "__main__":
    command(main)
