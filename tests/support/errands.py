"""Scenes and goals for the embedded designer."""

CUBE = """
  - {name: cube, box: [0.06, 0.06, 0.06], position: [0.6, 0, 0.03], mass: 0.2}
"""


NEARER = """
  - {bodies: ["*"], place: [0.4, 0, null], tolerance: 0.02}
"""


TURNED = """
  - {bodies: ["*"], turned_deg: 90}
"""
