"""Covers, compared with all sets of tools."""

import itertools

import numpy as np
from hypothesis import given, settings
from hypothesis.extra.numpy import array_shapes, arrays

from plugins.results.toolbox.cover import best_sets

COVERS = arrays(np.bool_, array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=6))


def done(covers, tools):
    return int(covers[list(tools)].any(axis=0).sum())


def most(covers, size):
    return max(done(covers, tools) for tools in itertools.combinations(range(len(covers)), min(size, len(covers))))


@given(COVERS)
@settings(deadline=None, max_examples=60)
def test_each_set_does_as_much_as_any_of_its_size_and_the_last_does_all(covers):
    sets = best_sets(covers)
    for size, tools in enumerate(sets, 1):
        assert len(set(tools)) == len(tools) <= size
        assert done(covers, tools) == most(covers, size)
    assert sum(len(tools) for tools in sets) == sum(range(len(sets) + 1))  # each is needed: fewer would do less
    assert (done(covers, sets[-1]) if sets else 0) == covers.any(axis=0).sum()


def test_where_no_tool_does_a_task_none_is_chosen():
    assert best_sets(np.zeros((3, 2), dtype=bool)) == []
