"""Check bonds: they bear what they are said to bear, and let go in the step in which it is more."""

from __future__ import annotations

from itertools import product

from core.interfaces import Simulator
from core.scene import Bond, Box
from plugins.conformance.shared import between, near
from plugins.conformance.worlds import GRAVITY, cube, make_body, watch

_WEIGHT_N = 0.2 * GRAVITY
_LID_N = 0.05 * GRAVITY


def check_bonds_bear_what_they_are_said_to(simulator: Simulator) -> None:
    """Of two blocks that hang, one's bond bears 3 % more than its weight, and the other's 3 % less."""
    blocks = []
    bonds = []
    for name, y, share in (("held", 0.0, 1.03), ("falls", 0.1, 0.97)):
        blocks.append(cube(name, (1.1, y, 1.0), side=0.04, mass=0.2))
        top = (0.0, 0.0, 0.02)
        bonds.append(Bond(f"{name} by", name, share * _WEIGHT_N, origin=top))

    hung = tuple(bonds)
    played = watch(
        simulator, *blocks, bonds=hung, settle_s=0.1, hold_s=0.2, record_hz=1000.0
    )
    bears, breaks = played.recording.loads.values()

    held = played.path("held")[:, 2]
    near("the height of a block that a bond holds, m", held, held[0], 1e-3)
    near("the force on a bond that holds a block, N", bears[-1], _WEIGHT_N, 0.02)

    most = breaks.max()
    between("the force that breaks a bond, N", most, 0.97 * _WEIGHT_N, _WEIGHT_N + 0.1)
    near("the force on a bond that broke, N", breaks[-1], 0.0, 0.0)
    fell = held[0] - played.path("falls")[-1, 2]
    # By half the gravity times the square of 0.3 s, or of 0.05 s less where springs take up the load first.
    between("how far a block falls from a bond that breaks, m", fell, 0.29, 0.45)


def check_bonds_hold_bodies_to_each_other(simulator: Simulator) -> None:
    """Of two lids 1 mm above jars, one's four bonds hold it there, and the other's bear half of it: it comes to lie."""
    bodies = [make_body("floor", Box((0.4, 0.8, 0.02)), (1.1, 0.1, -0.01))]
    bonds = []
    for name, y, share in (("held", 0.0, 3.0), ("falls", 0.2, 0.5)):
        jar = cube(f"{name}_jar", (1.1, y, 0.03), side=0.06, mass=0.3)
        lid = make_body(name, Box((0.06, 0.06, 0.02)), (1.1, y, 0.071), 0.05)
        bodies += [jar, lid]
        for corner in product((-0.025, 0.025), repeat=2):
            place = (*corner, -0.0105)
            load = share * _LID_N / 4
            named = f"{name} {corner}"
            bonds.append(Bond(named, name, load, parent=jar.name, origin=place))

    closed = tuple(bonds)
    played = watch(simulator, *bodies, bonds=closed, settle_s=0.1, hold_s=0.5)

    near(
        "the height of a lid that bonds hold, m",
        played.path("held")[-1, 2],
        0.071,
        3e-4,
    )
    borne = 0.0
    for bond in bonds[:4]:
        borne += played.recording.loads[bond.name][-1]
    near("the sum of the forces on a lid's bonds, N", borne, _LID_N, 0.05 * _LID_N)
    near(
        "the height of a lid whose bonds broke, m",
        played.path("falls")[-1, 2],
        0.07,
        3e-4,
    )
