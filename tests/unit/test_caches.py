"""Where compiled kernels are kept when nothing can be written."""

import ctypes
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from exumob.support import caches

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(("variable", "sources", "home", "private"), [
    ("kernels", False, False, False), ("", True, False, False), ("", False, True, False), ("", False, False, True),
    ("a file/kernels", False, False, True), ("a file/kernels", False, True, False),
])  # fmt: skip
def test_a_private_folder_only_where_there_is_no_other(monkeypatch, tmp_path, variable, sources, home, private):
    (tmp_path / "a file").touch()
    monkeypatch.setenv(caches.VARIABLE, str(tmp_path / variable) if variable else "")
    monkeypatch.setenv("MPLCONFIGDIR", str(tmp_path))
    settings = SimpleNamespace(CACHE_DIR="")
    monkeypatch.setitem(sys.modules, "numba", SimpleNamespace(config=settings))
    monkeypatch.setattr(caches, "_sources_writable", lambda: sources)
    monkeypatch.setattr(caches, "_home_writable", lambda: home)
    left = []
    monkeypatch.setattr(caches.atexit, "register", left.append)
    caches.provide_cache()
    assert caches.is_private() == private
    if private:
        folder = os.environ[caches.VARIABLE]
        assert os.stat(folder).st_mode & 0o777 == 0o700 and settings.CACHE_DIR == folder
        left[0]()
        assert not os.path.exists(folder)


def test_a_folder_that_may_not_be_entered_is_not_writable(monkeypatch):
    def refuse(path):
        raise PermissionError

    monkeypatch.setattr(Path, "exists", refuse)
    assert not caches._writable(Path("/root/nowhere"))


def without_privileges():
    """Hold root's child to the permissions of files: without CAP_DAC_OVERRIDE and CAP_DAC_READ_SEARCH."""
    if os.geteuid() == 0:
        libc = ctypes.CDLL(None, use_errno=True)
        for capability in (1, 2):
            if libc.prctl(24, capability, 0, 0, 0) != 0:  # PR_CAPBSET_DROP
                raise OSError(ctypes.get_errno(), "prctl")


@pytest.mark.skipif(sys.platform != "linux", reason="capabilities are Linux's")
def test_help_works_for_a_user_who_can_write_nowhere(tmp_path):
    """A package, a home and a cache that are not this user's to write, and the last not even to enter."""
    site = tmp_path / "site"
    for package in ("exumob", "vehicle_models"):
        shutil.copytree(ROOT / package, site / package, ignore=shutil.ignore_patterns("__pycache__"))
    home, closed = tmp_path / "home", tmp_path / "closed"
    home.mkdir(), closed.mkdir()
    for folder in (*(path for path in site.rglob("*") if path.is_dir()), site, home):
        folder.chmod(0o555)
    closed.chmod(0)
    tried = "import importlib.util as u; print(u.find_spec('exumob').origin); open('file', 'w')"
    environment = {"PATH": os.environ["PATH"], "PYTHONPATH": str(site), "HOME": str(home)}
    environment["NUMBA_CACHE_DIR"] = str(closed / "kernels")

    def answer(*arguments):
        return subprocess.run(
            [sys.executable, *arguments], capture_output=True, text=True, env=environment, check=False, cwd=home,
            preexec_fn=without_privileges,
        )  # fmt: skip

    found = answer("-m", "exumob", "--help")
    assert found.returncode == 0 and "lane-change" in found.stdout, found.stderr
    assert "Traceback" not in found.stderr
    refused = answer("-c", tried)  # so the test tries what it says
    assert str(site) in refused.stdout and "PermissionError" in refused.stderr, refused
