"""Random choices that several modules make."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import TypeVar

import numpy as np
from numpy.random import Generator

K = TypeVar("K", bound=Hashable)

_HEAD_TURNS = (0.0, np.pi / 4, -np.pi / 4, np.pi / 2, -np.pi / 2)


def draw(weights: Mapping[K, float], rng: Generator) -> K:
    """Choose at random, by weights.

    Args:
        weights: of each choice; they need not add up to 1.
        rng: random numbers.
    """
    shares = np.array(list(weights.values()))
    chosen = rng.choice(len(shares), p=shares / shares.sum())
    return list(weights)[int(chosen)]


def draw_head_turn(rng: Generator) -> float:
    """Draw a turn of a head about z, radians: most often none, or by an eighth or a quarter."""
    return float(rng.choice(_HEAD_TURNS, p=[0.6, 0.1, 0.1, 0.1, 0.1]))
