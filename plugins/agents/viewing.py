"""Draw what an agent asks to see: the scene from a view, and film strips of trials."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from core.errors import choices
from core.events import Run
from core.interfaces import Evaluation, Picture, Score, Trial
from core.plugins import installed
from core.scene import Camera, View
from core.search.designer import Artist
from plugins.agents.arguments import Look
from plugins.agents.bench import Refused

SCENE = "scene"
_DRAWN_BY = "pictures"
"""The level of ``prompt.context`` that has the named views; every level may show them."""
_NEAR_M = 1e-3  # what is nearer is looked at from nowhere
_CUT = ("front", "side", "top")


def draw_scene(run: Run, asked: Look, shown: View) -> Picture:
    """Draw a run's scene with its bodies where they begin, with names and scales; the caption says where one stands.

    Args:
        run: has the task, and an engine that is idle while an agent's call is answered.
        asked: a named view, or a camera.
        shown: the tool, the layout, and how the arm stands.

    Raises:
        NoPicture: nothing here can draw.
        Refused: no such view, or a camera that can't stand there.
    """
    assert run.simulator is not None
    level = installed().factory("level", _DRAWN_BY)()
    wanted = _choose_camera(asked, level.views, run.task.camera)
    render = partial(run.simulator.render, run.task, **shown)
    picture: Picture
    (picture,) = level.draw(run.task, shown["seed"], render, wanted, asked.cut)
    return picture


def _choose_camera(asked: Look, views: Sequence[str], usual: Camera) -> str | Camera:
    """Return the name of the view that is asked for, or the camera, which is else as the task's."""
    if asked.position is None:
        name = asked.view or SCENE
        if asked.target is not None or asked.fov_deg is not None:
            raise Refused("look: target and fov_deg go with position")
        if name not in views:
            raise Refused(str(choices("view", name, views)))
        if asked.cut is not None and name not in _CUT:
            raise Refused(f"look: cut goes with the views {', '.join(_CUT)}")
        return name

    if asked.view is not None or asked.cut is not None:
        raise Refused("look: give position, or else view and cut")

    x, y, z = asked.position
    target = tuple(asked.target or usual.target)
    if math.dist((x, y, z), target) < _NEAR_M:
        raise Refused("look: position and target are the same place")
    fov_deg = asked.fov_deg or usual.fov_deg
    return replace(usual, position=(x, y, z), target=target, fov_deg=fov_deg)


def draw_trial(artist: Artist, evaluation: Evaluation, trial: Trial) -> Picture:
    """Draw a film strip of one trial of a candidate.

    Raises:
        Refused: it can't be drawn.
    """
    alone = Evaluation(evaluation.candidate, (trial,), Score(trial.reward))
    strip = artist.draw_strip(alone)
    if strip is None:
        raise Refused(
            f"watch: the trial of {evaluation.candidate.id} can't be drawn on this machine"
        )

    where = f"layout {trial.layout}, reward {trial.reward:.3f}"
    caption = (
        f"{evaluation.candidate.id}, {where}: six instants of its motion, in reading order, each with its time and "
        "what happens then; played again in the run's own engine"
    )
    return replace(strip, caption=caption)
