"""Write parts as STEP files: exact solids of Open CASCADE, for those who mill or edit.

Boxes, cylinders and balls are what they are; hulls and meshes have flat sides. Numbers are not pressed in.
Lengths of solids are millimetres, those of shapes metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from OCP.BRepAlgoAPI import BRepAlgoAPI_Common, BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakePolygon,
    BRepBuilderAPI_MakeSolid,
    BRepBuilderAPI_Sewing,
    BRepBuilderAPI_Transform,
)
from OCP.BRepGProp import BRepGProp
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakeSphere,
)
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Quaternion, gp_Trsf, gp_Vec
from OCP.GProp import GProp_GProps
from OCP.Message import Message
from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain
from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS

from core.geometry import Array, Box, Cylinder, Mesh, Pose, Shape, Sphere
from core.support.cli import write_bytes
from plugins.results.workshop.body import Body
from plugins.results.workshop.printing import Check
from plugins.results.workshop.solid import Placed, to_mesh, union
from plugins.results.workshop.tool import PrintedTool

SAME_VOLUME = 0.01  # by which an exact solid may differ from that of triangles
SEWN_MM = 1e-4  # between the edges of two triangles
TOUCH_MM3 = 1e-3


class Exact:
    """A solid of Open CASCADE, with the operators of a Manifold that cuts and joints need.

    Args:
        shape: a ``TopoDS_Shape``.
    """

    def __init__(self, shape: Any) -> None:
        self.shape = shape

    def __add__(self, other: Exact) -> Exact:
        return Exact(_merge_faces(BRepAlgoAPI_Fuse(self.shape, other.shape).Shape()))

    def __sub__(self, other: Exact) -> Exact:
        return Exact(BRepAlgoAPI_Cut(self.shape, other.shape).Shape())

    def __xor__(self, other: Exact) -> Exact:
        return Exact(BRepAlgoAPI_Common(self.shape, other.shape).Shape())

    def volume(self) -> float:
        """Compute its volume, mm³."""
        return float(self._integrals().Mass())

    @property
    def middle(self) -> Array:
        """Its centre of mass (3,)."""
        point = self._integrals().CentreOfMass()
        return np.array([point.X(), point.Y(), point.Z()])

    def decompose(self) -> list[Exact]:
        """Return the solids that don't hang together."""

        explorer = TopExp_Explorer(self.shape, TopAbs_ShapeEnum.TopAbs_SOLID)
        found = []
        while explorer.More():
            found.append(Exact(explorer.Current()))
            explorer.Next()

        return found

    def write(self, file: Path) -> None:
        """Write it as a STEP file, in millimetres."""

        Message.DefaultMessenger_s().ChangePrinters().Clear()
        writer = STEPControl_Writer()
        writer.Transfer(self.shape, STEPControl_StepModelType.STEPControl_AsIs)
        write_bytes(file, b"")
        writer.Write(str(file))

    def _integrals(self) -> Any:
        integrals = GProp_GProps()
        BRepGProp.VolumeProperties_s(self.shape, integrals)
        return integrals


def _merge_faces(shape: Any) -> Any:
    """Merge faces that lie in one surface."""
    upgrade = ShapeUpgrade_UnifySameDomain(shape, True, True, False)
    upgrade.Build()
    return upgrade.Shape()


def make_exact(shapes: Sequence[Placed]) -> Exact:
    """Return the union of shapes."""
    solids = []
    for shape, pose in shapes:
        for part, place in shape.urdf_parts():
            solids.append(
                _make_primitive(part, pose if place is None else pose @ place)
            )

    whole = solids[0]
    for solid in solids[1:]:
        whole = whole + solid

    return whole


def _make_primitive(shape: Shape, pose: Pose) -> Exact:
    """Return a box, a cylinder or a ball as it is, and all else with flat sides."""

    made: Any
    if isinstance(shape, Box):
        half = 500 * np.array(shape.size)
        made = BRepPrimAPI_MakeBox(gp_Pnt(*-half), gp_Pnt(*half)).Shape()
    elif isinstance(shape, Cylinder):
        length = 1000 * shape.length
        axis = gp_Ax2(gp_Pnt(0, 0, -length / 2), gp_Dir(0, 0, 1))
        made = BRepPrimAPI_MakeCylinder(axis, 1000 * shape.radius, length).Shape()
    elif isinstance(shape, Sphere):
        made = BRepPrimAPI_MakeSphere(1000 * shape.radius).Shape()
    else:
        made = _sew(shape.triangles)

    w, x, y, z = (float(value) for value in pose.quaternion)
    move = gp_Trsf()
    move.SetTransformation(gp_Quaternion(x, y, z, w), gp_Vec(*(1000 * pose.position)))
    return Exact(BRepBuilderAPI_Transform(made, move, True).Shape())


def _sew(mesh: Mesh) -> Any:
    """Sew triangles to a solid, and merge those in one plane."""

    corners = 1000 * np.asarray(mesh.vertices)
    sewing = BRepBuilderAPI_Sewing(SEWN_MM)
    for triangle in np.asarray(mesh.faces):
        outline = BRepBuilderAPI_MakePolygon(
            *(gp_Pnt(*corners[corner]) for corner in triangle), True
        )
        if outline.IsDone():
            sewing.Add(BRepBuilderAPI_MakeFace(outline.Wire(), True).Face())

    sewing.Perform()
    shell = TopoDS.Shell(sewing.SewedShape())
    return _merge_faces(BRepBuilderAPI_MakeSolid(shell).Solid())


def write_step(printed_tool: PrintedTool, folder: Path) -> Check:
    """Write a STEP file of each part, and compare its volume with that of the part.

    Raises:
        UserError: a file can't be written.
    """
    most = 0.0
    for body in printed_tool.bodies:
        parts = [part for part in printed_tool.parts if part.link == body.link.name]
        solids = _cut(printed_tool, body)
        for part in parts:
            middle = to_mesh(part.solid).center_mass
            solid = min(solids, key=lambda solid: _distance(solid, middle))
            solid.write(folder / f"{part.name}.step")
            volume = float(part.solid.volume())
            most = max(most, abs(solid.volume() - volume) / volume)

    differ = f"STEP files differ from the parts by up to {most:.2%} in volume"
    mend = "let components overlap, or part them clearly"
    return Check("STEP", most <= SAME_VOLUME, differ, mend)


def _distance(solid: Exact, point: Array) -> float:
    return float(np.linalg.norm(solid.middle - point))


def _cut(printed_tool: PrintedTool, body: Body) -> list[Exact]:
    """Make a link of a tool as an exact solid, fitted to its mount, and cut it as its parts were."""
    mount = body.mount
    shapes = body.link.grown(body.weld_mm)
    plain = union(shapes)
    whole = make_exact(shapes)
    for steps, sign in ((mount.clearing, -1), (mount.adding, 1), (mount.taking, -1)):
        near = [
            placed
            for placed in steps
            if sign > 0 or (plain ^ union([placed])).volume() > TOUCH_MM3
        ]
        if near:
            made = make_exact(near)
            whole = whole + made if sign > 0 else whole - made
        if sign > 0 and steps:
            plain = plain + union(steps)

    pieces = [whole]
    for joint in printed_tool.joints:
        if joint.component not in body.link.names:
            continue

        below, above = (pieces[n] for n in joint.find_pieces(pieces, make_exact))
        pieces = [piece for piece in pieces if piece not in (below, above)]
        if (
            below is above
        ):  # a cut that opens a loop beside another one has parted it already
            halves = joint.split(below, make_exact)
            assert halves is not None, f"{joint.name} does not part the exact solid"
            below, above = halves

        pieces += joint.finish(below, above, make_exact)

    return pieces
