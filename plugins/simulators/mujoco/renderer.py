"""Draw with MuJoCo's own renderer, which needs OpenGL, in a model that holds visual shapes and no physics."""

from __future__ import annotations

import ctypes.util
import importlib
import logging
import os
import platform
from collections.abc import Mapping
from typing import Any

import numpy as np
import trimesh

from core.design import Tool
from core.errors import NoPicture
from core.geometry import Mesh
from core.interfaces import Image, Task
from core.robot.description import assemble
from core.robot.meshes import link_visuals
from core.scene import Camera, Geom, State
from plugins.simulators.mujoco.engine import mujoco
from plugins.simulators.mujoco.shapes import Element, add_geom
from plugins.simulators.rendering import Renderer

# Stands for collision meshes.
_SPECK = trimesh.creation.box((0.001, 0.001, 0.001)).export(file_type="stl")
# Of MUJOCO_GL, as in MuJoCo's own package.
_OFF = ("disable", "disabled", "off", "false", "0")


class MuJoCoRenderer(Renderer):
    """Draw with OpenGL.

    A context serves one thread at a time. It is bound for each call and released after it, so that any thread
    can draw next.

    Raises:
        NoPicture: there is no OpenGL here that draws without a window, or it is switched off; says what was tried.
    """

    _opengl: Any = None
    _context: Any = None

    def __init__(self) -> None:
        self._opengl, device = _open_gl()
        self.name = f"MuJoCo's renderer on {device}"

    def __del__(self) -> None:
        if self._context is not None:
            with self._opengl.as_current():
                self._context.free()

    def load(self, task: Task, seed: int, tool: Tool) -> None:
        """Compile a model of what is drawn, and load it into the context.

        Args:
            task: has the robot and the scene.
            seed: of the layout.
            tool: what the arm holds.
        """
        robot = task.robot
        urdf = assemble(
            robot,
            tool,
            visuals=False,
            mesh_path=lambda _: "0.stl",
        )
        spec = mujoco.MjSpec.from_string(urdf, assets={"0.stl": _SPECK})
        spec.compiler.discardvisual = False  # a description's reader would

        for geom in list(spec.geoms):
            spec.delete(geom)
        for link, visuals in link_visuals(robot, tool.gripper).items():
            for part in visuals:
                _show(spec, spec.body(link), part)

        for component in tool.components:
            bearer, pose = tool.borne[component.name]
            drawn = Geom(component.shape, pose, component.color)
            _show(spec, spec.body(bearer), drawn)

        scene = task.scene(seed).furnished(tool)
        for body in scene.bodies:
            element = spec.worldbody.add_body(
                name=f"scene/{body.name}", mocap=True, pos=body.pose.position
            )
            element.quat = body.pose.quaternion

            for part in body.visuals:
                _show(spec, element, part)

        _light(spec)
        self._softs = scene.softs
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        with self._opengl.as_current():
            if self._context is not None:
                self._context.free()
            self._context = mujoco.MjrContext(
                self._model, mujoco.mjtFontScale.mjFONTSCALE_100
            )

        self._scene = mujoco.MjvScene(self._model, maxgeom=self._model.ngeom + 10)

    def pose(self, joints: Mapping[str, float], state: State) -> None:
        """See `Renderer.pose`; soft bodies get the shapes of their nodes."""
        for name, value in joints.items():
            self._data.joint(name).qpos[0] = value

        for name in state.names:
            body = self._model.body(f"scene/{name}").id
            number = self._model.body_mocapid[body]
            self._data.mocap_pos[number] = state.position(name)
            self._data.mocap_quat[number] = state.quaternion(name)

        mujoco.mj_kinematics(self._model, self._data)

        for soft in self._softs:
            surface = soft.form.surface(state.nodes(soft.name))
            self._bend(soft.name, surface)

        mujoco.mj_camlight(self._model, self._data)

    def _bend(self, name: str, surface: Mesh) -> None:
        """Give a soft body's mesh other vertices and smooth normals, in the frame of its geom.

        Args:
            name: the body's.
            surface: in the world, with the same faces as before.
        """
        model = self._model
        geom = int(self._model.body(f"scene/{name}").geomadr[0])
        number = int(model.geom_dataid[geom])
        turn = self._data.geom_xmat[geom].reshape(3, 3)
        first_vertex = model.mesh_vertadr[number]
        vertices = slice(first_vertex, first_vertex + model.mesh_vertnum[number])

        places = surface.vertices - self._data.geom_xpos[geom]
        model.mesh_vert[vertices] = places @ turn

        first_face = model.mesh_faceadr[number]
        faces = slice(first_face, first_face + model.mesh_facenum[number])
        normals = model.mesh_normaladr[number] + model.mesh_facenormal[faces].ravel()
        corners = model.mesh_face[faces].ravel()
        smooth = surface.to_trimesh().vertex_normals @ turn
        model.mesh_normal[normals] = smooth[corners]

        with self._opengl.as_current():
            mujoco.mjr_uploadMesh(model, self._context, number)

    def shoot(self, camera: Camera, width: int, height: int) -> Image:
        """See `Renderer.shoot`."""
        extent = camera.height_m
        if extent is None:
            extent = camera.fov_deg
        self._model.vis.global_.fovy = extent
        everything = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(
            self._model,
            self._data,
            mujoco.MjvOption(),
            mujoco.MjvPerturb(),
            _look(camera),
            everything,
            self._scene,
        )
        view = mujoco.MjrRect(
            0,
            0,
            width,
            height,
        )
        picture = np.empty((height, width, 3), np.uint8)
        with self._opengl.as_current():
            mujoco.mjr_resizeOffscreen(width, height, self._context)
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
            mujoco.mjr_render(view, self._scene, self._context)
            mujoco.mjr_readPixels(
                picture,
                None,
                view,
                self._context,
            )

        return picture[::-1]


def _open_gl() -> tuple[Any, str]:
    """Create a context that draws without a window.

    The environment variable MUJOCO_GL chooses the library or switches drawing off, as everywhere with MuJoCo. By
    default the first library found is taken.

    Returns:
        the context, MuJoCo's ``GLContext``, and the name of the device that it draws on.

    Raises:
        NoPicture: there is no such library, it fails, or drawing is switched off.
    """
    libraries = {"egl": "EGL", "osmesa": "OSMesa"}
    if platform.system() == "Darwin":
        libraries = {"cgl": "OpenGL"}

    chosen = os.environ.get("MUJOCO_GL", "").lower().strip()
    if chosen in _OFF:
        raise NoPicture(f"MuJoCo's own renderer is switched off (MUJOCO_GL={chosen})")
    found = [
        name for name, library in libraries.items() if ctypes.util.find_library(library)
    ]
    if chosen in libraries:
        found = [chosen]
    if not found:
        names = ", ".join(libraries.values())
        raise _no_open_gl(f"none of the libraries {names} is there")

    name = found[0]
    library = libraries[name]
    # It logs that an optional package is missing.
    logging.getLogger("OpenGL.acceleratesupport").setLevel(logging.WARNING)

    try:
        context = importlib.import_module(f"mujoco.{name}").GLContext(640, 480)
        gl = importlib.import_module("OpenGL.GL")
        with context.as_current():
            device = gl.glGetString(gl.GL_RENDERER).decode()
    except Exception as error:  # PyOpenGL's errors differ with what is missing
        reason = " ".join(str(error).split()) or type(error).__name__
        raise _no_open_gl(f"{library}: {reason}") from error

    return context, f"{device} ({library})"


def _no_open_gl(why: str) -> NoPicture:
    """Build the error that says why nothing can be drawn."""
    return NoPicture(f"MuJoCo's own renderer needs OpenGL without a window ({why})")


def _show(spec: Element, bearer: Element, part: Geom) -> None:
    """Add a shape that is only drawn.

    Args:
        spec: gets its mesh, if it has one.
        bearer: the spec's body that it is part of.
        part: the shape, and where it is in the body.
    """
    geom = add_geom(
        spec,
        bearer,
        part.shape,
        part.pose,
    )
    geom.rgba = part.color
    geom.contype = 0
    geom.conaffinity = 0
    geom.mass = 1e-6
    if geom.meshname:
        mesh = spec.mesh(geom.meshname)
        mesh.userface = np.ravel(part.shape.triangles.faces).astype(np.int32)
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # for open meshes


def _light(spec: Element) -> None:
    """Add one sun with shadows, ambient light, and a white background."""
    white = {
        "type": mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        "builtin": mujoco.mjtBuiltin.mjBUILTIN_FLAT,
    }
    spec.add_texture(
        **white,
        rgb1=[1, 1, 1],
        rgb2=[1, 1, 1],
        width=8,
        height=48,
    )
    sun = spec.worldbody.add_light(
        pos=[1.5, -1.5, 3.0], dir=[-1.0, 1.0, -2.0], castshadow=True
    )
    sun.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL

    sun.diffuse = [0.55] * 3
    sun.ambient = [0.0] * 3
    sun.specular = [0.1] * 3
    spec.visual.headlight.ambient = [0.5] * 3
    spec.visual.headlight.diffuse = [0.1] * 3
    spec.visual.headlight.specular = [0.0] * 3

    # Metres; the extent is the unit of the view settings.
    spec.stat.extent = 1.0
    spec.stat.center = [0.6, 0.0, 0.2]
    spec.visual.map.znear = 0.02
    spec.visual.map.zfar = 15.0
    spec.visual.map.shadowclip = 8.0
    spec.visual.quality.shadowsize = 4096


def _look(camera: Camera) -> Any:
    """Make MuJoCo's camera: it orbits its target, at an azimuth and an elevation in degrees.

    Straight down the azimuth is that of the picture's upper edge.
    """
    way = np.subtract(camera.target, camera.position)
    view = mujoco.MjvCamera()
    view.type = mujoco.mjtCamera.mjCAMERA_FREE
    view.orthographic = camera.height_m is not None
    view.lookat[:] = camera.target
    view.distance = float(np.linalg.norm(way))

    across = np.hypot(way[0], way[1])
    along = way
    if across < 1e-6:
        along = camera.axes[1]

    view.azimuth = float(np.degrees(np.arctan2(along[1], along[0])))
    view.elevation = float(np.degrees(np.arctan2(way[2], across)))
    return view
