"""Random choices that several modules make."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.random import Generator

K = TypeVar("K", bound=Hashable)


_HEAD_TURNS_RAD = np.array([0.0, 0.25, -0.25, 0.5, -0.5]) * np.pi
# How often each: a head that points ahead is stiffest, and the arm sees it.
_HEAD_TURNS = [0.6, 0.1, 0.1, 0.1, 0.1]


class Range(NamedTuple):
    """What a measure is drawn from, each value as likely: what may be right, and what evolution is to find out."""

    low: float
    high: float

    def draw(self, rng: Generator) -> float:
        """Draw a value."""
        return rng.uniform(self.low, self.high)


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
    return float(rng.choice(_HEAD_TURNS_RAD, p=_HEAD_TURNS))


def add_error(
    angle: float,
    error: float,
    rng: Generator,
    often: float = 0.5,
) -> float:
    """Add a random error to an angle, not every time.

    Args:
        angle: radians.
        error: its standard deviation, radians.
        rng: random numbers.
        often: the share of times.
    """
    drawn = rng.normal(0.0, error)
    return angle + float(drawn) if rng.random() < often else angle
