"""Tools of solids: unions, differences, intersections, extrusions and revolutions."""
