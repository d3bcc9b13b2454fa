"""Small parts, written as in any third-party package."""

from core.hooks import hookimpl


@hookimpl
def vlms():
    return {"echo": "toybench.vlm:Echo"}


@hookimpl
def tool_representations():
    return {"numbers": "toybench.numbers:Numbers"}


@hookimpl
def fitness_functions():
    return {"thrifty": "toybench.thrifty:Thrifty"}


@hookimpl
def executors():
    return {"here": "toybench.here:Here"}


@hookimpl
def listeners():
    return {"csv": "toybench.rows:Rows"}


@hookimpl
def config_path():
    return "pkg://toybench.conf"
