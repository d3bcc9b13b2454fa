"""Scene files that tests share, and tasks that are made of them."""

from pathlib import Path

from core.config.compose import load, task_part
from plugins.commands.render import RenderConfig
from plugins.tasks.file.task import FileTask

FOLDER = Path(__file__).parents[1] / "plugins/tasks/file"
SCENES = sorted((FOLDER / "scenes").glob("*.yaml"))
OPEN_DOOR = (FOLDER / "open_door.yaml").read_text()
TIN = """<mujoco model="tin"><worldbody><body><body name="object">
<geom type="cylinder" size="0.03 0.05" density="300"/></body>
<site name="top_site" pos="0 0 0.05" size="0.005"/></body></worldbody></mujoco>"""


def task_of(folder, text, variation="none"):
    (folder / "scene.yaml").write_text(text)
    return FileTask(str(folder / "scene.yaml"), variation)


def true_task(name):
    """The bench as it is, of which photographs were drawn."""
    file = FOLDER / f"bench/truth/{name}.yaml"
    if file.exists():
        return FileTask(str(file))
    return task_part(load("render", [f"task={name}"], RenderConfig)).create()
