"""Poses, and shapes: each kind of shape is a class that says all of itself."""
