"""Sets of tools that do many tasks."""

import numpy as np

from plugins.results.toolbox.cover import best_sets


def test_the_tool_that_does_most_of_what_is_left_is_added():
    covers = np.array(
        [[1, 1, 0, 0, 0], [0, 1, 1, 1, 0], [1, 0, 0, 0, 0], [0, 0, 0, 1, 0]], dtype=bool
    )
    assert best_sets(covers) == [[1], [1, 0]]  # nobody does the last task


def test_where_no_tool_does_a_task_none_is_chosen():
    assert best_sets(np.zeros((3, 2), dtype=bool)) == []
