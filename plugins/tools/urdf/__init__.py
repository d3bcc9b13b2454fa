"""Tools written down as URDF."""
