"""Write solids as STEP, exactly: boxes, cylinders, spheres and capsules as such, hulls as planes.

It needs Open CASCADE. Covered by `tests/plugins/results/workshop/test_tool.py`.
"""

from __future__ import annotations

import importlib.util
import tempfile
from collections.abc import Iterable, Mapping
from functools import lru_cache, reduce
from pathlib import Path
from typing import Any

import numpy as np

from core.geometry import Array, Box, Capsule, Compound, Cylinder, Mesh, Pose, Shape, Sphere
from core.support.cli import write_bytes
from plugins.results.workshop.printing import Check
from plugins.results.workshop.solid import Placed, Workpiece

SAME_VOLUME = 0.01  # by how much a model may differ from the solid
NO_STEP = "none was written; for it: pip install 'cadquery-ocp-novtk>=8,<9'"


def write_step(solids: Mapping[str, Workpiece], file: Path) -> list[Check]:
    """Write named solids to one STEP file, each in its mount's frame, in millimetres.

    Returns:
        Checks of those that are left out, since their exact model has another volume: Open CASCADE fails at slivers;
        or one that Open CASCADE is not installed.

    Raises:
        UserError: the file can't be written.
    """
    if importlib.util.find_spec("OCP") is None:
        return [Check("STEP", None, NO_STEP)]
    from OCP import BRep, Message, STEPControl, TopoDS

    Message.Message.DefaultMessenger_s().ChangePrinters().Clear()  # it prints to standard output
    whole, builder = TopoDS.TopoDS_Compound(), BRep.BRep_Builder()
    builder.MakeCompound(whole)
    missing = list[Check]()
    for name, solid in solids.items():
        shape, volume = _unified(model(solid)), solid.body.volume()
        if shape.IsNull() or abs(_weighed(shape).Mass() - volume) > SAME_VOLUME * volume:
            missing.append(Check("STEP", False, f"{name} can't be modelled"))
        else:
            builder.Add(whole, shape)
    if len(missing) < len(solids):
        writer = STEPControl.STEPControl_Writer()
        writer.Transfer(whole, STEPControl.STEPControl_StepModelType.STEPControl_AsIs)
        with tempfile.TemporaryDirectory() as folder:
            made = Path(folder) / "made.step"
            writer.Write(str(made))
            write_bytes(file, made.read_bytes())
    return missing


@lru_cache(maxsize=64)
def model(piece: Workpiece) -> Any:
    """Return a solid as a shape of Open CASCADE, in millimetres, with each of its operations done once."""
    from OCP import BRepAlgoAPI

    if piece.before is None:
        return _fused(map(_placed, piece.shapes))
    whole = model(piece.before)
    if piece.middle is not None:
        return _nearest(whole, 1000 * piece.middle)
    if piece.kind == "add":
        return _fused([whole, *map(_placed, piece.shapes)])
    operation = BRepAlgoAPI.BRepAlgoAPI_Common if piece.kind == "keep" else BRepAlgoAPI.BRepAlgoAPI_Cut
    return operation(whole, _fused(map(_placed, piece.shapes))).Shape()


def _nearest(whole: Any, middle: Array) -> Any:
    """Take the body of a shape whose centre of mass is next to a point (3,)."""
    from OCP import TopAbs, TopExp, gp

    bodies, found = [], TopExp.TopExp_Explorer(whole, TopAbs.TopAbs_ShapeEnum.TopAbs_SOLID)
    while found.More():
        bodies.append(found.Current())
        found.Next()
    point = gp.gp_Pnt(*middle.tolist())
    return min(bodies, key=lambda body: _weighed(body).CentreOfMass().Distance(point))


def _weighed(shape: Any) -> Any:
    """The volume of a shape, as its ``Mass()``, and its centre."""
    from OCP import BRepGProp, GProp

    weighed = GProp.GProp_GProps()
    BRepGProp.BRepGProp.VolumeProperties_s(shape, weighed)
    return weighed


def _fused(shapes: Iterable[Any]) -> Any:
    from OCP import BRepAlgoAPI

    return reduce(lambda whole, shape: BRepAlgoAPI.BRepAlgoAPI_Fuse(whole, shape).Shape(), shapes)


def _unified(shape: Any) -> Any:
    """Merge neighbouring faces of one surface."""
    from OCP import ShapeUpgrade

    merged = ShapeUpgrade.ShapeUpgrade_UnifySameDomain(shape, True, True, False)
    merged.Build()
    return merged.Shape()


def _placed(placed: Placed) -> Any:
    from OCP import BRepBuilderAPI, gp

    shape, pose = placed
    where, rows = gp.gp_Trsf(), pose.matrix
    rows[:3, 3] *= 1000
    where.SetValues(*rows[:3].ravel().tolist())
    return BRepBuilderAPI.BRepBuilderAPI_Transform(_shape(shape), where, True).Shape()


def _shape(shape: Shape | Compound) -> Any:
    """Return a shape in its own frame."""
    from OCP import BRepPrimAPI, gp

    match shape:
        case Box(size):
            x, y, z = (1000 * side for side in size)
            return BRepPrimAPI.BRepPrimAPI_MakeBox(gp.gp_Pnt(-x / 2, -y / 2, -z / 2), x, y, z).Shape()
        case Sphere(radius):
            return BRepPrimAPI.BRepPrimAPI_MakeSphere(1000 * radius).Shape()
        case Cylinder(radius, length):
            below = gp.gp_Ax2(gp.gp_Pnt(0, 0, -500 * length), gp.gp_Dir(0, 0, 1))
            return BRepPrimAPI.BRepPrimAPI_MakeCylinder(below, 1000 * radius, 1000 * length).Shape()
        case Capsule(radius, length):
            ends = [(Sphere(radius), Pose(np.array([0.0, 0.0, z]))) for z in (-length / 2, length / 2)]
            return _fused([_shape(Cylinder(radius, length)), *map(_placed, ends)])
        case Compound(surface, _):
            return _faceted(surface)
        case Mesh():
            return _faceted(shape)


def _faceted(mesh: Mesh) -> Any:
    """Sew triangles to a solid, and merge those in one plane."""
    from OCP import BRepBuilderAPI, TopoDS, gp

    sewing = BRepBuilderAPI.BRepBuilderAPI_Sewing(1e-4)
    for triangle in (1000 * np.asarray(mesh.vertices))[mesh.faces].tolist():
        outline = BRepBuilderAPI.BRepBuilderAPI_MakePolygon(*(gp.gp_Pnt(*corner) for corner in triangle), True)
        face = BRepBuilderAPI.BRepBuilderAPI_MakeFace(outline.Wire(), True)
        if face.IsDone():
            sewing.Add(face.Face())
    sewing.Perform()
    return _unified(BRepBuilderAPI.BRepBuilderAPI_MakeSolid(TopoDS.TopoDS.Shell(sewing.SewedShape())).Solid())
