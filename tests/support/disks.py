"""Disks that refuse: full, of a limited file size, or read-only."""

import contextlib
import os
import resource
import shutil
import subprocess

import pytest


@contextlib.contextmanager
def small_files(size):
    """Let no file grow beyond ``size`` bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def mount(*words):
    """Skip the test where that isn't allowed, as in most containers."""
    if not shutil.which("mount"):
        pytest.skip("no mount here")
    done = subprocess.run(["mount", *words], capture_output=True, text=True)
    if done.returncode != 0:
        pytest.skip(f"can't mount: {done.stderr.strip()}")


@pytest.fixture
def disk(tmp_path):
    """A folder to mount a disk on."""
    folder = tmp_path / "disk"
    folder.mkdir()
    yield folder
    subprocess.run(["umount", "-l", folder], capture_output=True)


@pytest.fixture
def sealed(tmp_path):
    """Copy a folder to one that can't be written, not even by root."""
    folder = tmp_path / "sealed"
    folder.mkdir()

    def seal(source, ignore=None):
        if os.getuid() == 0:
            mount("-t", "tmpfs", "-o", "size=50m", "tests", str(folder))
        shutil.copytree(source, folder, ignore=ignore, dirs_exist_ok=True)
        if os.getuid() == 0:
            mount("-o", "remount,ro", str(folder))
        else:
            folder.chmod(0o555)
        return folder

    yield seal
    if os.getuid() == 0:
        subprocess.run(["umount", "-l", folder], capture_output=True)
    else:
        folder.chmod(0o755)
