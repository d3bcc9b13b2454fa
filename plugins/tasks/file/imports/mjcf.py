"""Describe an MJCF file of a scene, as MuJoCo's own compiler reads it, in a process of its own."""

from __future__ import annotations

import io
import re
import zipfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, tostring

import numpy as np

from core.errors import UserError
from core.imports.documents import MAX_BYTES, read_xml
from core.imports.mjcf import describe_model
from core.support.sandbox import isolated
from core.support.text import clean
from core.values.descriptions import Description
from plugins.tasks.file.imports.imported import find_left_out
from plugins.tasks.file.imports.solids import read_inside

try:
    import mujoco
except (ImportError, RuntimeError) as error:  # it reads MUJOCO_GL when it is imported
    raise UserError(
        f"MuJoCo reads MJCF files, but can't be imported ({error}): pip install 'mujoco>=4,<5'"
    ) from error

LIMIT_S = 60
MAX_DEPTH = 64
MAX_BODIES = 500
MAX_ELEMENTS = 20_000  # with all copies of a replicate
_READ = {"compiler", "default", "asset", "mesh", "material", "worldbody"}
_READ |= {"body", "frame", "replicate", "inertial", "joint", "freejoint", "geom"}
_MESHES = (".obj", ".stl", ".msh")


def read_model(
    root: Element, file: Path, folder: Path, prefix: str, without: Sequence[str]
) -> tuple[Description, list[str]]:
    """Describe the bodies of an MJCF file, and note what is left out.

    Args:
        root: of the file.
        file: where it is.
        folder: where all files must lie.
        prefix: that an import puts before all names.
        without: names of bodies, or patterns, that are left out with all that hangs from them.

    Raises:
        UserError: MuJoCo refuses it, there is too much of something, or a body has several joints.
    """
    left = Counter[str]()
    try:
        _strip(root, file, folder, left, {file.resolve()})
        _leave_out(root, without, prefix)
        packed = _pack(root, file, folder)
        binary = isolated(compile_model, "the model", packed, limit_s=LIMIT_S)
        model = mujoco.MjModel.from_binary_path("model.mjb", {"model.mjb": binary})
        _check_bodies(model)
        tree, notes = describe_model(model, file.stem, lambda site: False)
    except (UserError, ValueError) as error:
        raise UserError(clean(str(error), 300)) from error

    stripped = [f"left out: {count} {name}" for name, count in sorted(left.items())]
    return tree, stripped + notes


def _check_bodies(model: Any) -> None:
    """Refuse too many bodies, and a body with several joints."""
    if model.nbody > MAX_BODIES + 1:
        raise UserError(f"there are more than {MAX_BODIES} bodies; leave some out")

    for body in map(model.body, np.flatnonzero(model.body_jntnum > 1)):
        raise UserError(
            f"body {body.name!r} has {body.jntnum[0]} joints; one is read: put a body with mass and shape between"
        )


def compile_model(packed: bytes) -> bytes:
    """Compile a zipped model to MuJoCo's binary format.

    Raises:
        UserError: MuJoCo refuses it.
    """
    try:
        model = mujoco.MjSpec.from_zip(io.BytesIO(packed)).compile()
    except (ValueError, mujoco.FatalError) as error:
        # The lines that it names are not those of the file.
        reason = re.sub(", line [0-9-]+", "", str(error))
        raise UserError(f"is refused by MuJoCo: {reason}") from error

    binary = np.zeros(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, binary)

    return binary.tobytes()


def _leave_out(root: Element, without: Sequence[str], prefix: str) -> None:
    """Take bodies out of a model's root, with all that hangs from them.

    Raises:
        UserError: one of them is not there.
    """
    names = [body.get("name", "") for body in root.iter("body")]
    left = find_left_out(without, prefix, filter(None, names))

    for bearer in list(root.iter()):
        for child in list(bearer):
            if child.tag == "body" and child.get("name") in left:
                bearer.remove(child)


def _pack(root: Element, file: Path, folder: Path) -> bytes:
    """Zip a model and its meshes, under names of our own."""
    options = dict[str, str]()
    for compiler in root.iter("compiler"):
        options |= compiler.attrib

    meshes = file.parent / options.get("meshdir", options.get("assetdir", ""))

    for element in root.iter():
        for key in ("assetdir", "meshdir", "texturedir", "texture", "builtin"):
            element.attrib.pop(key, None)

    stream = io.BytesIO()
    names = dict[Path, str]()
    with zipfile.ZipFile(stream, "w") as archive:
        for mesh in root.iterfind(".//mesh[@file]"):
            path = (meshes / mesh.attrib["file"]).resolve()
            kind = path.suffix.lower()
            if kind not in _MESHES:
                kinds = ", ".join(_MESHES)
                raise UserError(f"mesh {path} is of no kind that is read: {kinds}")

            if path not in names:
                names[path] = f"{len(names)}{kind}"
                archive.writestr(names[path], read_inside(path, folder, "mesh"))

            mesh.set("name", mesh.get("name", path.stem))
            mesh.set("file", names[path])

        archive.writestr("model.xml", tostring(root))

    return stream.getvalue()


def _strip(
    element: Element,
    file: Path,
    folder: Path,
    left: Counter[str],
    included: set[Path],
    depth: int = 0,
) -> int:
    """Put in what is included, leave out what is not read, and count that.

    Returns:
        How many elements there are, with all copies.
    Raises:
        UserError: there is too much, or a file can't be included.
    """
    if depth > MAX_DEPTH:
        raise UserError(f"elements are nested more than {MAX_DEPTH} deep")

    count = 1
    waiting = [*reversed(element)]
    element[:] = []
    while waiting:
        child = waiting.pop()
        if child.tag == "include":
            other = (file.parent / child.get("file", "")).resolve()
            if other in included:
                raise UserError(f"{other} is included twice; leave one of them out")

            included.add(other)
            part = read_inside(other, folder, "MJCF", MAX_BYTES / 1e6)
            waiting += reversed(read_xml(part, other))
        elif child.tag in _READ and child.get("type") not in ("hfield", "sdf"):
            element.append(child)
            count += _strip(child, file, folder, left, included, depth + 1)
        else:
            left[clean(f"{child.tag} {child.get('type', '')}", 40)] += 1

    count *= _count_copies(element)
    if count > MAX_ELEMENTS:
        raise UserError(
            f"there are more than {MAX_ELEMENTS} elements, with all copies; leave some out"
        )

    return count


def _count_copies(element: Element) -> int:
    """Return how many copies of what it holds an element makes."""
    if element.tag != "replicate":
        return 1

    count = element.get("count", "").strip()
    if not re.fullmatch("[0-9]{1,3}", count) or int(count) > MAX_BODIES:
        raise UserError(
            f"a replicate has count={clean(count, 20)}; it must be a number up to {MAX_BODIES}"
        )

    return int(count)
