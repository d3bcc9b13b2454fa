"""A session over HTTP: one client, with the token."""

import asyncio
import signal

import httpx2
import pytest
from mcp import Client
from mcp.client.streamable_http import streamable_http_client

from tests.plugins.agents.clients import SMALL, ask, start

pytestmark = pytest.mark.slow

HELLO = {
    "jsonrpc": "2.0",
    "id": 1,
    "method": "initialize",
    "params": {
        "protocolVersion": "2025-06-18",
        "capabilities": {},
        "clientInfo": {"name": "second", "version": "1"},
    },
}
ACCEPT = {"Accept": "application/json, text/event-stream"}


def test_one_client_with_the_token_is_let_in(tmp_path):
    server = start(tmp_path, *SMALL, "folder=run", "port=0")
    lines = [server.stderr.readline().decode() for _ in range(2)]
    address = lines[0].strip()
    token = lines[1].split()[-1]

    def web(given):
        patient = httpx2.Timeout(30, read=300)
        headers = {"Authorization": f"Bearer {given}"}
        return httpx2.AsyncClient(headers=headers, timeout=patient)

    async def visit():
        async with httpx2.AsyncClient() as stranger:
            assert (await stranger.post(address, json={})).status_code == 401
        async with web("wrong") as stranger:
            assert (await stranger.post(address, json={})).status_code == 401

        async with web(token) as first, web(token) as second:
            async with Client(streamable_http_client(address, http_client=first)) as a:
                assert not (await ask(a, "best_designs")).is_error
                with pytest.raises(BaseExceptionGroup):
                    async with Client(
                        streamable_http_client(address, http_client=second)
                    ):
                        pass
                refused = await second.post(address, json=HELLO, headers=ACCEPT)
                assert refused.status_code == 503
                words = refused.json()["error"]["message"]
                assert "mcp 0.1.0 has held the one session" in words
                assert "silent for 120 s" in words
                assert not (await ask(a, "best_designs")).is_error
            # The place is free again.
            async with Client(streamable_http_client(address, http_client=second)) as b:
                assert not (await ask(b, "best_designs")).is_error

    try:
        asyncio.run(visit())
    finally:
        server.send_signal(signal.SIGINT)
        _, err = server.communicate(timeout=300)
    assert b"to go on: vlmgineer mcp resume=" in err
