"""A listener that raises costs itself and not the run; what raises is named by its own kind and name."""

import importlib
import json

import pytest
from omegaconf import OmegaConf

from core.errors import UserError
from core.events import INTERRUPTED
from core.hooks import Events
from core.plugins import installed
from core.search.orchestration import run
from tests.support import toys

pytestmark = pytest.mark.slow

EVENTS = [name for name in vars(Events) if not name.startswith("_")]

MODULE = '''
from core.hooks import hookimpl
from core.interfaces import EvolutionStrategy
from tests.support import toys

received = []


class Jitter:
    """Raises ``error`` when it receives ``event``."""

    def __init__(self, event: str = "", error: str = "ValueError") -> None:
        self.event = event
        self.error = {"ValueError": ValueError, "SystemExit": SystemExit, "KeyboardInterrupt": KeyboardInterrupt}[error]

    def receive(self, event):
        received.append(event)
        if event == self.event:
            raise self.error("two\\nlines")
HOOKS

class Model(toys.ToyModel):
    def __init__(self, notes: str, breaks: str = "") -> None:
        super().__init__(notes)
        self.breaks = breaks

    @hookimpl
    def reply_received(self, reply):
        if self.breaks == "reply_received":
            raise LookupError("no such reply")

    def complete(self, requests):
        if self.breaks == "complete":
            raise LookupError("no answer")
        if self.breaks == "leave":
            raise SystemExit(0)
        return super().complete(requests)


class Strategy(EvolutionStrategy):
    def ask(self):
        yield from self.designer.design(0)
        raise helped()

    def tell(self, evaluations):
        pass


class Leaving(Strategy):
    def tell(self, evaluations):
        raise SystemExit(0)

    def ask(self):
        yield from self.designer.design(0)


def helped():
    raise LookupError("no idea")


@hookimpl
def vlms():
    return {"jitter": Model}


@hookimpl
def evolution_strategies():
    return {"jitter": Strategy, "leaving": Leaving}


@hookimpl
def listeners():
    return {"jitter": Jitter, "calm": Jitter}
'''
HOOK = """
    @hookimpl
    def {event}(self):
        self.receive("{event}")
"""


@pytest.fixture
def jitter(tmp_path, monkeypatch):
    """Install a third-party package with a model, a strategy and listeners in one module."""
    source = MODULE.replace(
        "HOOKS", "".join(HOOK.format(event=event) for event in EVENTS)
    )
    (tmp_path / "jitter_parts.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(installed(), "offers", installed().offers | toys.offered())
    module = importlib.reload(importlib.import_module("jitter_parts"))
    installed().register(module, "jitter", "jitter-parts")
    return module


def come_to(tmp_path, listener=None, vlm=None, evolution=None):
    cfg = toys.config(tmp_path / "notes")
    OmegaConf.update(cfg, "listener", listener or {}, merge=False)
    if vlm is not None:
        OmegaConf.update(
            cfg,
            "vlm",
            {"name": "jitter", "notes": str(tmp_path / "notes"), **vlm},
            merge=False,
        )
    if evolution is not None:
        OmegaConf.update(cfg, "evolution", {"name": evolution}, merge=False)
    return run(cfg, tmp_path / "run")


# The toy task has one layout, so no finalists.
ONCE = [event for event in EVENTS if event != "finalist_tried"]


@pytest.mark.parametrize("event", ONCE)
def test_a_listener_that_raises_is_left_out_and_the_run_goes_on(
    jitter, tmp_path, capfd, event
):
    result = come_to(tmp_path, {"jitter": {"event": event}, "calm": {}}, vlm={})
    assert result.stopped is None
    assert result.n_evaluations == 20
    assert (
        json.loads((tmp_path / "run" / "result.json").read_text())["best"] is not None
    )
    said = "listener 'jitter' of jitter-parts (hook 'listeners'): {} raised ValueError: two lines; it receives no more"
    assert [
        line for line in capfd.readouterr().err.splitlines() if "jitter" in line
    ] == [said.format(event) + " events"]
    # Both listeners' together.
    calm = {name: jitter.received.count(name) for name in ONCE}
    assert calm["run_started"] == calm["run_ended"] == 2
    once = {
        "run_started": 1,
        "generation_started": 2,
        "request_composed": 8,
        "reply_received": 8,
    }
    once |= {
        "candidate_evaluated": 28,
        "generation_finished": 2,
        "run_finished": 1,
        "run_ended": 1,
    }
    assert calm[event] == once[event] + 1
    if event == "run_started":
        assert calm == once | {"run_started": 2, "run_ended": 2}


def test_a_model_that_fails_as_a_listener_still_answers(jitter, tmp_path, capfd):
    result = come_to(tmp_path, vlm={"breaks": "reply_received"})
    assert (result.stopped, result.n_evaluations) == (None, 20)
    (said,) = [line for line in capfd.readouterr().err.splitlines() if "jitter" in line]
    assert said.startswith(
        "vlm 'jitter' of jitter-parts (hook 'vlms'): reply_received raised LookupError: no such reply;"
    )


def test_a_listener_that_exits_costs_no_result(jitter, tmp_path, capfd):
    listener = {"jitter": {"event": "generation_finished", "error": "SystemExit"}}
    assert come_to(tmp_path, listener).stopped is None
    assert "listener 'jitter' of jitter-parts" in capfd.readouterr().err
    assert len(list(tmp_path.rglob("result.json"))) == 1


def test_a_strategy_that_exits_ends_the_run_with_an_error(jitter, tmp_path):
    with pytest.raises(
        UserError,
        match=r"^evolution 'leaving' of jitter-parts raised SystemExit: 0; to go on: ",
    ):
        come_to(tmp_path, evolution="leaving")


def test_an_interrupt_passes_through_a_listener(jitter, tmp_path):
    listener = {
        "jitter": {"event": "candidate_evaluated", "error": "KeyboardInterrupt"}
    }
    assert come_to(tmp_path, listener).stopped == INTERRUPTED


def test_of_several_parts_in_a_module_the_one_that_raised_is_named(jitter, tmp_path):
    with pytest.raises(LookupError) as caught:
        come_to(tmp_path, vlm={}, evolution="jitter")
    named, then = caught.value.__notes__
    assert named == "evolution 'jitter' of jitter-parts raised LookupError: no idea"
    assert then == f"to go on: python -m core.run resume={tmp_path / 'run'}"


@pytest.mark.parametrize(
    ("breaks", "raised"),
    [("complete", "LookupError: no answer"), ("leave", "SystemExit: 0")],
)
def test_a_model_that_raises_before_its_first_reply_leaves_all_unanswered(
    jitter, tmp_path, breaks, raised
):
    with pytest.raises(UserError) as caught:
        come_to(tmp_path, vlm={"breaks": breaks})
    said = str(caught.value)
    assert "the model answered no request of generation 0" in said
    assert (
        f"vlm 'jitter' of jitter-parts (hook 'vlms'): complete raised {raised}" in said
    )
    assert said.endswith(f"to go on: python -m core.run resume={tmp_path / 'run'}")


def test_what_the_store_raises_ends_the_run(jitter, tmp_path, monkeypatch):
    monkeypatch.setattr("core.store.columns.evaluation_row", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError) as caught:
        come_to(tmp_path)
    assert caught.value.__notes__[-1].startswith("to go on: ")
