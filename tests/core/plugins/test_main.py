import os
import subprocess
import sys

import pytest

from core.errors import UsageError
from core.plugins import Plugins, installed
from core.plugins import __main__ as command
from core.plugins.own_commands import COMMANDS
from tests.core.plugins.offering import Offering

BUILT_IN = sorted(installed().offers)


def test_python_m_core_plugins_lists_every_part(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    found = Plugins()
    found.register(Offering(simulators=RuntimeError("oh no")), "mine", "my-package")
    monkeypatch.setattr(command, "installed", lambda: found)
    command.main([])
    out = capsys.readouterr().out
    for kind, name in BUILT_IN:
        assert any(line.split()[:2] == [kind, name] for line in out.splitlines()), (kind, name)
    assert "failed mine (my-package): hook 'simulators' failed: RuntimeError: oh no" in out


def test_what_is_switched_off_is_not_imported_and_is_reported(tmp_path):
    code = "import core.plugins.__main__ as c, sys; c.main([]); sys.exit('tasks' in sys.modules)"
    words = [sys.executable, "-c", code]
    env = os.environ | {"VLMGINEER_PLUGINS": "fitness"}
    done = subprocess.run(words, cwd=tmp_path, env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    listed = [line.split()[:2] for line in done.stdout.splitlines()[1:-1]]
    own = [*(["fitness", name] for name in ("layouts", "lean", "nominal", "robust"))]
    assert sorted(listed) == sorted([*own, *(["command", name] for name in COMMANDS)])
    assert done.stdout.splitlines()[-1] == "VLMGINEER_PLUGINS=fitness: other plugins are not loaded"


def test_other_words_are_refused():
    with pytest.raises(UsageError, match=r"can't read '--check none'; usage"):
        command.main(["--check", "none"])
