"""No key gets into a run's files, and nothing in another's run is resolved, followed or called."""

import shutil
from pathlib import Path

import pytest
from omegaconf import OmegaConf

from core.config.compose import load
from core.config.trust import refuse_key_words, refuse_keys
from core.errors import UsageError, UserError
from core.search.run_settings import stored_config
from core.store.database import Database, refuse_links
from core.store.recorder import RunStore
from plugins.results.pages.runs import LeftOutRun, read_run
from tests.support.commands import python_m

pytestmark = pytest.mark.slow

KEY = "sk-planted-0123456789"
ROOT = Path(__file__).parents[3]
WORDS = [
    "+vlm.api_key=anything",
    "vlm.api_key=anything",
    "++vlm.headers={x-api-key:anything}",
    "+vlm.extra_body={'token': anything}",
    "vlm.headers.Authorization=Bearer",
    "+task.password=anything",
    "hydra.job.env_set.OPENAI_API_KEY=anything",
    f"hydra.run.dir=runs/{KEY}",
    f"vlm.model={KEY}",
    "vlm.api_base=http://me:anything@host/v1",
    "vlm.api_base=http://host/v1?key=anything",
    "vlm.api_base=https://anything@host/v1",
    "vlm.api_base='https://host/v1?sv=2024&sig=anything'",
    "vlm.api_base='https://host/v1?X-Amz-Signature=anything'",
    "vlm.api_base=http://host/${oc.env:OPENAI_API_KEY}",
    "+vlm.x=${oc.decode:${oc.env:OPENAI_API_KEY,none}}",
]


@pytest.fixture
def planted(monkeypatch):
    monkeypatch.setenv("OPENAI_API_KEY", KEY)


def command(folder, *words):
    return python_m(folder, *words, PYTHONPATH=str(ROOT), OPENAI_API_KEY=KEY)


@pytest.mark.usefixtures("planted")
@pytest.mark.parametrize("word", WORDS)
def test_a_key_on_the_command_line_is_refused_and_not_repeated(word):
    for call in (lambda: refuse_key_words([word]), lambda: load("config", [word])):
        with pytest.raises(
            UsageError,
            match="it would be stored with the run; set the provider's environ",
        ) as error:
            call()
        assert "anything" not in str(error.value).partition(" is a key")[2]


@pytest.mark.usefixtures("planted")
@pytest.mark.parametrize(
    "word",
    [
        "vlm.max_tokens_total=5",
        "vlm.api_base=http://h:80/v1",
        "prompt.file=a:b.txt",
        "task.k={a: 1}",
    ],
)
def test_other_words_are_not_refused(word):
    refuse_key_words([word])


@pytest.mark.usefixtures("planted")
def test_a_key_in_a_configuration_is_refused():
    for config in (
        {"vlm": {"api_key": "x"}},
        {"a": [{"b": f"x{KEY}"}]},
        {"vlm": {"headers": {"a": "b"}}},
    ):
        with pytest.raises(
            UserError, match="of the configuration is a key or holds one"
        ):
            refuse_keys(OmegaConf.create(config))
    refuse_keys(
        OmegaConf.create(
            {"vlm": {"api_key": None, "token": "???", "n": 5}, "hydra": {"token": "x"}}
        )
    )


@pytest.mark.parametrize(
    "words",
    [["+vlm.api_key=anything"], ["-m", "+vlm.api_key=anything,other", "seed=1,2"]],
)
def test_nothing_is_written_when_a_key_is_on_the_command_line(words, tmp_path):
    done = command(tmp_path, "core.run", *words)
    assert (done.returncode, done.stdout) == (2, "")
    assert "anything" not in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("many", [[], ["-m", "seed=1,2"]])
def test_nothing_is_written_when_a_key_is_in_a_persons_own_config(many, tmp_path):
    (tmp_path / "mine" / "vlm").mkdir(parents=True)
    (tmp_path / "mine" / "vlm" / "own.yaml").write_text(
        "name: openai\napi_key: anything\n"
    )
    done = command(tmp_path, "core.run", *many, "vlm=own", "--config-dir", "mine")
    assert done.stderr.startswith(
        "error: vlm.api_key of the configuration is a key or holds one: "
    )
    assert "anything" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


# --- a run of another person ------------------------------------------------------------------------------------

CONFIG = {
    "task": {"name": "BringCube"},
    "vlm": {"name": "offline"},
}


def stored(folder, **changes):
    """The folder of a run that has stored such a configuration."""
    try:
        RunStore.create(folder, CONFIG | changes).run_ended()
    except UserError:  # it reads what it has written
        assert "${" in str(changes)
    return folder


@pytest.mark.usefixtures("planted")
@pytest.mark.parametrize(
    "config",
    [
        {"task": {"name": "${oc.env:OPENAI_API_KEY}"}},
        {"a": [{"b": {"${x}": 1}}]},
        {"a": "\\${oc.env:HOME}"},
    ],
)
def test_a_stored_configuration_is_not_resolved(config, tmp_path):
    folder = stored(tmp_path / "run", **config)
    for read in (RunStore.open, stored_config):
        with pytest.raises(UserError, match="which is not resolved"):
            read(folder)
    left_out = read_run(folder)
    assert isinstance(left_out, LeftOutRun)
    assert left_out.status == "unreadable"
    assert "which is not resolved" in left_out.reason
    assert KEY not in left_out.reason


@pytest.mark.parametrize(
    "name",
    [
        "replies",
        "replies/g0-a0.txt.part",
        "best",
        "best/design.json",
        "run.sqlite",
        "run.lock",
        ".hydra",
        "result.json",
    ],
)
def test_no_link_in_a_run_folder_is_followed(name, tmp_path):
    folder = stored(tmp_path / "run")
    (folder / ".hydra").mkdir()
    target = tmp_path / "elsewhere"
    target.mkdir()
    (target / "mine").write_text("mine")
    link = folder / name
    if link.is_dir():
        shutil.rmtree(link)
    link.unlink(missing_ok=True)
    link.parent.mkdir(exist_ok=True)
    link.symlink_to(target / "mine" if "." in name.lstrip(".") else target)
    for use in (refuse_links, Database):
        with pytest.raises(
            UserError,
            match="is a link or a device, and a run writes only within its folder",
        ):
            use(folder)
    assert (target / "mine").read_text() == "mine"
    assert [path.name for path in target.iterdir()] == ["mine"]


@pytest.mark.usefixtures("planted")
def test_what_the_store_writes_is_scrubbed(tmp_path):
    store = RunStore.create(tmp_path / "run", CONFIG | {"x": f"a {KEY} b"})
    store.run_ended()
    assert stored_config(tmp_path / "run")["x"] == "a *** b"
