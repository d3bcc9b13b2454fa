"""The arrangement of a recording in the viewer."""

from __future__ import annotations

from dataclasses import dataclass

import rerun.blueprint as rrb

from core.scene import Camera


@dataclass(frozen=True)
class Contents:
    """The contents of a recording beside the rollout: ``row`` is the length of the row of tools in metres, or 0."""

    row: float
    lineage: bool
    tokens: bool
    cost: bool
    critiques: bool


def layout(camera: Camera, contents: Contents) -> rrb.Blueprint:
    """The views of the scene, the tools, the texts and the figures."""
    up = (0.0, 0.0, 1.0)
    eye = rrb.EyeControls3D(position=camera.position, look_target=camera.target, eye_up=up)
    scene = rrb.Spatial3DView(origin="/world", name="rollout", eye_controls=eye, line_grid=False)
    below = []
    if contents.row:
        away = 0.3 + 0.75 * contents.row
        place = (0.1 * away, -away, 0.25 * away)
        beside = rrb.EyeControls3D(position=place, look_target=(0.0, 0.0, -0.2), eye_up=up)
        below.append(rrb.Spatial3DView(origin="/tools", name="best tools", eye_controls=beside, line_grid=False))
    if contents.lineage:
        below.append(rrb.GraphView(origin="/lineage", name="lineage"))
    scenes = rrb.Vertical(scene, rrb.Horizontal(*below), row_shares=[3, 2]) if below else scene
    unit = rrb.ScalarAxis(range=(-0.05, 1.05))
    counts = [rrb.TimeSeriesView(origin="/search/reward", name="reward by generation", axis_y=unit)]
    if contents.tokens:
        counts.append(rrb.TimeSeriesView(origin="/search/tokens", name="tokens"))
    if contents.cost:
        counts.append(rrb.TimeSeriesView(origin="/search/cost_usd", name="cost in US$"))
    texts = ["design", "tools", *(["critiques"] if contents.critiques else []), "run"]
    figures = rrb.Vertical(
        rrb.Tabs(*(rrb.TextDocumentView(origin=f"/text/{name}", name=name) for name in texts), active_tab=0),
        rrb.TimeSeriesView(origin="/reward", name="reward in the rollout", axis_y=unit),
        rrb.Tabs(*counts, active_tab=0),
        row_shares=[3, 2, 2],
    )
    return rrb.Blueprint(
        rrb.Horizontal(scenes, figures, column_shares=[3, 2]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="sim_time", fps=1.0, play_state="playing", loop_mode="all"),
    )
