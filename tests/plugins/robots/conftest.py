"""What tests of one's own arm share."""

import pytest

from core.config.compose import load
from core.support.cli import expand, say
from plugins.commands.import_file import ImportConfig
from plugins.robots import hulls, mjcf
from plugins.robots.import_arm import take_arm
from tests.plugins.tasks.file.imports.conftest import called
from tests.support.outside_arm import write_arm


@pytest.fixture
def in_this_process(monkeypatch):
    """Read meshes and MJCF in this process, which starts no other for each."""
    monkeypatch.setattr(hulls, "isolated", called)
    monkeypatch.setattr(mjcf, "isolated", called)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """Write the URDF of an arm."""
    return write_arm(tmp_path_factory.mktemp("arm"))


def take(words):
    """Say what ``vlmgineer import`` says of an arm, without its picture."""
    cfg = load("import", words, ImportConfig)
    say(*take_arm(expand(cfg.robot.get("path", "")), cfg).lines)
