"""Whose key goes where: OpenAI's to no other provider, over all providers that LiteLLM knows."""

import os
import re
import socket
import time

import httpx
import pytest

from core.errors import UsageError, UserError
from plugins.vlms.litellm.language_model import LanguageModel
from plugins.vlms.litellm.loading import load
from plugins.vlms.litellm.transport import OPENAI
from tests.plugins.vlms.asking import KEYS, ask
from tests.plugins.vlms.servers import Say, request, serving

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("planted")]
OWNERS = {
    "anthropic": ["anthropic"],
    "anthropic_text": ["anthropic"],
    "gemini": ["google"],
}
OWN = "planted-own-0123456789"


@pytest.fixture
def sent(monkeypatch):
    """The requests that would leave this machine, none of which does."""
    requests = []

    def send(self, request):
        requests.append(request)
        raise httpx.ConnectError("no network")

    def nowhere(*_, **__):
        raise OSError("no network")

    monkeypatch.setattr(httpx.HTTPTransport, "handle_request", send)
    monkeypatch.setattr(socket, "getaddrinfo", nowhere)
    # Other threads, which look at something again and again, must not spin.
    sleep = time.sleep
    monkeypatch.setattr("time.sleep", lambda seconds: sleep(min(seconds, 0.001)))
    for name in (
        "OPENAI_ORGANIZATION",
        "OPENAI_ORG_ID",
        "OPENAI_PROJECT_ID",
        "OPENAI_PROJECT",
    ):
        monkeypatch.setenv(name, f"planted-{name}")
    return requests


def providers():
    registry = load().llms.openai_like.json_loader.JSONProviderRegistry
    return sorted(
        {str(getattr(p, "value", p)) for p in load().provider_list}
        | {*registry.list_providers()}
    )


def tried(provider, api_base, sent):
    """All that one call would send, as text; and why there was no call."""
    sent.clear()
    try:
        list(
            LanguageModel(f"{provider}/m", api_base, timeout_s=20).complete(
                [request(0)]
            )
        )
        refused = ""
    except UserError as error:
        refused = str(error)
    return "\n".join(f"{one.url} {one.headers.raw}" for one in sent), refused


@pytest.mark.thorough
@pytest.mark.parametrize("api_base", [None, "http://127.0.0.1:9/v1"])
def test_what_is_openais_goes_to_no_other_provider(api_base, sent, monkeypatch):
    leaks = []
    refusals = {}
    assert len(providers()) > 100
    for provider in providers():
        text, refused = tried(provider, api_base, sent)
        if provider in OPENAI:
            assert KEYS["openai"] in text, provider
            assert ("planted-OPENAI" in text) == (api_base is None)
        else:
            assert "api.openai.com" not in text, provider
            others = [
                key
                for owner, key in KEYS.items()
                if key in text and owner not in OWNERS.get(provider, ())
            ]
            leaks += [
                (provider, found)
                for found in (*others, *re.findall("planted-OPENAI", text))
            ]
        if name := re.search(r"set the environment variable (\w+)$", refused):
            refusals[provider] = name[1]
    assert leaks == []
    assert api_base is not None or {"zai", "poe", "meta", "lambda_ai", "meta_llama"} < {
        *refusals
    }
    wrong = []
    for provider, name in refusals.items():
        monkeypatch.setenv(name, OWN)
        text, refused = tried(provider, None, sent)
        wrong += [(provider, name)] if refused or (text and OWN not in text) else []
        monkeypatch.delenv(name)
    # For something else, without a key.
    asking_first = {"huggingface", "replicate", "text-completion-codestral"}
    assert {provider for provider, _ in wrong} <= asking_first


@pytest.mark.thorough
def test_requests_go_to_the_server_that_was_named_or_nowhere(sent, monkeypatch):
    """Of all providers: some know no other address than their maker's, some look a model up beside the call."""
    for name in ("OLLAMA", "LEMONADE", "REPLICATE", "BYTEZ", "HUGGINGFACE", "COHERE"):
        monkeypatch.setenv(f"{name}_API_KEY", OWN)
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", OWN)
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", OWN)
    monkeypatch.setenv("AWS_REGION_NAME", "us-east-1")
    elsewhere = []
    for provider in providers():
        tried(provider, "http://127.0.0.1:9/v1", sent)
        elsewhere += [
            (provider, str(one.url))
            for one in sent
            if (one.url.host, one.url.port) != ("127.0.0.1", 9)
        ]
    assert elsewhere == []


@pytest.mark.parametrize("model", ["replicate/m", "sagemaker_chat/m"])
def test_what_would_go_elsewhere_is_not_sent_and_a_line_says_so(model, monkeypatch):
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", OWN)
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", OWN)
    monkeypatch.setenv("AWS_REGION_NAME", "us-east-1")
    monkeypatch.setenv("REPLICATE_API_KEY", OWN)
    with serving(lambda call: Say()) as server:
        vlm = LanguageModel(model, server.url)
        (reply,) = vlm.complete([request(0)])
    assert server.calls == []
    provider = model.partition("/")[0]
    assert f"would send requests of {provider} to " in reply.error
    assert "not to 127.0.0.1: they are not sent; for a server of" in reply.error
    assert reply.unanswered


@pytest.mark.parametrize("address", ["here", "http:/h", "ftp://h", "http://[", "\x00"])
def test_what_is_no_address_is_refused(address):
    with pytest.raises(UsageError, match="is no address; write it as http://HOST"):
        LanguageModel("openai/m", address)


def test_a_server_of_ones_own_gets_the_key_that_is_named_for_it(monkeypatch):
    monkeypatch.setenv("OPENAI_ORGANIZATION", "planted-organization")
    with serving(lambda call: Say()) as server:
        ask(server, "openai")
        (vlm,) = [LanguageModel("hosted_vllm/m", server.url + "/v1")]
        list(vlm.complete([request(0)]))
    first, second = (str(call.headers) for call in server.calls)
    assert KEYS["openai"] in first
    assert "planted" not in first.replace(KEYS["openai"], "") + second
    assert os.environ["OPENAI_ORGANIZATION"]
