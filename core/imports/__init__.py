"""Robots and bodies of files that others made: meshes, convex hulls, and what a compiler of MJCF says."""
