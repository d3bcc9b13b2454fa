"""Write descriptions as URDF text."""

from __future__ import annotations

import html
from collections.abc import Callable
from pathlib import Path
from typing import Any

from core.geometry import Primitive
from core.values.descriptions import (
    NO_LIMITS,
    ONE,
    Description,
    RobotJoint,
    RobotLink,
    RobotShape,
)

MeshPath = Callable[[Path], str]

# Each link has an inertia: engines would guess one. URDF has no springs; other readers skip our <spring>.
_URDF = """\
{% macro write_shape(tag, part, material) %}
<{{ tag }}>
  <origin{{ set(xyz=part.origin.xyz, rpy=part.origin.rpy) }}/>
  <geometry>
    {{ write_solid(part) }}
  </geometry>
{% if material %}
  <material{{ set(name=material) }}>
    <color{{ set(rgba=part.color) }}/>
  </material>
{% endif %}
</{{ tag }}>
{% endmacro %}
{% macro write_link(link) %}
{% set inertia = link.inertial %}
{% set xx, xy, xz, yy, yz, zz = inertia.moments %}
{% set colors = link.visuals | map(attribute="color") | unique | list %}
<link{{ set(name=link.name) }}>
  <inertial>
    <origin{{ set(xyz=inertia.center, rpy=inertia.rpy) }}/>
    <mass{{ set(value=inertia.mass) }}/>
    <inertia{{ set(ixx=xx, ixy=xy, ixz=xz, iyy=yy, iyz=yz, izz=zz) }}/>
  </inertial>
{% for part in link.visuals if visuals %}
{% set name = "" if part.color is none else link.name ~ "_color" ~ (colors.index(part.color) or "") %}
{{ write_shape("visual", part, name) | indent(2, true) -}}
{% endfor %}
{% for part in link.collisions %}
{{ write_shape("collision", part, "") | indent(2, true) -}}
{% endfor %}
</link>
{% endmacro %}
{% macro write_joint(joint) %}
<joint{{ set(name=joint.name, type=joint.kind) }}>
  <parent{{ set(link=joint.parent) }}/>
  <child{{ set(link=joint.child) }}/>
  <origin{{ set(xyz=joint.origin.xyz, rpy=joint.origin.rpy) }}/>
{% if joint.kind != "fixed" %}
  <axis{{ set(xyz=joint.axis) }}/>
{% set most = joint.limits %}
{% if most != no_limits %}
  <limit{{ set(lower=most.lower, upper=most.upper, effort=most.effort, velocity=most.velocity) }}/>
{% endif %}
  <dynamics{{ set(damping=joint.damping, friction=joint.friction) }}/>
{% set mimic = joint.mimic %}
{% if mimic %}
  <mimic{{ set(joint=mimic.joint, multiplier=mimic.multiplier, offset=mimic.offset) }}/>
{% endif %}
{% if joint.spring %}
  <spring{{ set(stiffness=joint.spring[0], rest=joint.spring[1]) }}/>
{% endif %}
{% endif %}
</joint>
{% endmacro %}
{% if robot is none %}
{{ write_link(links[0]) }}{{ write_joint(joints[0]) -}}
{% else %}
<robot{{ set(name=robot) }}>
{% for link in links %}
{{ write_link(link) | indent(2, true) -}}
{% endfor %}
{% for joint in joints %}
{{ write_joint(joint) | indent(2, true) -}}
{% endfor %}
</robot>
{% endif %}
"""


def write(
    description: Description, *, visuals: bool = True, mesh_path: MeshPath = str
) -> str:
    """Write a description as URDF text.

    Args:
        description: links and joints.
        visuals: include the visual shapes.
        mesh_path: maps a mesh's absolute path to the text that is written.
    """
    links = [*description.links.values()]
    joints = [*description.joints.values()]
    return _fill(mesh_path, description.name, links, joints, visuals)


def write_part(link: RobotLink, joint: RobotJoint, mesh_path: MeshPath) -> str:
    """Write a link and the joint that bears it as text, without a root element."""
    return _fill(mesh_path, None, [link], [joint], True)


def _fill(
    mesh_path: MeshPath,
    robot: str | None,
    links: list[RobotLink],
    joints: list[RobotJoint],
    visuals: bool,
) -> str:
    """Fill in the template; without the name of a robot it is a link and the joint that bears it."""
    from core.support.templates import fill_text  # imports Jinja

    def write_solid(part: RobotShape) -> str:
        """Write the element of a shape."""
        if isinstance(part.shape, Path):
            scale = None if part.scale == ONE else part.scale
            return f"<mesh{_set(filename=mesh_path(part.shape), scale=scale)}/>"

        # They and their lengths are named as in URDF; others are files by now.
        assert isinstance(part.shape, Primitive)
        return f"<{part.shape.kind}{_set(**part.shape.sizes)}/>"

    return fill_text(
        _URDF,
        robot=robot,
        links=links,
        joints=joints,
        visuals=visuals,
        set=_set,
        write_solid=write_solid,
        no_limits=NO_LIMITS,
    )


def _set(**values: Any) -> str:
    """Write attributes of texts, numbers and tuples of numbers; what is None is left out."""
    given = {name: value for name, value in values.items() if value is not None}
    return "".join(f' {name}="{_write(value)}"' for name, value in given.items())


def _write(value: str | float | tuple[float, ...]) -> str:
    """Write a text, or numbers so that they are read to the last bit."""
    if isinstance(value, str):
        return html.escape(value, quote=False).replace('"', "&quot;")
    if isinstance(value, tuple):
        return " ".join(map(_write, value))

    text = f"{value:.15g}"
    return text if float(text) == value else repr(float(value))
