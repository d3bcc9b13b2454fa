"""Candidates, and what became of them."""

import numpy as np

from core.design import (
    Candidate,
    Tool,
)
from plugins.conformance.evaluations import tried_once


def candidate(*key):
    generation, agent, strategy, action = key
    return Candidate(Tool(), np.zeros((1, 6)), generation, agent, strategy, action)


def ok(reward, distance, key=(0, 0, 0, 0)):
    return tried_once(candidate(*key), "ok", reward=reward, distance_m=distance)


def evaluation(number, reward, status="ok", distance_m=1.0):
    candidate = Candidate(Tool(), np.zeros((1, 6)), 0, number, 0, 0)
    return tried_once(candidate, status, reward=reward, distance_m=distance_m)
