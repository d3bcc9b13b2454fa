"""Runs with models behind servers of their own."""

import json
from pathlib import Path

from tests.plugins.vlms.servers import Send


def refused(message, status=400):
    return Send(json.dumps({"error": {"message": message}}), status)


ROOT = Path(__file__).parents[2]


SOLUTION = json.loads((ROOT / "tests/tasks/solutions/BringCube.json").read_text())[
    "strategies"
][0]


COMMON = ["sim=mujoco", "film=false", "listener={}"]
