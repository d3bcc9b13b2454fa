"""Write an arm of which a joint slides: two that turn, the slide, and one that turns, all about the vertical.

``python -m tests.support.scara FILE.urdf`` writes it for people.
"""

from __future__ import annotations

import sys
from pathlib import Path

HOME = (0.769, -1.687, 0.05, -0.653)
QUILL_KG = 1.2  # what the slide bears, with the flange


def text(effort: float = 300.0, more: str = "") -> str:
    """The URDF; ``effort`` is the slide's limit, newtons, and ``more`` stands in its element."""
    parts = [
        _link("base", "0.2 0.2 0.7", 20.0, (0.0, 0.35)),
        _link("upper", "0.45 0.1 0.08", 5.0, (0.2, 0.0)),
        _link("fore", "0.4 0.08 0.08", 3.0, (0.175, 0.0)),
        _link("quill", "0.03 0.03 0.75", QUILL_KG - 0.2, (0.0, 0.225)),
        _link("tool0", "0.05 0.05 0.02", 0.2, (0.0, 0.01)),
        _joint("j1 revolute base upper", "0 0 0.74", "0 0 1", (-2.9, 2.9), 200, 4),
        _joint("j2 revolute upper fore", "0.4 0 0.08", "0 0 1", (-2.6, 2.6), 100, 5),
        _joint(
            "j3 prismatic fore quill",
            "0.35 0 -0.1",
            "0 0 -1",
            (-0.05, 0.45),
            effort,
            1,
            more,
        ),
        _joint("j4 revolute quill tool0", "0 0 -0.17", "0 0 1", (-6, 6), 20, 8),
    ]
    return "\n".join(['<robot name="scara">', *parts, "</robot>\n"])


def write(file: Path, effort: float = 300.0, more: str = "") -> Path:
    """Write the arm to a file, and return it."""
    file.write_text(text(effort, more))
    return file


def _link(name: str, size: str, mass: float, center: tuple[float, float]) -> str:
    """A box; ``center`` is its x and z in the link's frame."""
    x, z = center
    shape = f'<origin xyz="{x} 0 {z}"/><geometry><box size="{size}"/></geometry>'
    moments = " ".join(f'{name}="{0.01 * mass}"' for name in ("ixx", "iyy", "izz"))
    inertia = f'<origin xyz="{x} 0 {z}"/><mass value="{mass}"/><inertia {moments}/>'
    return (
        f'<link name="{name}"><inertial>{inertia}</inertial><visual>{shape}</visual>'
        f"<collision>{shape}</collision></link>"
    )


def _joint(
    names: str,
    place: str,
    axis: str,
    ends: tuple[float, float],
    effort: float,
    velocity: float,
    more: str = "",
) -> str:
    name, kind, parent, child = names.split()
    limit = (
        f'lower="{ends[0]}" upper="{ends[1]}" effort="{effort}" velocity="{velocity}"'
    )
    return (
        f'<joint name="{name}" type="{kind}"><origin xyz="{place}"/><parent link="{parent}"/>'
        f'<child link="{child}"/><axis xyz="{axis}"/><limit {limit}/>{more}</joint>'
    )


if __name__ == "__main__":
    write(Path(sys.argv[1]))
