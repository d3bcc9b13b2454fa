"""How the viewer arranges a recording when it is opened."""

from __future__ import annotations

from dataclasses import dataclass

import rerun.blueprint as rrb

from core.scene import Camera


@dataclass(frozen=True)
class Parts:
    """What there is besides the rollout: a ``row`` of tools, so many metres long (0: none), and so on."""

    row: float
    lineage: bool
    tokens: bool
    cost: bool


def layout(camera: Camera, parts: Parts) -> rrb.Blueprint:
    """The scene with what goes with it."""
    up = (0.0, 0.0, 1.0)
    eye = rrb.EyeControls3D(position=camera.position, look_target=camera.target, eye_up=up)
    scene = rrb.Spatial3DView(origin="/world", name="rollout", eye_controls=eye, line_grid=False)
    below = []
    if parts.row:
        away = 0.3 + 0.75 * parts.row
        place = (0.1 * away, -away, 0.25 * away)
        beside = rrb.EyeControls3D(position=place, look_target=(0.0, 0.0, -0.2), eye_up=up)
        below.append(rrb.Spatial3DView(origin="/tools", name="best tools", eye_controls=beside, line_grid=False))
    if parts.lineage:
        below.append(rrb.GraphView(origin="/lineage", name="lineage"))
    seen = rrb.Vertical(scene, rrb.Horizontal(*below), row_shares=[3, 2]) if below else scene
    unit = rrb.ScalarAxis(range=(-0.05, 1.05))
    counts = [rrb.TimeSeriesView(origin="/search/reward", name="reward by generation", axis_y=unit)]
    if parts.tokens:
        counts.append(rrb.TimeSeriesView(origin="/search/tokens", name="tokens"))
    if parts.cost:
        counts.append(rrb.TimeSeriesView(origin="/search/cost_usd", name="cost in US$"))
    told = rrb.Vertical(
        rrb.Tabs(
            rrb.TextDocumentView(origin="/text/design", name="design"),
            rrb.TextDocumentView(origin="/text/tools", name="tools"),
            rrb.TextDocumentView(origin="/text/run", name="run"),
            active_tab=0,
        ),
        rrb.TimeSeriesView(origin="/reward", name="reward in the rollout", axis_y=unit),
        rrb.Tabs(*counts, active_tab=0),
        row_shares=[3, 2, 2],
    )
    return rrb.Blueprint(
        rrb.Horizontal(seen, told, column_shares=[3, 2]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="sim_time", fps=1.0, play_state="playing", loop_mode="all"),
    )
