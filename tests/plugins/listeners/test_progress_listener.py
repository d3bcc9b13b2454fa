"""What is printed as generations end."""

from core.design import Candidate
from core.events import Generation
from core.interfaces import Reply
from core.plugins import event_hub, installed
from core.support import progress_display
from plugins.conformance.evaluations import tried_once
from tests.core.run_folders import hook


def test_a_generation_says_how_many_were_rejected(capsys):
    events = event_hub()
    events.register(installed().create("listener", "progress", {}))
    tried, heavy = (Candidate(hook(0.1), None, 1, 0, number) for number in range(2))
    good = tried_once(tried, "ok", reward=0.5, distance_m=1.0)
    generation = Generation(1, (good, tried_once(heavy, "rejected", reason="heavy")))
    events.hook.generation_finished(generation=generation)
    said = "best 0.500  mean 0.500  (2 candidates, 1 rejected)"
    assert said in capsys.readouterr().err


def test_within_a_generation_it_says_what_is_waited_for():
    events = event_hub()
    listener = installed().create("listener", "progress", {})
    events.register(listener)
    events.hook.generation_started(index=0)
    (step,) = progress_display._steps
    for _ in range(2):
        events.hook.request_composed(request=None)
    reply = Reply("g0-a1", "{}", "a model", cost_usd=0.25)
    events.hook.reply_received(request=None, reply=reply)
    assert step.what.endswith("  calls under way: 1  0.25 USD")
    tried = tried_once(Candidate(hook(0.1), None, 0, 0, 0), "ok", reward=0.5)
    events.hook.candidate_evaluated(evaluation=tried)
    assert "generation 0  1/0  best 0.500  calls" in step.what
    events.hook.run_ended()
