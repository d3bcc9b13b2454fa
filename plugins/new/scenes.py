"""Write a scene file to start from."""

from __future__ import annotations

from pathlib import Path

from core.errors import UserError
from plugins.new.packages import check_name, render


def write_scene(name: str, output: Path | None = None) -> Path:
    """Write the scene ``name`` into the file ``output`` (default: one of its name, here), and return that.

    Raises:
        UserError: a name that can't be used, or a file that is there already or can't be written.
    """
    snake = check_name("task", name)
    file = output or Path(f"{snake}.yaml")
    try:
        with file.open("x", encoding="utf-8") as stream:
            stream.write(render("scene.yaml", {"name": name}))
    except FileExistsError as error:
        raise UserError(f"{file} is there already; choose another name, or another file with output=FILE") from error
    except OSError as error:
        raise UserError(f"can't write {file}: {error.strerror}") from error
    return file
