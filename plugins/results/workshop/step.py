"""Write solids as STEP, exactly: boxes, cylinders, spheres and capsules as such, hulls as planes.

It needs Open CASCADE. Covered by `tests/plugins/results/workshop/test_tool.py`.
"""

from __future__ import annotations

import importlib.util
import tempfile
from collections.abc import Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from core.geometry import Array, Box, Capsule, Compound, Cylinder, Mesh, Shape, Sphere
from core.support.cli import write_bytes
from plugins.results.workshop.solid import Placed, Workpiece

SAME_VOLUME = 0.01  # by how much a model may differ from the solid
NO_STEP = "no STEP was written; for it: pip install 'cadquery-ocp-novtk>=8,<9'"


def can_write_step() -> bool:
    """Report whether Open CASCADE is installed."""
    return importlib.util.find_spec("OCP") is not None


def write_step(solids: Mapping[str, Workpiece], file: Path) -> list[str]:
    """Write named solids to one STEP file, each in its mount's frame, in millimetres; nothing without Open CASCADE.

    Returns:
        The names of those that are left out, since their exact model has another volume: Open CASCADE fails at slivers.

    Raises:
        UserError: the file can't be written.
    """
    if not can_write_step():
        return []
    from OCP.BRep import BRep_Builder
    from OCP.Message import Message
    from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer
    from OCP.TopoDS import TopoDS_Compound

    Message.DefaultMessenger_s().ChangePrinters().Clear()  # it prints to standard output
    whole, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(whole)
    missing = []
    for name, solid in solids.items():
        shape, volume = _unified(model(solid)), solid.body.volume()
        if shape.IsNull() or abs(_weighed(shape).Mass() - volume) > SAME_VOLUME * volume:
            missing.append(name)
        else:
            builder.Add(whole, shape)
    if len(missing) == len(solids):
        return missing
    writer = STEPControl_Writer()
    writer.Transfer(whole, STEPControl_StepModelType.STEPControl_AsIs)
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "made.step"
        writer.Write(str(made))
        write_bytes(file, made.read_bytes())
    return missing


@lru_cache(maxsize=64)
def model(piece: Workpiece) -> Any:
    """Return a solid as a shape of Open CASCADE, in millimetres, with each of its operations done once."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Common, BRepAlgoAPI_Cut

    if piece.before is None:
        return _fused(map(_placed, piece.shapes))
    whole = model(piece.before)
    if piece.middle is not None:
        return _nearest(whole, 1000 * piece.middle)
    if piece.kind == "add":
        return _fused([whole, *map(_placed, piece.shapes)])
    other = _fused(map(_placed, piece.shapes))
    return (BRepAlgoAPI_Common if piece.kind == "keep" else BRepAlgoAPI_Cut)(whole, other).Shape()


def _nearest(whole: Any, middle: Array) -> Any:
    """Take the body of a shape whose centre of mass is next to a point (3,)."""
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer

    bodies, found = list[tuple[float, Any]](), TopExp_Explorer(whole, TopAbs_ShapeEnum.TopAbs_SOLID)
    while found.More():
        at = _weighed(found.Current()).CentreOfMass()
        bodies.append((float(np.linalg.norm(np.array([at.X(), at.Y(), at.Z()]) - middle)), found.Current()))
        found.Next()
    return min(bodies, key=lambda each: each[0])[1]


def _weighed(shape: Any) -> Any:
    """The volume of a shape, as its ``Mass()``, and its centre."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    weighed = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, weighed)
    return weighed


def _fused(shapes: Iterable[Any]) -> Any:
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse

    whole: Any = None
    for shape in shapes:
        whole = shape if whole is None else BRepAlgoAPI_Fuse(whole, shape).Shape()
    return whole


def _unified(shape: Any) -> Any:
    """Merge neighbouring faces of one surface."""
    from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain

    merged = ShapeUpgrade_UnifySameDomain(shape, True, True, False)
    merged.Build()
    return merged.Shape()


def _placed(placed: Placed) -> Any:
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
    from OCP.gp import gp_Trsf

    shape, pose = placed
    where, rows = gp_Trsf(), pose.matrix
    rows[:3, 3] *= 1000
    where.SetValues(*rows[:3].ravel().tolist())
    return BRepBuilderAPI_Transform(_shape(shape), where, True).Shape()


def _shape(shape: Shape | Compound) -> Any:
    """Return a shape in its own frame."""
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakeSphere
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

    match shape:
        case Box(size):
            x, y, z = (1000 * side for side in size)
            return BRepPrimAPI_MakeBox(gp_Pnt(-x / 2, -y / 2, -z / 2), x, y, z).Shape()
        case Sphere(radius):
            return BRepPrimAPI_MakeSphere(1000 * radius).Shape()
        case Cylinder(radius, length):
            below = gp_Ax2(gp_Pnt(0, 0, -500 * length), gp_Dir(0, 0, 1))
            return BRepPrimAPI_MakeCylinder(below, 1000 * radius, 1000 * length).Shape()
        case Capsule(radius, length):
            ends = [BRepPrimAPI_MakeSphere(gp_Pnt(0, 0, z * length), 1000 * radius).Shape() for z in (-500, 500)]
            return _fused([_shape(Cylinder(radius, length)), *ends])
        case Compound(surface, _):
            return _faceted(surface)
        case Mesh():
            return _faceted(shape)


def _faceted(mesh: Mesh) -> Any:
    """Sew triangles to a solid, and merge those in one plane."""
    from OCP.BRepBuilderAPI import (
        BRepBuilderAPI_MakeFace,
        BRepBuilderAPI_MakePolygon,
        BRepBuilderAPI_MakeSolid,
        BRepBuilderAPI_Sewing,
    )
    from OCP.gp import gp_Pnt
    from OCP.TopoDS import TopoDS

    sewing = BRepBuilderAPI_Sewing(1e-4)
    corners = [gp_Pnt(*corner) for corner in (1000 * np.asarray(mesh.vertices)).tolist()]
    for a, b, c in mesh.faces.tolist():
        face = BRepBuilderAPI_MakeFace(
            BRepBuilderAPI_MakePolygon(corners[a], corners[b], corners[c], True).Wire(), True
        )
        if face.IsDone():
            sewing.Add(face.Face())
    sewing.Perform()
    return _unified(BRepBuilderAPI_MakeSolid(TopoDS.Shell(sewing.SewedShape())).Solid())
