"""The visual meshes of the arm's links, and the poses of the links at given joints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import collada
import numpy as np
import pinocchio as pin
from collada.triangleset import BoundTriangleSet
from lxml import etree

from core.design import Tool
from core.geometry import Array, Pose
from core.robot.description import ARM_JOINTS, FINGER_JOINTS, assemble
from plugins.listeners.rerun.shapes import Bytes, Triangles, rgba


@dataclass(frozen=True, eq=False)
class Track:
    """A frame over time: positions (T, 3) in metres and quaternions (T, 4) as (x, y, z, w), as Rerun has them."""

    positions: Array
    quaternions: Array


def links(gripper: bool) -> dict[str, Triangles]:
    """The visual mesh of each link of the bare arm, in the link's frame; with the hand, or without."""
    robot = etree.fromstring(assemble(Tool(gripper=gripper)).encode())
    found = {}
    for link in robot.findall("link"):
        pieces = []
        for visual in link.findall("visual"):
            pose = Pose.xyz_rpy(_numbers(visual, "string(origin/@xyz)"), _numbers(visual, "string(origin/@rpy)"))
            pieces.append(_load(Path(str(visual.xpath("string(geometry/mesh/@filename)")))).moved(pose))
        if pieces:
            found[str(link.get("name"))] = Triangles.joined(pieces)
    return found


def _numbers(element: Any, path: str) -> list[float]:
    return [float(x) for x in str(element.xpath(path)).split()] or [0.0, 0.0, 0.0]


@lru_cache(maxsize=16)
def _load(file: Path) -> Triangles:
    """The triangles of a Collada file, in the colours of its materials."""
    document = collada.Collada(str(file))
    primitives = [p for g in document.scene.objects("geometry") for p in g.primitives()]
    pieces = []
    for primitive in primitives:
        if not isinstance(primitive, BoundTriangleSet):
            continue  # lines, which the arm's files have too
        color = rgba(primitive.material.effect.diffuse)
        pieces.append(_merged(primitive.vertex[primitive.vertex_index.ravel()], color))
    return Triangles.joined(pieces)


def _merged(corners: Array, color: Bytes) -> Triangles:
    """Triangles of corners (3 F, 3), merged where they coincide, with the mean of the faces' normals: the files have
    separate corners for each face.
    """
    low, high = corners.min(axis=0), corners.max(axis=0)
    grid = np.round((corners - low) / np.maximum(high - low, 1e-9) * (2**21 - 1)).astype(np.int64)
    _, first, faces = np.unique(grid @ [1 << 42, 1 << 21, 1], return_index=True, return_inverse=True)
    a, b, c = corners.reshape(-1, 3, 3).swapaxes(0, 1)
    normals = np.repeat(np.cross(b - a, c - a), 3, axis=0)  # weighted by area
    sums = np.array([np.bincount(faces, weights) for weights in normals.T], dtype=np.float64).T
    normals = sums / np.maximum(np.linalg.norm(sums, axis=-1, keepdims=True), 1e-12)
    return Triangles.of(corners[first], faces.reshape(-1, 3), normals, color)


def tracks(gripper: bool, arm: Array, fingers: Array) -> dict[str, Track]:
    """The motion of each link in the world, at arm joints (T, 7) and fingers (T, 2)."""
    model, frames = _model(gripper)
    data = model.createData()
    joints = [*ARM_JOINTS, *(FINGER_JOINTS if gripper else ())]
    columns = [model.joints[model.getJointId(name)].idx_q for name in joints]
    q = np.zeros((len(arm), model.nq))
    q[:, columns] = np.hstack([arm, fingers])[:, : len(joints)]
    poses = np.empty((len(frames), len(arm), 7))
    for t, row in enumerate(q):
        pin.framesForwardKinematics(model, data, row)
        for k, number in enumerate(frames.values()):
            poses[k, t] = pin.SE3ToXYZQUAT(data.oMf[number])
    return {name: Track(pose[:, :3], pose[:, 3:]) for name, pose in zip(frames, poses, strict=True)}


@lru_cache(maxsize=2)
def _model(gripper: bool) -> tuple[pin.Model, dict[str, int]]:
    """The kinematics, and the numbers of the links' frames."""
    model = pin.buildModelFromXML(assemble(Tool(gripper=gripper), visuals=False))
    return model, {f.name: n for n, f in enumerate(model.frames) if f.type == pin.FrameType.BODY}
