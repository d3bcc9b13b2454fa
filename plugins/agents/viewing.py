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
from core.scene import Camera
from core.search.designer import Artist
from core.simulation.pictures import SIZE, describe_camera, png
from plugins.agents.arguments import Look
from plugins.agents.bench import Refused

SCENE = "scene"
_DRAWN_BY = "pictures"
"""The level of ``prompt.context`` that has the named views; every level may show them."""
_KEPT = 12  # views that are kept


class Viewer:
    """Draws the scene of a run in the layout of its seed.

    Args:
        run: has the task, and an engine that is idle while an agent's call is answered.
        drawn: the named views without a tool, where a prompt shows them; none: they are drawn when they are asked for.
    """

    def __init__(self, run: Run, drawn: Sequence[Picture] = ()) -> None:
        self._run = run
        self._drawn = drawn
        self._views: dict[tuple[str, str], Picture] = {}

    def look(self, asked: Look, tool: Tool | None) -> Picture:
        """Draw what is asked for, with a caption that says where the camera stands.

        Raises:
            NoPicture: nothing here can draw.
            Refused: no such view, or a camera that can't stand there.
        """
        if asked.position is None:
            if asked.target is not None or asked.fov_deg is not None:
                raise Refused("look: target and fov_deg go with position")
            return self._draw_view(asked.view or SCENE, tool)
        if asked.view is not None:
            raise Refused("look: give view or position, not both")
        return self._draw(self._place_camera(asked), tool)

    def _place_camera(self, asked: Look) -> Camera:
        usual = self._run.task.camera
        assert asked.position is not None
        x, y, z = asked.position
        target = tuple(asked.target or usual.target)
        if sum((a - b) ** 2 for a, b in zip((x, y, z), target, strict=True)) < 1e-6:
            raise Refused("look: position and target are the same place")

        camera = replace(usual, position=(x, y, z), target=target)
        return replace(camera, fov_deg=asked.fov_deg or usual.fov_deg)

    def _draw(self, camera: Camera, tool: Tool | None) -> Picture:
        run = self._run
        assert run.simulator is not None
        width, height = SIZE
        image = run.simulator.render(
            run.task,
            camera=camera,
            seed=run.seed,
            tool=tool,
            width=width,
            height=height,
        )
        return Picture(png(image), "look", describe_camera(camera, SIZE))

    def _draw_view(self, name: str, tool: Tool | None) -> Picture:
        """Draw a named view, or return it where it was drawn before."""
        if tool is None:
            for picture in self._drawn:
                if picture.name == name:
                    return picture

        level = installed().factory("level", _DRAWN_BY)()
        if name not in level.views:
            raise Refused(str(choices("view", name, level.views)))

        key = ("" if tool is None else tool.content, name)
        if key not in self._views:
            run = self._run
            assert run.simulator is not None
            render = partial(run.simulator.render, run.task, seed=run.seed, tool=tool)
            while len(self._views) >= _KEPT:
                self._views.pop(next(iter(self._views)))
            (self._views[key],) = level.draw(run.task, run.seed, render, name)

        return self._views[key]


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
