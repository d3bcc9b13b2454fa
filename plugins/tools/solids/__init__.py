"""Tools of solids: unions, differences, intersections, extrusions and revolutions."""

from core.hooks import Factories, hookimpl


@hookimpl
def tool_representations() -> Factories:
    return {"solids": "plugins.tools.solids.representation:SolidTools"}
