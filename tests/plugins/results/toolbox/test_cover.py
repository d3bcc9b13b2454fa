"""Covers, compared with all sets of tools."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.extra.numpy import array_shapes, arrays

from plugins.results.toolbox.cover import best_sets, greedy

COVERS = arrays(np.bool_, array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=6))


def done(covers, tools):
    return int(covers[list(tools)].any(axis=0).sum())


def most(covers, size):
    """The most tasks that any set of at most so many tools does."""
    sizes = range(min(size, len(covers)) + 1)
    return max(done(covers, tools) for n in sizes for tools in combinations(range(len(covers)), n))


@given(COVERS)
@settings(deadline=None, max_examples=60)
def test_each_set_does_as_much_as_any_of_its_size_and_the_last_does_all(covers):
    sets = best_sets(covers)
    for size, tools in enumerate(sets, 1):
        assert len(set(tools)) == len(tools) <= size
        assert done(covers, tools) == most(covers, size)
    assert sum(len(tools) for tools in sets) == sum(range(len(sets) + 1))  # each is needed: fewer would do less
    assert (done(covers, sets[-1]) if sets else 0) == covers.any(axis=0).sum()


@given(COVERS)
@settings(deadline=None)
def test_one_by_one_each_tool_adds_the_most_and_all_is_done(covers):
    steps = greedy(covers)
    for count, tool in enumerate(steps):
        gains = [done(covers, [*steps[:count], i]) for i in range(len(covers))]
        assert tool == int(np.argmax(gains))
        assert gains[tool] > done(covers, steps[:count])
        assert gains[tool] >= (1 - 1 / np.e) * most(covers, count + 1)  # Nemhauser, Wolsey and Fisher, 1978
    assert done(covers, steps) == covers.any(axis=0).sum()


@pytest.mark.parametrize("choose", [best_sets, greedy])
def test_where_no_tool_does_a_task_none_is_chosen(choose):
    assert choose(np.zeros((3, 2), dtype=bool)) == []


def test_the_best_set_may_be_smaller_than_one_by_one():
    covers = np.array([[1, 1, 1, 1, 0, 0], [1, 1, 0, 0, 1, 0], [0, 0, 1, 1, 0, 1]], dtype=bool)
    assert greedy(covers) == [0, 1, 2]
    assert best_sets(covers) == [[0], [1, 2]]
