import typing

import pytest

from core.errors import UserError
from core.hooks import hookimpl
from core.interfaces import VLM, Task
from core.plugins import KINDS, installed
from tests.core.plugins.offering import Engine, Offering

BUILT_IN = sorted(
    key for key in installed().offers if getattr(KINDS.get(key[0]), "interface", None)
)


@pytest.mark.parametrize(
    ("kind", "name"), [key for key in BUILT_IN if key[0] != "command"]
)
def test_each_part_is_what_its_kind_says(kind, name):
    factory, interface = installed().factory(kind, name), KINDS[kind].interface
    if isinstance(factory, type):
        assert issubclass(factory, interface)
    else:
        assert typing.get_type_hints(factory)["return"] is interface


def test_a_part_of_another_kind_is_refused(found):
    found.register(Offering(executors={"grid": Engine}), "mine", "my-package")
    message = r"executor 'grid' of my-package \(hook 'executors'\) makes a Engine, which is no core.interfaces.Executor"
    with pytest.raises(UserError, match=message):
        found.create("executor", "grid", {"grid": 1})


@pytest.mark.parametrize(("kind", "hook", "interface", "lacks"), [
    ("task", "tasks", Task, "name and no description and no goals"),
    ("vlm", "vlms", VLM, "model"),
])  # fmt: skip
def test_a_part_that_lacks_an_attribute(found, kind, hook, interface, lacks):
    methods = dict.fromkeys(interface.__abstractmethods__, lambda *_: None)
    bare = type("Bare", (interface,), methods)
    found.register(Offering(**{hook: {"bare": bare}}), "mine", "my-package")
    with pytest.raises(
        UserError,
        match=rf"{kind} 'bare' of my-package \(hook '{hook}'\): Bare has no {lacks}",
    ):
        found.create(kind, "bare", robot=installed().default_robot)


def test_a_listener_receives_some_event(found):
    class Deaf:
        pass

    class Wrong:
        @hookimpl
        def run_started(self, number):
            pass

    found.register(
        Offering(listeners={"deaf": Deaf, "wrong": Wrong}), "mine", "my-package"
    )
    with pytest.raises(
        UserError,
        match=r"listener 'deaf' of my-package .* receives no event: .*Deaf implements n",
    ):
        found.create("listener", "deaf")
    with pytest.raises(
        UserError, match=r"listener 'wrong' of my-package .*number"
    ) as error:
        found.create("listener", "wrong")
    assert "\n" not in str(error.value)
