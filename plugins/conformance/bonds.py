"""Check bonds: they bear what they are said to bear, and let go in the step in which it is more."""

from __future__ import annotations

from core.interfaces import Simulator
from core.scene import Body, Bond, Box, Scene
from plugins.conformance.shared import between, near
from plugins.conformance.worlds import watch

_WEIGHT_N = 0.2 * 9.81
_RED = (0.9, 0.2, 0.1, 1.0)
_SETTLE_S = 0.1
_LID_N = 0.05 * 9.81
_CORNERS = ((-0.025, -0.025), (-0.025, 0.025), (0.025, -0.025), (0.025, 0.025))
_HUNG = (0.0, 0.0, 0.02)  # the middle of a block's top


def check_bonds_bear_what_they_are_said_to(simulator: Simulator) -> None:
    """Of two blocks that hang, one's bond bears 3 % more than its weight, and the other's 3 % less."""
    bodies = (_make_block("held", 0.0), _make_block("falls", 0.1))
    bonds = (
        Bond("strong", "held", 1.03 * _WEIGHT_N, origin=_HUNG),
        Bond("weak", "falls", 0.97 * _WEIGHT_N, origin=_HUNG),
    )
    scene = Scene(bodies, bonds=bonds)
    recording = watch(simulator, scene, 0.2, settle_s=_SETTLE_S, hz=1000.0).recording

    held = recording.states.position("held")[..., 2]
    near("the height of a block that a bond holds, m", held, held[0], 1e-3)
    force = recording.loads["strong"][-1]
    near("the force on a bond that holds a block, N", force, _WEIGHT_N, 0.02)

    begun = recording.loads["weak"].max()
    between("the force that breaks a bond, N", begun, 0.97 * _WEIGHT_N, _WEIGHT_N + 0.1)
    near("the force on a bond that broke, N", recording.loads["weak"][-1], 0.0, 0.0)
    fell = held[0] - recording.states.position("falls")[-1, 2]
    # By half the gravity times the square of 0.3 s, or of 0.05 s less where springs take up the load first.
    between("how far a block falls from a bond that breaks, m", fell, 0.29, 0.45)


def check_bonds_hold_bodies_to_each_other(simulator: Simulator) -> None:
    """Of two lids 1 mm above jars, one's four bonds hold it there, and the other's bear half of it: it comes to lie."""
    floor = Box((0.4, 0.8, 0.02))
    bodies = [Body.of("floor", floor, (1.1, 0.1, -0.01), mass=0.0, color=_RED)]
    bonds = []
    for name, shift, share in (("held", 0.0, 3.0), ("falls", 0.2, 0.5)):
        jar = Box((0.06, 0.06, 0.06))
        lid = Box((0.06, 0.06, 0.02))
        jar_name = f"{name}_jar"
        bodies.append(Body.of(jar_name, jar, (1.1, shift, 0.03), mass=0.3, color=_RED))
        bodies.append(Body.of(name, lid, (1.1, shift, 0.071), mass=0.05, color=_RED))
        for number, (x, y) in enumerate(_CORNERS):
            bonds.append(
                Bond(
                    f"{name}_{number}",
                    name,
                    share * _LID_N / 4,
                    parent=jar_name,
                    origin=(x, y, -0.0105),
                )
            )

    scene = Scene(tuple(bodies), bonds=tuple(bonds))
    recording = watch(simulator, scene, 0.5, settle_s=_SETTLE_S, hz=200.0).recording

    held = recording.states.position("held")[-1, 2]
    near("the height of a lid that bonds hold, m", held, 0.071, 3e-4)
    loads = [recording.loads[f"held_{number}"][-1] for number in range(4)]
    near("the sum of the forces on a lid's bonds, N", sum(loads), _LID_N, 0.05 * _LID_N)
    fell = recording.states.position("falls")[-1, 2]
    near("the height of a lid whose bonds broke, m", fell, 0.07, 3e-4)


def _make_block(name: str, shift: float) -> Body:
    """Make a block of 0.2 kg in the air, so far to the left."""
    block = Box((0.04, 0.04, 0.04))
    return Body.of(name, block, (1.1, shift, 1.0), mass=0.2, color=_RED)
