"""Send requests through LiteLLM to the servers of `tests.plugins.vlms.servers`."""

import re

import pytest

from core.errors import LimitReached
from plugins.vlms.litellm.language_model import LanguageModel
from tests.plugins.vlms.servers import request

KEYS = {
    "openai": "sk-planted/0123456789",
    "google": "AIza-planted+0123456789",
    "anthropic": "sk-ant-planted=0123456789",
}
VARIABLES = {
    "openai": "OPENAI_API_KEY",
    "google": "GEMINI_API_KEY",
    "anthropic": "ANTHROPIC_API_KEY",
}
PAID = list(KEYS)
PROTOCOLS = {
    "openai": ("openai/gpt-4.1", "/v1"),
    "google": ("gemini/gemini-2.5-pro", ""),
    "anthropic": ("anthropic/claude-sonnet-4-6", ""),
    "ollama": ("ollama_chat/m", ""),
}


def model_at(server, protocol, **settings):
    """A model behind a server."""
    model, path = PROTOCOLS[protocol]
    return LanguageModel(model, server.url + path, **settings)


def agent_of(call):
    """The number of the agent that made the call."""
    return int(re.search(r"I am agent (\d+)\.", "".join(call.texts)).group(1))


def ask(server, protocol, agents=1, **settings):
    """The replies by agent."""
    replies = list(
        model_at(server, protocol, **settings).complete(
            [request(agent) for agent in range(agents)]
        )
    )
    assert len(replies) == agents
    return {int(reply.request_id.removeprefix("g0-a")): reply for reply in replies}


def in_turn(*acts):
    """A script that plays the acts in order for each agent, and then repeats the last one."""
    tries = {}

    def script(call):
        agent = agent_of(call)
        tries[agent] = tries.get(agent, 0) + 1
        return acts[min(tries[agent], len(acts)) - 1]

    return script


def until_limit(vlm, requests):
    """The replies, and the message at the end."""
    replies = []
    with pytest.raises(LimitReached) as error:
        replies.extend(vlm.complete(requests))  # extend keeps those before the error
    return replies, str(error.value)
