"""Bodies and joints of files that others made: meshes and URDF. A file is untrusted: nothing in it is executed."""

from plugins.tasks.file.imports.imported import Imported
from plugins.tasks.file.imports.mesh import read_mesh
from plugins.tasks.file.imports.urdf import read_urdf

__all__ = ["Imported", "read_mesh", "read_urdf"]
