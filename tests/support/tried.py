"""Candidates that were tried, with what was seen."""

import numpy as np

from core.design import Candidate, Component, Tool
from core.geometry import Box, Pose
from core.interfaces import Contact, Observation
from core.trial import Evaluation, Score, Trial, Where
from core.values.observations import Moved

SEEN = Observation(
    "missed",
    moved={
        "cube": Moved((-0.3, 0.012, 0.0), (0.7, 0.012, 0.035), 2.04),
        "can": Moved((0.0, 0.0, 0.0), (1, 1, 0), 0.0),
    },
    errors={"cube": (0.1, 0.012, None)},
    left=("cube",),
    contacts=(
        Contact("tool", "tip", "cube", 1.2, 3.4, 0.0012),
        Contact("tool", "stem", "cube", 1.5, 1.6, 0.0),
        Contact("arm", "panda_link7", "shelf", 2.0, 2.2, -0.0004, 12.0),
    ),
    clearances={"table": 0.0123, "floor": 0.6},
    nearest={"table": ("stem", 1.2)},
    miss=(3, 0.012, 0.02),
    lag_rad=0.03,
    lag_s=2.1,
    arrivals=(1.0, 2.0, 3.0),
    instants=(0.0, 3.4),
    paths={"cube": ((1.0, 0.0, 0.035), (0.7, 0.012, 0.035))},
)


ROD = Tool(
    (
        Component(
            "rod",
            "tool_mount",
            Pose.xyz_rpy((0.0, 0.0, -0.1)),
            Box((0.02, 0.02, 0.2)),
        ),
    )
)


def trial(layout=0, engine="mujoco", **given):
    return Trial(Where("Slide", engine, layout), **given)


def tried(number=0, reward=0.5, seen=SEEN, generation=0, **given):
    """A candidate with one trial, of which ``given`` are further fields."""
    return tried_in(
        trial(reward=reward, observation=seen, **given),
        number=number,
        generation=generation,
    )


def tried_in(*trials, reward=None, shown=0, number=0, generation=0):
    candidate = Candidate(
        ROD, np.zeros((1, 6)), generation, 0, number // 10, number % 10
    )
    return Evaluation(
        candidate,
        trials,
        Score(trials[shown].reward if reward is None else reward, shown=shown),
    )
