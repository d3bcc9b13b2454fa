"""Write an arm that this project has never seen: six joints, meshes of its own in all formats, and no gripper.

``python -m tests.support.outside_arm FOLDER`` writes it for people.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import trimesh

FLANGE = "tool0"
HOME = (0.0, 0.35, 1.5, 0.0, 1.29, 0.0)
ALUMINIUM = 900.0  # kg/m^3, of hollow castings
LIMIT = 2.9

#         link        joint's axis, origin z, effort, velocity
JOINTS = (
    ("turret", "0 0 1", 0.12, 150, 2.6),
    ("upper_arm", "0 1 0", 0.23, 150, 2.6),
    ("forearm", "0 1 0", 0.42, 120, 2.6),
    ("wrist_roll", "0 0 1", 0.22, 40, 4.0),
    ("wrist_pitch", "0 1 0", 0.18, 40, 4.0),
    ("hand", "0 0 1", 0.07, 30, 4.0),
)
#                  file of its mesh, as the URDF names it; units per metre; colour
MESHES = {
    "base_link": ("../meshes/base.stl", 1, None),
    "turret": ("package://outside_arm/meshes/turret.obj", 1, (230, 120, 30)),
    "upper_arm": ("package://outside_arm/meshes/upper_arm.dae", 100, (240, 240, 240)),
    "forearm": ("../meshes/forearm.stl", 1000, None),
    "wrist_roll": ("package://outside_arm/meshes/wrist_roll.dae", 1, (240, 240, 240)),
    "wrist_pitch": ("../meshes/wrist_pitch.obj", 1, (230, 120, 30)),
    "hand": ("package://outside_arm/meshes/hand.stl", 1, None),
}


def write_arm(folder: Path) -> Path:
    """Write the arm's package to ``folder``/outside_arm; return its URDF file."""
    package = folder / "outside_arm"
    (package / "meshes").mkdir(parents=True, exist_ok=True)
    (package / "urdf").mkdir(exist_ok=True)
    (package / "package.xml").write_text(
        "<package><name>outside_arm</name></package>\n"
    )
    for link, (name, units, color) in MESHES.items():
        _write(solid(link), package / "meshes" / name.rpartition("/")[2], units, color)
    file = package / "urdf/arm.urdf"
    file.write_text(text())
    return file


def text() -> str:
    """The URDF."""
    links, joints, parent = [_link("base_link")], [], "base_link"
    for number, (link, axis, z, effort, velocity) in enumerate(JOINTS, 1):
        links.append(_link(link))
        limit = f'<limit lower="-{LIMIT}" upper="{LIMIT}" effort="{effort}" velocity="{velocity}"/>'
        joints.append(
            f'<joint name="joint_{number}" type="revolute"><origin xyz="0 0 {z}"/><parent link="{parent}"/>'
            f'<child link="{link}"/><axis xyz="{axis}"/>{limit}</joint>'
        )
        parent = link
    joints.append(
        f'<joint name="tool0_fixed" type="fixed"><origin xyz="0 0 0.05"/><parent link="{parent}"/>'
        f'<child link="{FLANGE}"/></joint>'
    )
    grey = '<material name="grey"><color rgba="0.35 0.37 0.4 1"/></material>'
    lines = [grey, *links, f'<link name="{FLANGE}"/>', *joints]
    return "\n".join(
        [
            '<?xml version="1.0"?>',
            '<robot name="outside arm">',
            *(f"  {line}" for line in lines),
            "</robot>\n",
        ]
    )


def solid(link: str) -> trimesh.Trimesh:
    """The shape of a link, in metres, in its frame."""

    def rod(radius: float, *ends: tuple[float, float, float]) -> trimesh.Trimesh:
        return trimesh.creation.cylinder(radius, segment=ends, sections=40)

    axle = {"upper_arm": 0.065, "forearm": 0.055, "wrist_pitch": 0.042}.get(link)
    parts = [rod(axle, (0, -0.06, 0), (0, 0.06, 0))] if axle else []
    parts += {
        "base_link": [
            rod(0.09, (0, 0, 0), (0, 0, 0.03)),
            rod(0.07, (0, 0, 0), (0, 0, 0.115)),
        ],
        "turret": [rod(0.07, (0, 0, 0), (0, 0, 0.15))],
        "upper_arm": [rod(0.05, (0, 0, 0), (0, 0, 0.36))],
        "forearm": [rod(0.045, (0, 0, 0), (0, 0, 0.21))],
        "wrist_roll": [rod(0.04, (0, 0, 0), (0, 0, 0.13))],
        "wrist_pitch": [rod(0.035, (0, 0, 0), (0, 0, 0.06))],
        "hand": [rod(0.035, (0, 0, 0), (0, 0, 0.05))],
    }[link]
    return trimesh.util.concatenate(parts)


def _link(name: str) -> str:
    file, units, _ = MESHES[name]
    scale = (
        f' scale="{1 / units:g} {1 / units:g} {1 / units:g}"'
        if file.endswith("stl") and units != 1
        else ""
    )
    mesh = f'<geometry><mesh filename="{file}"{scale}/></geometry>'
    hull = solid(name).convex_hull
    hull.density = ALUMINIUM
    x, y, z = hull.center_mass
    names = {
        "ixx": (0, 0),
        "ixy": (0, 1),
        "ixz": (0, 2),
        "iyy": (1, 1),
        "iyz": (1, 2),
        "izz": (2, 2),
    }
    inertia = " ".join(
        f'{key}="{hull.moment_inertia[at]:.6g}"' for key, at in names.items()
    )
    return (
        f'<link name="{name}"><inertial><origin xyz="{x:.4f} {y:.4f} {z:.4f}"/><mass value="{hull.mass:.3f}"/>'
        f'<inertia {inertia}/></inertial><visual>{mesh}<material name="grey"/></visual>'
        f"<collision>{mesh}</collision></link>"
    )


def _write(
    mesh: trimesh.Trimesh, file: Path, units: int, color: tuple[int, int, int] | None
) -> None:
    mesh = mesh.copy().apply_scale(units)
    if color is not None:
        material = trimesh.visual.material.PBRMaterial(
            name="paint", baseColorFactor=[*color, 255]
        )
        mesh.visual = trimesh.visual.TextureVisuals(
            uv=np.zeros((len(mesh.vertices), 2)), material=material
        )
    if file.suffix == ".obj":
        red, green, blue = np.array(color) / 255
        file.with_suffix(".mtl").write_text(
            f"newmtl paint\nKd {red:.3f} {green:.3f} {blue:.3f}\n"
        )
        plain = trimesh.Trimesh(mesh.vertices, mesh.faces).export(file_type="obj")
        file.write_text(f"mtllib {file.stem}.mtl\nusemtl paint\n{plain}")
        return
    data = mesh.export(file_type=file.suffix[1:])
    if file.suffix == ".dae" and units != 1:
        data = data.replace(
            b"<up_axis>", f'<unit name="own" meter="{1 / units:g}"/><up_axis>'.encode()
        )
    file.write_bytes(data)


if __name__ == "__main__":
    print(write_arm(Path(sys.argv[1])))
