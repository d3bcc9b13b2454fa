"""An agent drives a run by calls: it looks, checks, tries and watches, and ``evolution=agent`` is the search.

The run is the ordinary one. Its strategy waits for the agent's designs (`plugins.agents.strategy`), and the model that
it asks answers with them (`plugins.agents.agent`). The calls come by the Model Context Protocol
(`plugins.agents.server`), and all work is done in the run's own thread (`plugins.agents.bench`).
"""

from __future__ import annotations

from collections.abc import Mapping

from core.hooks import Command, hookimpl


@hookimpl
def vlms() -> Mapping[str, str]:
    return {"agent": "plugins.agents.agent:Agent"}


@hookimpl
def evolution_strategies() -> Mapping[str, str]:
    return {"agent": "plugins.agents.strategy:AgentSearch"}


@hookimpl
def commands() -> dict[str, Command]:
    return {
        "mcp": Command(
            "let an agent drive a run, by the Model Context Protocol",
            "plugins.agents.mcp_command:main",
        )
    }
