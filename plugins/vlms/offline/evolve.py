"""Breed offspring of elites: mutate and cross tools of any origin, and carry the elites' plans over to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from plugins.vlms.offline.parents import Parent
from plugins.vlms.offline.plan_variation import make_offspring_plans
from plugins.vlms.offline.sampler import Sampler
from plugins.vlms.offline.tool_variation import cross, mutate
from plugins.vlms.offline.written_design import Design

_TRIES = 12
_LEAST_REWARD = 0.01  # what earned nothing is a parent at times, too
_CROSSES = 0.4  # how often two different parents are crossed


def breed(
    parents: Sequence[Parent],
    count: int,
    sampler: Sampler,
) -> Design:
    """Breed one tool with ``count`` plans. Better elites are parents more often.

    Where no change keeps the rules, the tool is its parent's.

    Args:
        parents: the more they earned, the likelier they are chosen.
        count: of plans.
        sampler: which knows the rules, and samples fresh plans.
    """
    rng = sampler.rng
    weights = np.array([max(parent.reward, _LEAST_REWARD) ** 2 for parent in parents])
    shares = weights / weights.sum()

    for attempt in range(_TRIES):
        chosen = rng.choice(len(parents), 2, p=shares)
        first, second = (parents[int(number)] for number in chosen)
        crosses = second is not first and rng.random() < _CROSSES

        if crosses:
            tool, change = cross(first.tool, second.tool, rng)
        else:
            tool, change = mutate(first.tool, first.scale / (1 + attempt / 3), rng)

        if tool.components != first.tool.components and sampler.accepts(tool):
            break
    else:
        crosses = False
        tool = first.tool
        change = "other plans"

    name = "crossover" if crosses else "mutation"
    ids = [first.id, second.id] if crosses else [first.id]
    base = first.tool.description.split("; changed: ")[0]
    description = f"{base}; changed: {change}"
    tool = replace(tool, name=first.tool.name, description=description)

    return Design(
        f"{name}: {change}",
        f"{name.capitalize()} of {' and '.join(ids)}: {change}.",
        tool,
        make_offspring_plans(first, tool, count, sampler),
        ids,
    )
