import io
import json
import subprocess
import sys
from urllib.parse import quote

import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.support.secrets import Scrubbed, holds_secret, is_secret_name, remember, scrub

KEY = "sk-pl/an+ted+0123=45"
FORMS = [
    KEY,
    repr(KEY),
    json.dumps({"key": KEY}),
    f"Bearer {KEY}",
    quote(KEY, safe=""),
    f"https://me:{KEY}@host",
]
NAMES = [
    "OPENAI_API_KEY",
    "WATSONX_APIKEY",
    "AWS_BEARER_TOKEN_BEDROCK",
    "VERTEXAI_CREDENTIALS",
    "SNOWFLAKE_JWT",
]
NAMES += [
    "AWS_SECRET_ACCESS_KEY",
    "HF_TOKEN",
    "GIGACHAT_CREDENTIALS",
    "DB_PASSWORD",
    "x-api-key",
    "x-goog-api-key",
]
NAMES += [
    "Authorization",
    "api-key",
    "x-amz-security-token",
    "SUPABASE_KEY",
    "WATSONX_ZENAPIKEY",
    "SLACK_WEBHOOK_URL",
]


@pytest.fixture
def planted(monkeypatch):
    monkeypatch.setenv("SOME_API_KEY", f"{KEY}\r\n")


@pytest.mark.usefixtures("planted")
@pytest.mark.parametrize("form", FORMS)
def test_no_form_of_a_key_is_left(form):
    text = scrub(f"before {form} after")
    assert text.startswith("before ")
    assert text.endswith(" after")
    assert "***" in text
    assert "ted" not in text


@given(st.text(max_size=30), st.text(max_size=30))
def test_what_stands_around_a_key_stays(before, after):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOME_API_KEY", "0123456789abcdef")
        found = scrub(f"{before} 0123456789abcdef {after}")
        assert found == f"{before} *** {after}"
        assert scrub(before + after) == before + after


@pytest.mark.parametrize("name", NAMES)
def test_names_of_secrets(name):
    assert is_secret_name(name)


@pytest.mark.parametrize(
    "name",
    [
        "PATH",
        "TOKENIZERS_PARALLELISM",
        "MAX_TOKENS",
        "KEYBOARD",
        "MONKEY",
        "content-type",
    ],
)
def test_other_names(name):
    assert not is_secret_name(name)


@pytest.mark.parametrize("value", ["", "a", "none", "sk-1234", "   \n", "/usr/share"])
def test_short_values_and_paths_are_no_keys(value, monkeypatch):
    monkeypatch.setenv("OPENAI_API_KEY", value)
    text = f"a none sk-1234 /usr/share {value}"
    assert scrub(text) == text


def test_long_words_of_a_value_and_passwords_in_addresses(monkeypatch):
    monkeypatch.setenv(
        "PRIVATE_KEY", "BEGIN KEY\nMIIEvAIBADANBgkqhkiG\n9w0BAQEFAASCBKYwggSi"
    )
    monkeypatch.setenv("HTTPS_PROXY", "http://me:pass-word@proxy.example:3128")
    assert scrub("BEGIN 9w0BAQEFAASCBKYwggSi and pass-word") == "BEGIN *** and ***"


def test_a_variable_that_is_not_utf8_is_scrubbed_too(monkeypatch):
    monkeypatch.setenv(
        "SOME_TOKEN", b"0123\xff456789".decode("utf-8", "surrogateescape")
    )
    assert scrub("a 0123\udcff456789 b") == "a *** b"
    assert scrub("nothing") == "nothing"


def test_what_was_sent_is_a_secret():
    remember("Bearer ya29.a0-0123456789")
    assert scrub("Bearer ya29.a0-0123456789, 1") == "***, 1"
    assert holds_secret("x ya29.a0-0123456789")
    assert holds_secret("http://me:word@host/")
    assert not holds_secret("http://host:80/")
    assert holds_secret("https://token@host/")
    assert holds_secret("https://host/v1?sv=2024&sig=abc")
    assert not holds_secret("https://host/v1?sv=2024&design=abc#me@home")


@pytest.mark.parametrize(
    "address",
    [
        "http://host/v1#api_key=abc",
        "http://host/v1#a=1&access_token=abc",
        "http://host/v1;password=abc",
        "http://host/v1?a=1;sig=abc",
        "me:word@host.example/v1",
        "me:word@host:8000",
        "me:word@localhost",
        "//me:word@host/v1",
        "vlm.api_base=me:word@host/v1",
        "http://me:wo/rd@host/v1",
        "http://me:wo\\rd@host/v1",
        "http://me:wo#rd@host/v1",
        "http:\\\\me:word@host/v1",
        "http://:word/more@host/v1",
    ],
)
def test_keys_in_any_place_of_an_address_are_found(address):
    assert holds_secret(address)


@pytest.mark.parametrize(
    "text",
    [
        "http://host:8000/v1/models@latest",
        "http://host.example:8000/a@b.example",
        "[http://a:80/x,http://b:80/y@z]",
        "http://[::1]:8000/v1/@x",
        "http://host/v1#part-2",
        "http://host/v1;v=1#top",
        "docker run image:tag@sha256:0123456789abcdef",
        "git@github.com:owner/name.git",
        "mailto:me@host.example",
        "at 10:30 @ the bench, see a@b.example",
        "{task: BringCube}",
    ],
)
def test_addresses_without_keys_are_none(text):
    assert not holds_secret(text)


def test_tokens_and_signatures_in_addresses_of_the_environment(monkeypatch):
    address = "https://planted-token@host/v1?sv=2024-11-04&sig=planted%2Bsignature"
    monkeypatch.setenv("OPENAI_BASE_URL", address)
    assert scrub(address) == "https://***@host/v1?sv=2024-11-04&sig=***"


@pytest.mark.usefixtures("planted")
def test_a_stream_is_scrubbed():
    stream = io.StringIO()
    scrubbed_stream = Scrubbed(stream)
    scrubbed_stream.writelines([f"a {KEY}\n", "b\n"])
    assert stream.getvalue() == "a ***\nb\n"
    assert not scrubbed_stream.isatty()


def test_a_commands_traceback_is_scrubbed():
    code = (
        "from core.support.cli import command\n"
        "def fail(words): print('out 0123456789abcdef'); raise ValueError('in 0123456789abcdef')\n"
        "command(fail)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={"SOME_TOKEN": "0123456789abcdef"},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.stdout == "out ***\n"
    assert "ValueError: in ***" in done.stderr
    assert "0123456789abcdef" not in done.stderr
