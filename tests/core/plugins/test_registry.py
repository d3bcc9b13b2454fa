import pytest

from core.errors import UsageError, UserError
from core.interfaces import Simulator
from core.plugins import describe_part, installed
from tests.core.plugins.offering import Engine, Offering


def test_a_registered_part_can_be_made(found):
    found.register(Offering(simulators={"grid": Engine}), "mine", "my-package")
    assert found.names("sim") == ["grid"]
    assert not found.failures
    engine = found.create("sim", "grid", {"grid": 3, "time_step": 1, "walls": ["a"]})
    assert (engine.grid, engine.time_step, engine.walls) == (3, 1.0, ["a"])
    assert isinstance(engine.time_step, float)
    assert found.create("sim", "grid", grid=7).grid == 7  # given by the program


def test_a_factory_may_be_named(found):
    found.register(
        Offering(simulators={"grid": f"{__name__}:Engine"}), "mine", "my-package"
    )
    assert found.create("sim", "grid", {"grid": 3}).grid == 3


def test_a_factory_may_be_a_function(found):
    def make(size=2):
        return Engine(size)

    found.register(Offering(simulators={"grid": make}), "mine", "my-package")
    assert found.create("sim", "grid", {"size": 5}).grid == 5
    with pytest.raises(
        UsageError, match=r"no setting 'grid' in sim=grid; possible: size"
    ):
        found.create("sim", "grid", {"grid": 5})


@pytest.mark.parametrize("factory", [5, None, {"a": 1}])
def test_what_cannot_be_called_is_no_factory(found, factory):
    """It is refused when it is offered, or at the latest when it is used, with one line."""
    found.register(Offering(simulators={"grid": factory}), "mine", "my-package")
    with pytest.raises(UserError, match="grid"):
        found.create("sim", "grid")


@pytest.mark.parametrize(
    ("factory", "reason"),
    [
        ("no_such_module:Engine", "No module named 'no_such_module'"),
        (f"{__name__}:Motor", "Motor"),
        ("", ""),
    ],
)
def test_a_named_factory_that_cannot_be_imported(found, factory, reason):
    found.register(Offering(simulators={"grid": factory}), "mine", "my-package")
    with pytest.raises(
        UserError, match=r"sim 'grid' of my-package can't be imported: "
    ) as error:
        found.create("sim", "grid")
    assert reason in str(error.value)


def test_a_part_that_lacks_a_method_is_refused_with_its_plugin(found):
    class Half(Simulator):
        def rollout(self, task, jobs):
            return []

    found.register(Offering(simulators={"grid": Half}), "mine", "my-package")
    message = (
        r"sim 'grid' of my-package \(hook 'simulators'\) can't be made: .*Half .*render"
    )
    with pytest.raises(UserError, match=message):
        found.create("sim", "grid")


def test_a_part_that_cannot_be_made_is_one_line(found):
    def make():
        raise RuntimeError("no licence")

    found.register(Offering(simulators={"grid": make}), "mine", "my-package")
    with pytest.raises(
        UserError,
        match=r"sim 'grid' of my-package .* can't be made: RuntimeError: no licence",
    ):
        found.create("sim", "grid")


def test_the_description_of_a_part(found):
    found.register(Offering(simulators={"grid": Engine}), "mine", "my-package")
    assert (
        describe_part(found.create("sim", "grid", {"grid": 1}))
        == "sim 'grid' of my-package (hook 'simulators')"
    )
    assert describe_part(Engine(1)) == "tests.core.plugins.offering.Engine"


def test_a_name_that_no_plugin_offers():
    with pytest.raises(
        UserError,
        match=r"no task 'OneBok' \(did you mean 'OneBook'\?\); possible: AroundCorner, .*OneBook",
    ):
        installed().create("task", "OneBok")
    with pytest.raises(UserError, match=r"no sim 'unreal'; possible: .*pybullet"):
        installed().factory("sim", "unreal")
