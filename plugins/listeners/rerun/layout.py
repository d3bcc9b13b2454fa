"""The arrangement of a recording in the viewer."""

from __future__ import annotations

import rerun.blueprint as rrb

from core.scene import Camera


def layout(camera: Camera, row: float, lineage: bool) -> rrb.Blueprint:
    """The views of the scene, the tools, the texts and the rewards; ``row``: metres of the row of tools, or 0."""
    up = (0.0, 0.0, 1.0)
    eye = rrb.EyeControls3D(position=camera.position, look_target=camera.target, eye_up=up)
    scene = rrb.Spatial3DView(origin="/world", name="rollout", eye_controls=eye, line_grid=False)
    below = []
    if row:
        away = 0.3 + 0.75 * row
        place = (0.1 * away, -away, 0.25 * away)
        beside = rrb.EyeControls3D(position=place, look_target=(0.0, 0.0, -0.2), eye_up=up)
        below.append(rrb.Spatial3DView(origin="/tools", name="best tools", eye_controls=beside, line_grid=False))
    if lineage:
        below.append(rrb.GraphView(origin="/lineage", name="lineage"))
    scenes = rrb.Vertical(scene, rrb.Horizontal(*below), row_shares=[3, 2]) if below else scene
    unit = rrb.ScalarAxis(range=(-0.05, 1.05))
    texts = (rrb.TextDocumentView(origin=f"/text/{name}", name=name) for name in ("design", "tools"))
    figures = rrb.Vertical(
        rrb.Tabs(*texts, active_tab=0),
        rrb.TimeSeriesView(origin="/reward", name="reward in the rollout", axis_y=unit),
        rrb.TimeSeriesView(origin="/search/reward", name="reward by generation", axis_y=unit),
        row_shares=[3, 2, 2],
    )
    return rrb.Blueprint(
        rrb.Horizontal(scenes, figures, column_shares=[3, 2]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="sim_time", fps=1.0, play_state="playing", loop_mode="all"),
    )
