"""The instants of a film strip."""

from itertools import pairwise

import numpy as np
import pytest

from core.interfaces import Contact, Observation, Recording
from core.scene import Camera, State
from core.simulation.projection import project
from plugins.vlms.context.levels import Pictures
from plugins.vlms.context.strip import APART_S, FRAMES, SIZE, draw_strip, moments


def recorded(height, touched_s=None):
    """A recording of 4 s in which a cube rises to ``height`` (T,) from 1 s on, after half a second of settling."""
    times = np.arange(-0.5, 4.01, 0.1)
    positions = np.zeros((len(times), 2, 3))
    positions[:, 0, 2] = height(times)
    states = State(
        ("cube", "idle"), positions, *(np.zeros((len(times), 2, n)) for n in (4, 3, 3))
    )
    return Recording(
        times, np.zeros((len(times), 7)), np.zeros((len(times), 2)), states
    )


def lifted(times):
    return np.interp(times, [1.0, 1.8, 2.6], [0.0, 0.3, 0.0])


def test_a_strip_shows_the_instants_at_which_something_happens():
    found = moments(recorded(lifted))
    assert len(found) == FRAMES
    by_name = {what: instant for instant, what in found}
    assert by_name["start"] == 0.0
    assert by_name["end"] == pytest.approx(4.0)
    assert by_name["cube moves"] == pytest.approx(1.1)
    assert by_name["cube is highest"] == pytest.approx(1.8)
    assert all(after - before >= APART_S for (before, _), (after, _) in pairwise(found))
    assert not any("idle" in what for _, what in found)


def test_a_strip_looks_at_what_moves_so_that_ten_millimetres_are_seen():
    aims = []

    def draw(number, aim):
        aims.append(aim)
        return np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8)

    picture = draw_strip(recorded(lifted), draw)
    assert picture.shape == (2 * SIZE[1], 3 * SIZE[0], 3)
    camera = aims[0](Camera())
    ends = project(camera, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.3]]), *SIZE)
    assert ((ends > 0) & (ends < SIZE)).all()
    assert np.linalg.norm(np.diff(ends, axis=0)) > 30 * 3  # 3 pixels for 10 mm
    aims.clear()
    draw_strip(recorded(np.zeros_like), draw)
    assert aims == [None] * FRAMES


def test_what_was_observed_comes_before_what_is_computed():
    contacts = tuple(
        Contact("tool", f"part{n}", f"body{n % 2}", 0.9 + n, 2.0 + n, 0.0)
        for n in range(3)
    )
    contacts = (Contact("body", "cube", "table", 0.1, 4.0, 0.0), *contacts)
    found = moments(
        recorded(lifted), Observation("dropped", "cube", 2.4, contacts=contacts)
    )
    names = [what for _, what in found]
    assert names == [
        "start",
        "part0 touches body0",
        "cube moves",
        "part1 touches body1",
        "dropped: cube",
        "end",
    ]
    assert [instant for instant, _ in found][1] == 0.9


def test_where_pictures_alone_tell_no_number_of_a_body_is_written_on_a_strip():
    def draw(number, aim):
        return np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8)

    def observed(what):
        return Observation("forbidden", what, 2.4)

    told = observed("cup moved by 17.2 mm, 15 mm allowed")
    hidden = observed("cup moved by some mm, some mm allowed")
    rollout = recorded(lifted)
    drawn = Pictures().strip(rollout, draw, told)
    assert np.array_equal(drawn, draw_strip(rollout, draw, hidden))
    assert not np.array_equal(drawn, draw_strip(rollout, draw, told))


def test_a_strip_of_a_rollout_in_which_nothing_moves_is_even():
    found = moments(recorded(np.zeros_like))
    assert [what for _, what in found] == ["start", "", "", "", "", "end"]
    assert max(b - a for (a, _), (b, _) in pairwise(found)) <= 2 * min(
        b - a for (a, _), (b, _) in pairwise(found)
    )
    short = Recording(
        np.zeros(1),
        np.zeros((1, 7)),
        np.zeros((1, 2)),
        State((), *(np.zeros((1, 0, n)) for n in (3, 4, 3, 3))),
    )
    assert [instant for instant, _ in moments(short)] == [0.0] * FRAMES
