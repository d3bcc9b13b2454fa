import numpy as np

from core.geometry import Array
from core.goals import Untouched, limits_margins
from core.interfaces import Task
from core.scene import (
    Box,
    Camera,
    Elastic,
    Filling,
    Margin,
    Scene,
    Soft,
    State,
    Trace,
    floor,
    table,
)
from core.values.layouts import around, within
from tasks.assets import raised
from tasks.rewards import share

# Of its height at most, of the area that it covers at least.
FLAT = 0.7
WIDER = 1.25
HOLD_S = 1.0
PRESS_N = 30.0
DOUGH = (0.93, 0.82, 0.62, 1.0)


class SpreadSlab(Task):
    """Press an elastic slab flat and wide, and hold it so.

    Task: all of the slab must be lower, and cover more, for the last second; it bears at most 30 N, and hand and arm
    must not touch it.
    Layouts: in ``near`` the slab lies a little elsewhere and turned; in ``wide`` it lies anywhere before the robot,
    and its size, height, stiffness, weight and friction differ.
    Success: nowhere higher than 0.7 of its height at the start, and 1.25 times the area that it covered then.
    """

    name = "SpreadSlab"
    description = (
        "A slab of soft, springy dough, 0.09 to 0.11 m square and 0.04 to 0.05 m high, lies on the table; the frame of "
        "slab is in its middle. Press it flat, and hold it: for the last second no part of it may be higher than 0.7 "
        "of its height at the start, and it must cover 1.25 times the area that it covered then, as seen from above. "
        f"It springs back if let go. Nothing is earned if it is pressed with more than {PRESS_N:g} N, or if hand, "
        "fingers or arm touch it."
    )
    in_words = (
        "A square slab of soft, springy dough lies on the table; the frame of slab is in its middle. Press it flat, "
        "and hold it: for the last second no part of it may be higher than 0.7 of its height at the start, and it must "
        "cover 1.25 times the area that it covered then, as seen from above. It springs back if let go. Nothing is "
        "earned if it is pressed with more than 30 N, or if hand, fingers or arm touch it."
    )
    goals = (Untouched(("slab",), max_force_n=PRESS_N, mean=True),)
    variations = {
        "near": around("slab", (0.5, 0.0), 0.03, 0.3),
        "wide": {
            **within(
                "slab",
                x=(0.42, 0.6),
                y=(-0.2, 0.2),
                yaw=(-0.75, 0.75),
                side=(0.09, 0.11),
                height=(0.04, 0.05),
            ),
            **within(
                "slab", density=(250, 500), young=(1.5e3, 2.2e3), friction=(0.3, 0.6)
            ),
        },
    }
    camera = Camera(position=(0.1, -0.6, 0.5), target=(0.5, 0.0, 0.05))

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        side = draw("slab.side", 0.1)
        height = draw("slab.height", 0.045)
        form = Filling(Box((side, side, height)), (4, 4, 2))
        friction = draw("slab.friction", 0.4)
        elastic = Elastic(
            draw("slab.density", 400), draw("slab.young", 1.8e3), 0.45, 0.05, friction
        )
        lies = draw.pose("slab", (0.5, 0.0, 0.0)) @ raised(
            height / 2 + form.thickness / 2
        )
        return Scene(
            (floor(), table(), Soft.make("slab", form, elastic, lies, color=DOUGH))
        )

    def reward(self, start: State, end: State, trace: Trace | None = None) -> Array:
        """By how flat and how wide it is, whichever is less, at the worst instant of the last second: up to 0.06 for
        six tenths of it, up to 1 for all; nothing if it was pressed too hard, or touched by hand or arm."""
        assert trace is not None
        held = trace.states.each(
            lambda array: array[..., trace.times >= trace.times[-1] - HOLD_S, :, :]
        )
        flat, wide = (part.min(axis=-1) for part in self.shares(start, held))
        harmed = (trace.force_n("slab", "robot") > PRESS_N) | trace.touched(
            "slab", "arm"
        )
        done = share(np.minimum(flat, wide))
        return np.maximum(0.1 * done, (done - 0.6) / 0.4) * ~harmed

    def margins(
        self, start: State, end: State, trace: Trace | None = None
    ) -> list[Margin]:
        flat, wide = (float(share) for share in self.shares(start, end))
        height = 1 - (1 - FLAT) * flat
        area = 1 + (WIDER - 1) * wide
        return [
            *limits_margins(self, start, end, trace),
            Margin.at_most("height", height, FLAT, "of the start's"),
            Margin.at_least("area", area, WIDER, "of the start's", 0.1),
        ]

    @staticmethod
    def shares(start: State, now: State) -> tuple[Array, Array]:
        """How much of what is asked the slab is lower, and covers more, in states (...)."""
        top, high = (state.nodes("slab")[..., 2].max(axis=-1) for state in (now, start))
        area = now.covered_area("slab")
        before = start.covered_area("slab")
        if np.ndim(area) > np.ndim(before):  # instants of each world
            high = high[..., None]
            before = before[..., None]
        return (1 - top / high) / (1 - FLAT), (area / before - 1) / (WIDER - 1)
