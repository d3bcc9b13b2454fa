"""Say where modules and names went that a plugin may know; CHANGELOG.md has the same table.

Covered by `tests/core/plugins/test_moved.py`.
"""

from __future__ import annotations

import re

MOVED = {
    "core.cli": "core.support.cli",
    "core.conformance": "plugins.conformance, the command vlmgineer conformance",
    "core.design.Part": "core.design.ConvexPart",
    "core.design.SAME_AS": "core.design.Evaluation",
    "core.design.SAVED": "core.design.Evaluation",
    "core.design.STOPPED": "core.design.Evaluation",
    "core.designs.components": "plugins.tools.components",
    "core.designs.loose": "core.designs.tool_joints",
    "core.designs.mounting": "plugins.tools.mounting",
    "core.designs.varying": "plugins.tools.varying",
    "core.experiment": "core.search.experiment; from core import Experiment",
    "core.export": "plugins.results.workshop, the command vlmgineer export",
    "core.facts": "plugins.conformance.facts, the command vlmgineer facts",
    "core.files": "core.support.files",
    "core.gallery": "plugins.results.gallery, the command vlmgineer gallery",
    "core.gym": "plugins.gym",
    "core.imports": "plugins.tasks.file.imports",
    "core.interfaces.observation": "core.design.Evaluation",
    "core.jobs": "core.values.jobs",
    "core.joints": "core.values.joints",
    "core.layouts": "core.values.layouts",
    "core.materials": "core.values.materials",
    "core.messages": "core.values.messages",
    "core.new": "plugins.new, the command vlmgineer new",
    "core.numbers": "core.values.numbers",
    "core.observations": "core.values.observations",
    "core.plans": "core.values.plans",
    "core.plugins.ATTRIBUTES": "core.plugins.Kind",
    "core.plugins.INTERFACES": "core.plugins.Kind",
    "core.plugins.NOT_SETTINGS": "core.plugins.Kind",
    "core.plugins.PROVIDED": "core.plugins.Kind",
    "core.plugins.Part": "core.plugins.PluginPart",
    "core.plugins.WORDS": "core.plugins.Kind",
    "core.render": "plugins.render, the command vlmgineer render",
    "core.replies": "core.search.replies",
    "core.report": "plugins.results.report, the command vlmgineer report",
    "core.report.page": "plugins.results.pages.page",
    "core.robot.description.read_inertia": "core.values.descriptions, as data: Robot.description",
    "core.robot.description.read_numbers": "core.values.descriptions, as data: Robot.description",
    "core.robot.description.read_origin": "core.values.descriptions, as data: Robot.description",
    "core.robot.description.read_shape": "core.values.descriptions, as data: Robot.description",
    "core.robot.description.root_link": "core.values.descriptions, as data: Robot.description",
    "core.robot.description.to_text": "core.robot.description.write",
    "core.robot.description.tool_elements": "core.robot.description.assembled",
    "core.robot.meshes.hull_file": "plugins.robots.hulls.hull_file",
    "core.robot.meshes.visual_file": "plugins.robots.hulls.visual_file",
    "core.robot.normalise": "plugins.robots.normalise",
    "core.robot.outline": "core.robot.extents",
    "core.robot.plain": "plugins.robots.normalise",
    "core.robot.plain.rigid_parts": "core.values.descriptions.Description.rigid_parts",
    "core.robot.reach": "core.designs.reach",
    "core.robot.reading": "plugins.robots.reading",
    "core.robot.self_collision": "core.solids.self_collision",
    "core.robot.solids.Solids": "core.robot.solids.Obstacles",
    "core.robot.urdf": "core.values.urdf",
    "core.robot.urdf.Joint": "core.values.descriptions.RobotJoint",
    "core.robot.urdf.Link": "core.values.descriptions.RobotLink",
    "core.robot.urdf.Shape": "core.values.descriptions.RobotShape",
    "core.robot.visuals": "core.robot.meshes",
    "core.robots": "core.values.robots",
    "core.scene.describe_goals": "core.task.Task.reward_in_words",
    "core.scratch": "core.support.scratch",
    "core.search.teams": "core.search.agent_groups",
    "core.search.unseen": "core.search.holdout",
    "core.secrets": "core.support.secrets",
    "core.shapes": "core.values.shapes",
    "core.simulation.contacts": "core.solids.contacts",
    "core.simulation.entry": "core.solids.entry_side",
    "core.simulation.gaps": "core.solids.gap_bounds",
    "core.simulation.penetration": "core.solids.penetration",
    "core.simulation.racing": "plugins.fitness.racing",
    "core.simulation.rendering": "plugins.simulators.rendering",
    "core.simulation.sampling": "core.solids.record_rate",
    "core.simulation.solids": "core.solids.bodies",
    "core.simulation.staging": "plugins.fitness.racing",
    "core.simulation.tracks": "core.solids.tracks",
    "core.spending": "core.values.spending",
    "core.states": "core.values.states",
    "core.text": "core.support.text",
    "core.threads": "core.support.threads",
    "core.traces": "core.values.traces",
    "core.transfer": "plugins.transfer, the command vlmgineer transfer",
    "core.view": "the command vlmgineer view",
}
"""Where each module, or attribute of one, is now. What lies in a package moved with it, unless it is named itself."""

SEE = "see What moved in CHANGELOG.md"
_LACKS = re.compile(r"cannot import name '(?P<name>\w+)' from '(?P<module>[\w.]+)'|"
                    r"module '(?P<module2>[\w.]+)' has no attribute '(?P<name2>\w+)'")  # fmt: skip


def new_place(name: str) -> str | None:
    """Say in a line where a module or attribute, or the package around it, is now; None: it did not move."""
    steps = name.split(".")
    for count in range(len(steps), 1, -1):
        old = ".".join(steps[:count])
        if old in MOVED:
            return f"{old} moved to {MOVED[old]}; {SEE}"
    return None


def describe_import_error(error: BaseException) -> str:
    """Describe what importing a plugin raised; where it lacks a name that moved, say where that is now."""
    text = f"{type(error).__name__}: {error}"
    lacks = _LACKS.search(str(error))
    if lacks is None:
        return text
    module, name = lacks["module"] or lacks["module2"], lacks["name"] or lacks["name2"]
    moved = MOVED.get(f"{module}.{name}")
    return text if moved is None else f"{text}; {module}.{name} moved to {moved}; {SEE}"
