"""Read an arm of an MJCF file, as MuJoCo's own compiler has it, in a process of its own."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from core.errors import UserError, choices
from core.imports.mjcf import WORLD, describe_model
from core.imports.near import describe_near, find_near
from core.robot.shape_files import urdf_shapes
from core.support.sandbox import isolated
from core.support.text import clean
from core.values.descriptions import (
    Description,
    Origin,
    RobotLink,
    RobotShape,
)
from plugins.robots.foreign_names import names_tool_frame

try:
    import mujoco
except (ImportError, RuntimeError) as error:  # it reads MUJOCO_GL when it is imported
    raise UserError(
        f"MuJoCo reads MJCF files, but can't be imported ({error}): pip install 'mujoco>=4,<5'"
    ) from error

LIMIT_S = 120
SPEED = 3.14  # rad/s or m/s: MJCF has no limits of speed


def read_mjcf_arm(
    file: Path, without: Collection[str] = ()
) -> tuple[Description, list[str]]:
    """Describe what stands in the world and has joints, with meshes as files.

    Args:
        file: the MJCF file.
        without: links that are left out, with all that they bear.

    Returns:
        links and joints; what was assumed or left out, a line each.

    Raises:
        UserError: MuJoCo refuses the file, or nothing moves.
    """
    compiled = isolated(compile_arm, "the model", b"", str(file), limit_s=LIMIT_S)
    said, _, binary = compiled.partition(b"\n")
    notes: list[str] = json.loads(said)
    model = mujoco.MjModel.from_binary_path("model.mjb", {"model.mjb": binary})
    whole, left = describe_model(model, file.stem, names_tool_frame)
    notes += left
    for name in without:
        if name not in whole.links:
            raise choices("link", name, whole.links)

    arm = _stand(whole.without(*without), notes)
    links = {name: _write_shapes(link) for name, link in arm.links.items()}
    joints = {
        child: replace(joint, limits=joint.limits._replace(velocity=SPEED))
        for child, joint in arm.joints.items()
    }
    return Description(arm.name, links, joints), notes


def _stand(whole: Description, notes: list[str]) -> Description:
    """Take what stands in the world and has joints, without the world if one arm is fixed there.

    What is free to move counts if nothing else does.

    Raises:
        UserError: nothing has joints.
    """
    tops = [name for name, joint in whole.joints.items() if joint.parent == WORLD]
    free = {name for name in tops if whole.joints[name].kind == "floating"}
    moving = {
        whole.above(name)[-2]
        for name, joint in whole.joints.items()
        if joint.kind not in ("fixed", "floating")
    }
    kept = moving - free or moving
    if not kept:
        raise UserError(
            "no joint moves in this MJCF file; give the file that includes the arm, or that it includes"
        )

    others = [name for name in tops if name not in kept]
    if others:
        notes.append(f"left out, as no arms: {', '.join(others)}")
    if kept & free:
        notes.append("its base, which is free there, is fixed here")

    whole = whole.without(*others)
    links = {**whole.links, WORLD: RobotLink(WORLD)}
    joints = dict(whole.joints)
    for name in kept & free:
        joints[name] = replace(joints[name], kind="fixed")

    base, *more = kept
    if not more and joints[base].kind == "fixed":
        if joints.pop(base).origin != Origin():
            notes.append(
                "where it stands in the file's world is left out; robot.base=[x,y,z,yaw] places it"
            )

        del links[WORLD]

    return Description(whole.name, links, joints)


def _write_shapes(link: RobotLink) -> RobotLink:
    """Make a link's shapes of those that URDF has, and draw only what does not collide."""
    drawn = [shape for shape in link.visuals if shape not in link.collisions]
    return replace(
        link,
        collisions=tuple(_write_all(link.collisions)),
        visuals=tuple(_write_all(drawn)),
    )


def _write_all(shapes: Iterable[RobotShape]) -> Iterator[RobotShape]:
    for shape in shapes:
        assert not isinstance(shape.shape, Path)
        assert shape.color is not None
        *rgb, opacity = shape.color
        color = (*rgb, opacity or 1.0)  # what collides is often hidden
        for part in urdf_shapes(shape.shape, shape.origin.pose):
            yield replace(part, color=color)


def compile_arm(_: bytes, file: str) -> bytes:
    """Compile a model without what only pictures need; return notes, a line of JSON, and MuJoCo's binary format.

    Raises:
        UserError: MuJoCo refuses it, or meshes are missing.
    """
    try:
        spec = mujoco.MjSpec.from_file(file)
        for thing in (*spec.textures, *spec.keys, *spec.skins):
            spec.delete(thing)

        for material in spec.materials:
            material.textures = [""] * len(material.textures)

        notes = list[str]()
        try:
            model = spec.compile()
        except ValueError:
            notes = _find_meshes(spec, Path(file))
            model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise UserError(f"is refused by MuJoCo: {clean(str(error), 300)}") from error

    binary = np.zeros(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, binary)
    return json.dumps(notes).encode() + b"\n" + binary.tobytes()


def _find_meshes(spec: Any, file: Path) -> list[str]:
    """Take meshes that are near where the file says, leave out missing ones that are only drawn, and say so.

    Raises:
        UserError: others are missing; names all of them.
    """
    near: dict[str, Path] = {}
    missing = {}
    for mesh in list(spec.meshes):
        named = str(Path(spec.meshdir, mesh.file))
        wanted = Path(spec.modelfiledir, named)
        if not mesh.file or wanted.is_file():
            continue

        alike = find_near(named.replace("\\", "/"), file)
        if alike is not None:
            near[named] = alike
            mesh.file = str(alike.absolute())
            continue

        missing[mesh.name or wanted.stem] = str(wanted)
        spec.delete(mesh)

    needed = set[str]()
    for geom in list(spec.geoms):
        if geom.meshname in missing:
            if geom.contype or geom.conaffinity:
                needed.add(missing[geom.meshname])
            spec.delete(geom)

    if needed:
        raise UserError(
            f"names mesh files that are missing: {', '.join(sorted(needed))}"
        )

    left_out = [
        f"not drawn, as there is no file {wanted}; where its body has no <inertial> it weighs less"
        for wanted in missing.values()
    ]
    return describe_near(near) + left_out
