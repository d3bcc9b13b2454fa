"""A designer whose model gives answers that are written here."""

import json

from core.config.schemas import Sampling
from core.design import Component, Tool
from core.designs.composer import PromptComposer
from core.designs.prompt_values import RunFacts
from core.geometry import Box, Pose
from core.hooks import hookimpl
from core.interfaces import VLM, Budget, Reply
from core.plugins import event_hub, installed
from core.search.assignment import Assignment
from core.search.designer import ModelDesigner
from plugins.actions.waypoints import WaypointActions
from plugins.vlms.artist import EngineArtist
from plugins.vlms.second_look import SecondLook
from tasks.bring_cube import BringCube
from tests.support.faults import Faulty
from tests.support.panda import on_panda

ROD = Tool(
    (
        Component(
            "rod",
            "tool_mount",
            Pose.xyz_rpy((0.0, 0.0, -0.1)),
            Box((0.02, 0.02, 0.2)),
        ),
    ),
    name="rod",
)


PLAN = [[0.5, 0.0, 0.4, 0.0, 0.0, 0.0]]


URDF = installed().create("tool", "urdf")


class Canned(VLM):
    """Answers every request with what ``answer`` makes of it; keeps the requests."""

    model = "a can"

    def __init__(self, answer):
        self.answer = answer
        self.requests = []

    def complete(self, requests):
        self.requests += requests
        for request in reversed(requests):
            reply = self.answer(request)
            if reply is not None:
                yield reply


def document(n_tool=1, n_action=1, **more):
    strategy = {**URDF.dump(ROD), "action_sets": [PLAN] * n_action, **more}
    return json.dumps({"strategies": [strategy] * n_tool})


def good(request):
    return Reply(request.id, document(), "a can")


def designer(
    vlm,
    budget=None,
    kinds=("rigid",),
    seed=3,
    events=None,
    temperature=1.0,
    prompt=None,
    show=None,
):
    asked = budget or Budget(3, 1, 1, 0, 5, 0.6)
    assignment = Assignment(
        on_panda(BringCube()), URDF, WaypointActions(), asked, seed, kinds
    )
    composer, hub = PromptComposer(prompt and RunFacts(prompt)), events or event_hub()
    made = ModelDesigner(assignment, vlm, composer, Sampling(temperature), hub)
    if composer.facts.settings.repair:
        made.mender = SecondLook(composer)
    if show is not None:
        made.artist = EngineArtist(assignment, composer, Faulty)
        made.artist.draw_strip = show
    return made


class Listener:
    """Notes the events that it receives, in order."""

    def __init__(self):
        self.received = []
        self.hub = event_hub()
        self.hub.register(self)

    @hookimpl
    def request_composed(self, request):
        self.received.append(("asked", request.id))

    @hookimpl
    def reply_received(self, request, reply):
        self.received.append(("answered", request.id))
