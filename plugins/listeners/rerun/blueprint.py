"""Arrange the viewer, and write the words that it shows."""

from __future__ import annotations

import rerun.blueprint as rrb

from core.scene import Camera
from core.support.templates import fill
from core.support.text import clean
from core.trial import Evaluation

MAX_TEXT = 4000

_INDENT = "    "
"""Before every line of a model's, so that it can't be taken for one of ours."""


def layout(camera: Camera) -> rrb.Blueprint:
    """Arrange the viewer: the scene, the words and the rewards."""
    eye = rrb.EyeControls3D(
        position=camera.position,
        look_target=camera.target,
        eye_up=(0.0, 0.0, 1.0),
    )
    scene = rrb.Spatial3DView(
        origin="/world", name="rollout", eye_controls=eye, line_grid=False
    )
    unit = rrb.ScalarAxis(range=(-0.05, 1.05))
    words = rrb.TextDocumentView(origin="/text/design", name="design")
    in_rollout = rrb.TimeSeriesView(
        origin="/reward", name="reward in the rollout", axis_y=unit
    )
    by_generation = rrb.TimeSeriesView(
        origin="/search/reward", name="reward by generation", axis_y=unit
    )
    figures = rrb.Vertical(words, in_rollout, by_generation, row_shares=[3, 2, 2])

    return rrb.Blueprint(
        rrb.Horizontal(scene, figures, column_shares=[3, 2]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(
            state="collapsed",
            timeline="sim_time",
            fps=1.0,
            play_state="playing",
            loop_mode="all",
        ),
    )


def design_text(evaluation: Evaluation, note: str = "") -> str:
    """The text beside a candidate.

    It is shown as plain text, never as Markdown, which can fetch pictures and hide the targets of links.
    """
    candidate = evaluation.candidate
    return fill(
        "plugins.listeners.rerun",
        "design",
        evaluation=evaluation,
        candidate=candidate,
        note=note,
        parts=candidate.tool.components if candidate.tool is not None else (),
        quoted=_quote,
    )


def _quote(*texts: str) -> str:
    """Indent what a model wrote."""
    lines = []
    for text in texts:
        lines += clean(text, MAX_TEXT, lines=True).splitlines()
    return "\n".join(f"{_INDENT}{line}" for line in lines or ["(nothing)"])
