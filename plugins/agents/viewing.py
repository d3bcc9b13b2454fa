"""Draw what an agent asks to see: the scene from a view, and film strips of trials."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from core.errors import choices
from core.events import Run
from core.interfaces import Evaluation, Picture, Score, Task, Trial
from core.plugins import installed
from core.scene import Camera, Scene, State, View
from core.search.designer import Aim, Artist
from core.support.text import clean
from plugins.agents.arguments import FromCamera, Look, Watch
from plugins.agents.bench import Refused

SCENE = "scene"
_DRAWN_BY = "pictures"
"""The level of ``prompt.context`` that has the named views; every level may show them."""
_NEAR_M = 1e-3  # what is nearer is looked at from nowhere
_FOLLOWED_M = 0.3  # from the top to the bottom of a picture that follows a body
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


def find_aim(asked: Watch, scene: Scene, usual: Camera) -> Aim | None:
    """Return what makes the camera of each frame of a film strip; None: it is as usual, close to what moves.

    Raises:
        Refused: no such body, or a camera that can't stand there.
    """
    wishes = (asked.position, asked.target, asked.fov_deg, asked.body)
    if all(wish is None for wish in wishes):
        return None

    camera = _place_camera(asked, usual)
    if asked.body is None:
        return lambda _, state: camera
    if asked.target is not None:
        raise Refused("watch: give target or body, not both")

    names = [body.name for body in scene.bodies]
    if asked.body not in names:
        raise Refused(str(choices("body", clean(asked.body, 60), names)))
    body = scene[asked.body]

    def follow(_: Camera, state: State) -> Camera:
        target = tuple(body.pose_in(state).position.tolist())
        away = max(math.dist(camera.position, target), _NEAR_M)
        near_deg = math.degrees(2 * math.atan2(_FOLLOWED_M / 2, away))
        return replace(camera, target=target, fov_deg=asked.fov_deg or near_deg)

    return follow


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

    return _place_camera(asked, usual)


def _place_camera(asked: FromCamera, usual: Camera) -> Camera:
    """Return a camera as it is asked for, which is else as the task's.

    Raises:
        Refused: it can't stand there.
    """
    position = tuple(asked.position or usual.position)
    target = tuple(asked.target or usual.target)
    if math.dist(position, target) < _NEAR_M:
        raise Refused("position and target are the same place")
    fov_deg = asked.fov_deg or usual.fov_deg
    return replace(usual, position=position, target=target, fov_deg=fov_deg)


def draw_trial(
    task: Task, artist: Artist, evaluation: Evaluation, trial: Trial, asked: Watch
) -> Picture:
    """Draw a film strip of one trial of a candidate.

    Args:
        task: what was tried.
        artist: draws it.
        evaluation: of the candidate.
        trial: one of its.
        asked: from where it is looked at.

    Raises:
        Refused: it can't be drawn.
    """
    alone = Evaluation(evaluation.candidate, (trial,), Score(trial.reward))
    aim = find_aim(asked, task.scene(trial.layout), task.camera)
    strip = artist.draw_strip(alone, aim)
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
