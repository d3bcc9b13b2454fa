"""Bodies and joints of files that others made: meshes, URDF, MJCF. A file is untrusted: nothing in it is executed.

Covered by `tests/core/imports/test_mesh.py`, `tests/core/imports/test_urdf.py` and `tests/core/imports/test_mjcf.py`.
"""

from core.imports.bodies import Imported
from core.imports.mesh import read_mesh
from core.imports.mjcf import read_mjcf
from core.imports.urdf import read_urdf

__all__ = ["Imported", "read_mesh", "read_mjcf", "read_urdf"]
