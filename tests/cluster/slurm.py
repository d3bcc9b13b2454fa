"""A Slurm cluster of two nodes on this machine: Debian's own daemons, on loopback, in a folder of their own."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

PACKAGES = ("slurm-wlm", "munge")
NODES = ("one", "two")
PATIENCE_S = 600

# Without accounting and without control groups, which a container does not give away. A node that is silent for ten
# seconds is down, and comes back when it answers.
CONF = """
ClusterName=loopback
SlurmctldHost=localhost
SlurmctldPort={ports[0]}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool/%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd-%n.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd-%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
ReturnToService=2
SchedulerType=sched/backfill
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
SlurmdParameters=config_overrides
SlurmdTimeout=10
KillWait=10
NodeName=one NodeHostname=localhost NodeAddr=127.0.0.1 Port={ports[1]} CPUs=2 RealMemory=8000
NodeName=two NodeHostname=localhost NodeAddr=127.0.0.1 Port={ports[2]} CPUs=2 RealMemory=8000
PartitionName=main Nodes=one,two Default=YES MaxTime=INFINITE State=UP
"""


class Slurm:
    """A running cluster; its commands find it by ``environment``."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.environment = os.environ | {"SLURM_CONF": str(folder / "slurm.conf")}
        self._daemons: dict[str, subprocess.Popen[bytes]] = {}

    def start(self) -> None:
        """Start the daemons, and wait until both nodes take jobs."""
        for name in ("state", "spool"):
            (self.folder / name).mkdir()
        key = self.folder / "munge.key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o400)
        conf = CONF.format(folder=self.folder, ports=free_ports(3))
        (self.folder / "slurm.conf").write_text(conf)

        files = {"key": "key", "socket": "socket", "pid": "pid", "seed": "seed"}
        words = [
            f"--{kind}-file={self.folder}/munge.{end}" for kind, end in files.items()
        ]
        words[1] = f"--socket={self.folder}/munge.socket"
        log = f"--log-file={self.folder}/munge.log"
        self._begin("munged", "munged", "-F", "--force", *words, log)
        wait_until((self.folder / "munge.socket").exists)
        self._begin("slurmctld", "slurmctld", "-D")
        for node in NODES:
            self.start_node(node)
        wait_until(lambda: [self.state(node) for node in NODES] == ["idle", "idle"])

    def start_node(self, node: str) -> None:
        self._begin(node, "slurmd", "-D", "-N", node)

    def kill_node(self, node: str) -> None:
        """End all that runs on a node at once, as a power cut does."""
        listed = subprocess.run(
            ["squeue", "-h", "-w", node, "-o", "%A"],
            env=self.environment,
            capture_output=True,
            text=True,
        )
        jobs = listed.stdout.split()
        daemon = self._daemons.pop(node)
        daemon.kill()
        daemon.wait()
        watching = [step for job in jobs for step in processes({}, f"[{job}.")]
        for pid in watching + processes({"SLURMD_NODENAME": node}):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    def state(self, node: str) -> str:
        return self.command("sinfo", "-h", "-n", node, "-o", "%T").strip()

    def command(self, *words: str) -> str:
        done = subprocess.run(
            words, env=self.environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    def node_of(self, job: str) -> str:
        return self.command("squeue", "-h", "-j", job, "-o", "%N").strip()

    def stop(self) -> None:
        subprocess.run(["scancel", "--user=root"], env=self.environment)
        for node in [node for node in NODES if node in self._daemons]:
            self.kill_node(node)
        for daemon in reversed(self._daemons.values()):
            daemon.terminate()
        for daemon in self._daemons.values():
            daemon.wait()

    def _begin(self, name: str, *words: str) -> None:
        with (self.folder / f"{name}.out").open("ab") as output:
            self._daemons[name] = subprocess.Popen(
                words,
                env=self.environment,
                stdout=output,
                stderr=output,
                start_new_session=True,
            )


@contextmanager
def cluster(folder: Path) -> Iterator[Slurm]:
    """Start a cluster; install Slurm first where it is missing."""
    install()
    slurm = Slurm(folder)
    try:
        slurm.start()
        yield slurm
    finally:
        slurm.stop()


def install() -> None:
    """Install Slurm from Debian's packages, which only root can."""
    if shutil.which("slurmctld") and shutil.which("munged"):
        return
    if os.getuid() != 0 or not shutil.which("apt-get"):
        pytest.skip(f"needs Slurm: apt-get install {' '.join(PACKAGES)}")
    quiet = {"stdout": subprocess.DEVNULL, "check": True}
    subprocess.run(["apt-get", "update", "-q"], **quiet)
    words = ["apt-get", "install", "-yq", "--no-install-recommends", *PACKAGES]
    subprocess.run(words, **quiet)


def free_ports(count: int) -> list[int]:
    with contextlib.ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(count)]
        for listener in sockets:
            listener.bind(("127.0.0.1", 0))
        return [listener.getsockname()[1] for listener in sockets]


def processes(environment: dict[str, str], *words: str) -> list[int]:
    """Find the processes that were started with these variables, and with these words in their command."""
    wanted = {f"{key}={value}" for key, value in environment.items()}
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            variables = (folder / "environ").read_bytes().decode(errors="replace")
            command = (folder / "cmdline").read_bytes().decode(errors="replace")
            named = all(word in command for word in words)
            if named and wanted <= set(variables.split("\0")):
                found.append(int(folder.name))
    return found


def job_of(environment: dict[str, str], *words: str) -> str | None:
    """Find the job of a process with these variables, and these words in its command."""
    for pid in processes(environment, *words):
        with contextlib.suppress(OSError):
            variables = Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
            for variable in variables:
                if variable.startswith(b"SLURM_JOB_ID="):
                    return variable.decode().partition("=")[2]
    return None


def wait_until(what, process: subprocess.Popen[str] | None = None) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not what():
        if process is not None and process.poll() is not None:
            raise AssertionError(process.communicate()[0])
        assert time.monotonic() < deadline
        time.sleep(0.2)
