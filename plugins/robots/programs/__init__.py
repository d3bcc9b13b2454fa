"""Templates of programs for arms' controllers."""

from importlib.resources import files


def program(name: str) -> tuple[str, str]:
    """Return a program's file name and its template."""
    return name, files(__name__).joinpath(f"{name}.j2").read_text(encoding="utf-8")
