"""Tools as components of any form, each a tree of shapes."""

from __future__ import annotations

import json
from collections.abc import Iterable
from types import MappingProxyType

from core.design import DesignError
from core.geometry import KINDS, PRIMITIVES, Array, Box, Pose, Shape
from core.interfaces import JsonObject
from plugins.tools.components import TEXT, ComponentTools, ReadShape, rounded
from plugins.tools.refusals import ToolReason
from plugins.tools.solids.building import MAX_TRIANGLES, NATIVES, count_triangles
from plugins.tools.solids.making import MAX_PARTS, WITHIN_M, make_shape, node_of
from plugins.tools.solids.tree_reading import (
    MAX_NODES,
    MAX_POINTS,
    MAX_SIZE_M,
    SIZES,
    Node,
    TreeReader,
    dump_node,
)

FIELD = "tool_solids"


class _Reader:
    """Reads the trees of one tool and counts their triangles, then makes the shapes and counts their parts."""

    def __init__(self) -> None:
        self._reader = TreeReader()
        self._trees = dict[str, Node]()
        self._triangles = 0
        self._parts = 0

    def read(self, item: JsonObject, where: str) -> tuple[Shape, Pose]:
        """Read a tree; what is returned stands in for its shape."""
        node = self._reader.read(item.get("solid"), f"{where}: solid")
        self._trees[where] = node
        if node.kind not in SIZES:
            self._triangles += count_triangles(node)
        if self._triangles > MAX_TRIANGLES:
            raise DesignError.because(
                ToolReason.SOLIDS_TRIANGLES,
                where=where,
                count=self._triangles,
                most=MAX_TRIANGLES,
            )

        return Box((1.0, 1.0, 1.0)), Pose()

    def make(self, item: JsonObject, where: str) -> tuple[Shape, Pose]:
        try:
            shape, pose = make_shape(self._trees[where], MAX_PARTS - self._parts)
        except DesignError as error:
            raise error.placed(f"{where}: its solid ", where=where) from error

        if not shape.is_convex:
            self._parts += len(shape.convex_parts())

        return shape, pose


class SolidTools(ComponentTools):
    """A tool is one field, ``tool_solids``: components, each with a tree of shapes as JSON text.

    The tree is a text because no schema of a tree is accepted everywhere. A tree needs a schema that refers to itself:
    OpenAI's strict mode takes one, Anthropic's refuses it, and Gemini unrolls it a few levels. Nested without
    references, a tree of ten kinds of nodes and depth 4 has ten thousand. A text is accepted by all; values in its
    place, as a model without a strict schema may write them, are read as well.
    """

    shapes = tuple(PRIMITIVES)
    field = FIELD
    keys = ("solid",)
    template = "solids"
    limits = MappingProxyType(
        {
            "MAX_SIZE_M": MAX_SIZE_M,
            "MAX_NODES": MAX_NODES,
            "MAX_POINTS": MAX_POINTS,
            "WITHIN_M": WITHIN_M,
            "MAX_PARTS": MAX_PARTS,
            "kinds": [kind for kind in KINDS if kind.kind not in NATIVES],
        }
    )
    shape_schemas = ({"solid": TEXT | {"description": "the tree of shapes, as JSON"}},)

    def example_shape(self, size: Array) -> JsonObject:
        hole = {"cylinder": [0.003, 0.1], "at": [0, 0, 0.005, 1.5708, 0, 0]}
        return {"solid": json.dumps({"difference": [{"box": rounded(size)}, hole]})}

    def readers(self) -> Iterable[ReadShape]:
        reader = _Reader()
        return [reader.read, reader.make]

    def write_shape(self, shape: Shape, where: str) -> JsonObject:
        return {"solid": json.dumps(dump_node(node_of(shape)), separators=(",", ":"))}
