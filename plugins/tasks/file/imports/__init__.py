"""Bodies and joints of files that others made: meshes, URDF and MJCF. A file is untrusted: nothing in it is run."""

from plugins.tasks.file.imports.bodies import read_bodies
from plugins.tasks.file.imports.imported import Imported
from plugins.tasks.file.imports.mesh import read_mesh

__all__ = ["Imported", "read_bodies", "read_mesh"]
