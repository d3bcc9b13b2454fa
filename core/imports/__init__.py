"""Robots and bodies of files that others made: URDF, MJCF that MuJoCo compiled, meshes and their hulls."""
