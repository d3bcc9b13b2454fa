"""Draw what an agent asks to see: the scene from a view, and film strips of trials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from core.design import Tool
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
_CUT = ("front", "side", "top")
_KEPT = 12  # views that are kept


class Viewer:
    """Draws the scene of a run, with its bodies where they begin.

    Args:
        run: has the task, and an engine that is idle while an agent's call is answered.
        drawn: the named views without a tool, where a prompt shows them; none: they are drawn when they are asked for.
    """

    def __init__(self, run: Run, drawn: Sequence[Picture] = ()) -> None:
        self._run = run
        self._drawn = drawn
        self._views: dict[tuple[str, str], Picture] = {}

    def look(self, asked: Look, tool: Tool | None) -> Picture:
        """Draw the layout of the run's seed before the motion; see `draw`.

        Raises:
            NoPicture: nothing here can draw.
            Refused: no such view, or a camera that can't stand there.
        """
        if asked.position is not None or asked.cut is not None:
            return self.draw(asked, {"tool": tool})

        name = asked.view or SCENE
        if tool is None:
            for picture in self._drawn:
                if picture.name == name:
                    return picture

        key = ("" if tool is None else tool.content, name)
        if key not in self._views:
            drawn = self.draw(asked, {"tool": tool})
            while len(self._views) >= _KEPT:
                self._views.pop(next(iter(self._views)))
            self._views[key] = drawn

        return self._views[key]

    def draw(self, asked: Look, shown: View) -> Picture:
        """Draw what is asked for, with names and scales, and a caption that says where the camera stands.

        Args:
            asked: a named view, or a camera.
            shown: the tool, the layout, and how the arm stands.

        Raises:
            NoPicture: nothing here can draw.
            Refused: no such view, or a camera that can't stand there.
        """
        run = self._run
        assert run.simulator is not None
        level = installed().factory("level", _DRAWN_BY)()
        wanted = self._choose_camera(asked, level.views)
        seed = shown.get("seed", run.seed)
        given = View(**{**shown, "seed": seed})
        render = partial(run.simulator.render, run.task, **given)
        picture: Picture
        (picture,) = level.draw(run.task, seed, render, wanted, asked.cut)
        return picture

    def _choose_camera(self, asked: Look, views: Sequence[str]) -> str | Camera:
        """Return the name of the view that is asked for, or the camera."""
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
        return self._place_camera(asked.position, asked)

    def _place_camera(self, position: Sequence[float], asked: Look) -> Camera:
        usual = self._run.task.camera
        x, y, z = position
        target = tuple(asked.target or usual.target)
        if sum((a - b) ** 2 for a, b in zip((x, y, z), target, strict=True)) < 1e-6:
            raise Refused("look: position and target are the same place")

        camera = replace(usual, position=(x, y, z), target=target)
        return replace(camera, fov_deg=asked.fov_deg or usual.fov_deg)


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
