import pytest

from core.errors import UsageError
from core.plugins import Plugins, installed
from core.plugins import __main__ as command
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
        assert any(line.split()[:2] == [kind, name] for line in out.splitlines()), (
            kind,
            name,
        )
    assert (
        "failed mine (my-package): hook 'simulators' failed: RuntimeError: oh no" in out
    )


def test_other_words_are_refused():
    with pytest.raises(UsageError, match=r"can't read '--check'; usage"):
        command.main(["--check", "none"])
