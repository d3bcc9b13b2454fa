"""Draw the two figures of the page "Concepts" as stand-alone SVG: ``python docs/build.py diagrams``."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

INK, SOFT, GROUND = "#1b1f24", "#57606a", "#ffffff"
CORE, PART, QUIET = (
    "#dcebf7",
    "#fdeed0",
    "#eef0f2",
)  # fills: core, plugin parts, the rest
FONT = "system-ui, 'DejaVu Sans', sans-serif"

# From the ground up, and within a floor from left to right: a room imports only from rooms before it.
# `tests/test_architecture.py` checks every module.
FLOORS = {
    "ground": ("errors", "support", "shapes", "geometry"),
    "values": ("values", "scene", "goals", "design", "task", "trial"),
    "interfaces and events": ("interfaces", "events", "hooks"),
    "plugins and config": ("plugins", "config"),
    "robot and solids": ("imports", "robot", "solids", "designs"),
    "one rollout": ("simulation",),
    "one run": ("store", "search"),
    "commands": ("__init__", "run", "__main__", "evaluate", "prompt"),
}
PARTS = {
    "task": "RoboToolBench, HardToolBench, file",
    "robot": "panda, ur5, ...",
    "sim": "pybullet, sapien, mujoco",
    "vlm": "gemini, openai, ... or offline",
    "tool": "urdf, boxes, solids; none",
    "action": "waypoints, anchored",
    "evolution": "vlmgineer, map_elites, ...",
    "fitness": "nominal, robust, layouts, ...",
    "executor": "local, ray",
    "listener": "progress, rerun, unseen, summary",
    "command": "report, export, transfer, ...",
}


def drawing(width: int, height: int, title: str, pieces: Sequence[str]) -> str:
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
        f'role="img" font-family="{FONT}" font-size="14" fill="{INK}">\n<title>{escape(title)}</title>\n'
        f'<defs><marker id="tip" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" markerHeight="7" orient="auto">'
        f'<path d="M0 0 10 5 0 10z" fill="{INK}"/></marker></defs>\n'
        f'<rect width="{width}" height="{height}" rx="10" fill="{GROUND}"/>\n'
        + "\n".join(pieces)
        + "\n</svg>\n"
    )


def text(
    x: float,
    y: float,
    words: str,
    *,
    size: int = 14,
    color: str = INK,
    anchor: str = "middle",
    bold: bool = False,
) -> str:
    weight = ' font-weight="600"' if bold else ""
    look = f'font-size="{size}" fill="{color}" text-anchor="{anchor}"{weight}'
    return f'<text x="{x:g}" y="{y:g}" {look}>{escape(words, quote=False)}</text>'


def box(
    x: float,
    y: float,
    width: float,
    height: float,
    title: str,
    lines: Sequence[str] = (),
    fill: str = CORE,
) -> str:
    """Draw a rectangle with a title and small lines below it, centred."""
    top = y + height / 2 + 5 - 9 * len(lines)
    pieces = [
        f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" rx="6" fill="{fill}" stroke="{INK}"/>',
        text(x + width / 2, top, title, bold=True),
        *(
            text(x + width / 2, top + 18 * i, line, size=12, color=SOFT)
            for i, line in enumerate(lines, 1)
        ),
    ]
    return "\n".join(pieces)


def arrow(*corners: tuple[float, float], dashed: bool = False) -> str:
    points = " ".join(f"{x:g},{y:g}" for x, y in corners)
    dash = ' stroke-dasharray="5 4"' if dashed else ""
    return f'<polyline points="{points}" fill="none" stroke="{INK}" stroke-width="1.5"{dash} marker-end="url(#tip)"/>'


def house() -> str:
    """Draw the floors of ``core/`` and the eleven kinds of parts."""
    left, width, storey, gap = 20, 560, 52, 8
    top = 50
    base = top + max(len(FLOORS), len(PARTS)) * (storey + gap)
    pieces = [text(left, 34, "core/", size=16, anchor="start", bold=True)]
    middle = {}
    for number, (what, modules) in enumerate(reversed(FLOORS.items())):
        y = top + number * (storey + gap)
        middle[what] = y + storey / 2
        pieces.append(
            box(
                left,
                y,
                width,
                storey,
                what,
                [" · ".join(name for name in modules if name[0] != "_")],
            )
        )
    note = "Imports go down, and within a floor to the left, never the other way."
    pieces.append(text(left, base + 18, note, size=12, color=SOFT, anchor="start"))
    right, wide = left + width + 120, 240
    pieces.append(
        text(right, 34, "plugins/, tasks/, yours", size=16, anchor="start", bold=True)
    )
    for number, (kind, names) in enumerate(PARTS.items()):
        pieces.append(
            box(right, top + number * (storey + gap), wide, storey, kind, [names], PART)
        )
    rail = right - 20
    ends = (top + storey / 2, top + (len(PARTS) - 1) * (storey + gap) + storey / 2)
    pieces.append(
        f'<path d="M{right} {ends[0]:g}H{rail}V{ends[1]:g}H{right}" fill="none" stroke="{INK}" stroke-width="1.5"/>'
    )
    for what, label in (
        ("interfaces and events", "implement"),
        ("plugins and config", "are found by"),
    ):
        pieces.append(arrow((rail, middle[what]), (left + width + 2, middle[what])))
        pieces.append(
            text(
                (rail + left + width) / 2, middle[what] - 7, label, size=12, color=SOFT
            )
        )
    return drawing(
        right + wide + 20,
        base + 34,
        "The floors of core, and the eleven kinds of parts beside it",
        pieces,
    )


def loop() -> str:
    """Draw one generation."""
    w, h, top, middle, bottom = 170, 64, 30, 150, 270
    xs = [20, 252, 484, 716]
    boxes = [
        box(xs[0], top, w, h, "strategy", ["ask, tell"], PART),
        box(xs[1], top, w, h, "designer", ["a brief for each agent"]),
        box(xs[2], top, w, h, "model", ["vision and language"], PART),
        box(
            xs[3], top, w, h, "tool representation", ["reads; rules are checked"], PART
        ),
        box(xs[3], bottom, w, h, "executor", ["chunks to its workers"], PART),
        box(xs[2], bottom, w, h, "motion", ["waypoints to joints"]),
        box(xs[1], bottom, w, h, "simulator", ["plays it: start, end"], PART),
        box(xs[0], bottom, w, h, "task", ["reward, 0 to 1"], PART),
        box(xs[0], middle, w, h, "fitness", ["combines the rollouts"], PART),
    ]
    y, z, left = top + h / 2, bottom + h / 2, xs[0] + w / 2
    arrows = [
        *(arrow((xs[i] + w, y), (xs[i + 1] - 2, y)) for i in range(3)),
        *(arrow((xs[i], z), (xs[i - 1] + w + 2, z)) for i in (3, 2, 1)),
        arrow((xs[3] + w / 2, top + h), (xs[3] + w / 2, bottom - 2)),
        arrow((left, bottom), (left, middle + h + 2)),
        arrow((left, middle), (left, top + h + 2)),
        arrow(
            (xs[3] + 30, top + h),
            (xs[3] + 30, 122),
            (xs[0] + w - 20, 122),
            (xs[0] + w - 20, top + h + 2),
            dashed=True,
        ),
    ]
    labels = [
        text((xs[0] + w + xs[1]) / 2, y - 10, "elites", size=12, color=SOFT),
        text((xs[1] + w + xs[2]) / 2, y - 10, "prompts", size=12, color=SOFT),
        text((xs[2] + w + xs[3]) / 2, y - 10, "replies", size=12, color=SOFT),
        text(
            xs[3] + w / 2 + 8,
            middle + h / 2 + 4,
            "candidates",
            size=12,
            color=SOFT,
            anchor="start",
        ),
        text(
            left - 8,
            (middle + h + bottom) / 2 + 4,
            "rewards",
            size=12,
            color=SOFT,
            anchor="end",
        ),
        text(
            left - 8,
            (top + h + middle) / 2 + 4,
            "fitness",
            size=12,
            color=SOFT,
            anchor="end",
        ),
        text(
            (xs[1] + xs[2] + w) / 2, 115, "rejected, with a reason", size=12, color=SOFT
        ),
    ]
    events = "each step is an event for the listeners: store · progress · recording · your own"
    strip = box(xs[0], bottom + h + 42, xs[3] + w - xs[0], 44, events, fill=QUIET)
    title = "One generation: from the strategy through model and simulator back to it"
    return drawing(
        xs[3] + w + 20, bottom + h + 106, title, [*boxes, *arrows, *labels, strip]
    )


def flange() -> str:
    """Draw the flange's outer face, with the mount's axes, as it must stand at home, and as it must not."""
    red, pieces = "#c62828", list[str]()
    for x, turn, title in (
        (150, 0, "home: the outer face looks down"),
        (500, 90, "no home: it looks ahead"),
    ):
        steel = f'fill="{QUIET}" stroke="{INK}"'
        drawn = [
            f'<rect x="-34" y="-150" width="68" height="96" rx="14" {steel}/>',
            f'<rect x="-24" y="-54" width="48" height="34" {steel}/>',
            f'<rect x="-40" y="-20" width="80" height="18" {steel}/>',
            *(
                f'<line x1="{s * 26}" y1="-20" x2="{s * 26}" y2="-2" stroke="{SOFT}" stroke-width="5"/>'
                for s in (-1, 1)
            ),
            f'<line x1="-42" y1="0" x2="42" y2="0" stroke="{red}" stroke-width="5"/>',
            f'<path d="M-9 4V92H60V74H9V4z" fill="{PART}" stroke="{INK}" stroke-dasharray="5 4"/>',
            *((arrow((0, 0), (0, -84)), arrow((0, 0), (84, 0))) if not turn else ()),
        ]
        pieces += [
            f'<g transform="translate({x} 210) rotate({-turn})">',
            *drawn,
            "</g>",
        ]
        pieces.append(text(x, 30, title, bold=True))
    labels = [
        text(192, 120, "z, into the arm", size=12, anchor="start"),
        text(238, 214, "x, forward", size=12, anchor="start"),
        text(100, 206, "outer face", size=12, color=red, anchor="end"),
        text(100, 222, "with the bolts", size=12, color=red, anchor="end"),
        text(150, 322, "the tool hangs from it", size=12, color=SOFT),
        text(112, 90, "last link", size=12, color=SOFT, anchor="end"),
        text(500, 322, "turn it by 90 degrees about y, (0, 1, 0)", size=12, color=SOFT),
    ]
    return drawing(
        660,
        345,
        "The flange's outer face and the mount's axes at home",
        [*pieces, *labels],
    )


DRAWINGS = {"house": house, "loop": loop, "flange": flange}
