"""Choose a head for an errand, and its size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from plugins.vlms.offline.heads import Head, blade, cage, fork, hook, pen, rake, scoop, wedge
from plugins.vlms.offline.scene_analysis import UP, Errand

_LEAST_M = 0.003  # clearance between a head and the bodies inside it


@dataclass(frozen=True)
class _Measures:
    """Sizes in metres of an errand's bodies along their way, and the clearance on their right and left."""

    along: float
    across: float
    tall: float
    rooms: tuple[float, float]

    @property
    def widest(self) -> float:
        return self.across + 2 * min(self.rooms) - 0.002


def sample_head(errand: Errand, rng: np.random.Generator, stout: float = 1.0) -> Head:
    """A head of a suitable family at random, sized by the bodies; walls are ``stout`` times as thick as usual."""
    rear, front = errand.span(errand.heading)
    right, left = errand.span(errand.heading + np.pi / 2)
    tall = float(errand.upper[2] - errand.lower[2])
    measures = _Measures(front - rear, left - right, tall, errand.rooms(errand.heading))
    rises, falls = errand.shift[2] > 0.03, errand.shift[2] < -0.1
    # A body that falls is pushed horizontally and goes down by itself.
    barred = errand.length > 0.03 and errand.blocked(errand.shift * np.array([1.0, 1.0, float(not falls)]))
    if rises or (barred and rng.random() < 0.8) or (falls and rng.random() < 0.3):
        return _lifter(errand, measures, rng, stout)
    if rng.random() < (0.8 if errand.covered else 0.08):
        return _hook(errand, measures, rng, stout)
    return _pusher(errand, measures, rng, stout)


def _pusher(errand: Errand, m: _Measures, rng: np.random.Generator, stout: float) -> Head:
    """A head that moves bodies horizontally, by its face or by enclosing them."""
    thick = stout * rng.uniform(0.004, 0.012)
    height = float(np.clip(m.tall * rng.uniform(0.5, 1.3), 0.02, 0.15))
    kinds = {"blade": 2.0, "peg": 0.7}
    spare = rng.uniform(0.004, 0.04)
    if m.widest > m.across + 0.02:
        kinds |= {"cage": 3.0, "pen": 1.2, "funnel": 1.0, "wedge": 1.0, "rake": 0.7}
        spare = max(_LEAST_M, min(spare, (m.widest - m.across) / 2 - thick))
    names, weights = list(kinds), np.array(list(kinds.values()))
    match names[int(rng.choice(len(names), p=weights / weights.sum()))]:
        case "blade":
            return blade(min(m.widest, m.across * rng.uniform(0.7, 2.0)), height, thick)
        case "peg":
            side = min(m.widest, rng.uniform(0.012, 0.035))
            return blade(side, height, min(side, 0.02))
        case "cage":
            return cage(m.across + 2 * spare, m.along * rng.uniform(0.4, 1.1), height, thick)
        case "pen":
            return pen(m.across + 2 * spare, m.along + 2 * spare, height, thick)
        case "funnel":
            depth, splay = m.along * rng.uniform(0.4, 1.0), rng.uniform(0.1, 0.6)
            return cage(m.across + 2 * spare, depth, height, thick, splay)
        case "wedge":
            half = rng.uniform(0.6, 1.2)
            return wedge(m.across * rng.uniform(0.6, 1.2) / np.sin(half), half, height, thick)
        case _:
            smallest = min(float(np.ptp(thing.points[:, :2], axis=0).min()) for thing in errand.things)
            return rake(min(m.widest, m.across * rng.uniform(1.0, 1.6)), height, thick, 0.6 * smallest)


def _lifter(errand: Errand, m: _Measures, rng: np.random.Generator, stout: float) -> Head:
    """A head that goes under the bodies, or under their overhang if they have one."""
    height = float(np.clip(m.tall * rng.uniform(0.7, 1.3), 0.02, 0.2))
    depth = m.along * rng.uniform(0.75, 1.15)
    overhang = _overhang(errand)
    if overhang is not None and rng.random() < 0.8:
        under, base = overhang
        tine = max(0.004, (m.across / 2 - base) * rng.uniform(0.5, 1.2))
        thin = float(np.clip(under * rng.uniform(0.3, 0.7), 0.002, stout * 0.01))
        level = max(0.0, under - thin - rng.uniform(0.003, 0.02))
        return fork(2 * base + rng.uniform(0.004, 0.016), depth, height, tine, thin, level=level)
    if rng.random() < 0.2:
        tine = m.across * rng.uniform(0.08, 0.2)
        return fork(m.across * rng.uniform(0.4, 0.7), depth, height, tine, stout * 0.002, int(rng.integers(2, 5)))
    rail = 0.0 if rng.random() < 0.3 else m.tall * rng.uniform(0.1, 0.6)
    width = min(m.across + rng.uniform(0.005, 0.04), max(m.widest, 0.6 * m.across))
    return scoop(width, depth, height, rail, stout * rng.uniform(0.001, 0.003))


def _overhang(errand: Errand) -> tuple[float, float] | None:
    """Height of an overhang above the bodies' foot, and half the width below it; None: there is no overhang."""
    boxes, foot = errand.boxes, errand.lower[2]
    side = np.array([-np.sin(errand.heading), np.cos(errand.heading), 0.0])
    halves = np.abs(boxes.axes.transpose(0, 2, 1) @ side * boxes.halves).sum(axis=1)
    across = np.abs((boxes.centers - errand.center) @ side) + halves
    low = boxes.lower[:, 2] < foot + 0.004
    over = ~low & (across > across[low].max() + 0.006)
    if not over.any():
        return None
    under = float(boxes.lower[over, 2].min() - foot)
    below = ~over & (boxes.lower[:, 2] < foot + under)
    return under, float(across[below].max())


def _hook(errand: Errand, m: _Measures, rng: np.random.Generator, stout: float) -> Head:
    """A head that passes beside or over the bodies, and pulls them from behind."""
    sides = [(m.rooms[0], np.array([0.0, -1.0, 0.0])), (m.rooms[1], np.array([0.0, 1.0, 0.0])), (errand.headroom, UP)]
    weights = np.array([min(room, 0.1) + 1e-3 for room, _ in sides])
    room, outward = sides[int(rng.choice(3, p=weights / weights.sum()))]
    over = outward[2] > 0.5
    thick = float(np.clip(room * stout * rng.uniform(0.1, 0.25), 0.003, stout * 0.014))
    gap = min(0.004, 0.1 * room)
    longest = m.tall if over else m.across
    toe = float(np.clip((room - thick - gap) * rng.uniform(0.5, 0.9), 0.004, longest * rng.uniform(0.5, 1.0)))
    breadth = (m.across if over else m.tall) * rng.uniform(0.4, 0.9)
    length = m.along + (errand.length * rng.uniform(0.9, 1.4) if errand.covered else rng.uniform(0.02, 0.1))
    return hook(length, toe, breadth, thick, gap, outward)
