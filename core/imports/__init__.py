"""Bodies and joints of files that others made: meshes and URDF. A file is untrusted: nothing in it is executed.

Covered by `tests/core/imports/test_mesh.py` and `tests/core/imports/test_urdf.py`.
"""

from core.imports.bodies import Imported
from core.imports.mesh import read_mesh
from core.imports.urdf import read_urdf

__all__ = ["Imported", "read_mesh", "read_urdf"]
