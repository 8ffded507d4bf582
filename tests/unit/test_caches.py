"""Where compiled kernels are kept when nothing can be written."""

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from exumob.support import caches


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


@pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="needs another user to become")
def test_help_works_for_a_user_who_can_write_nowhere(tmp_path):
    environment = {"PATH": os.environ["PATH"], "PYTHONPATH": os.pathsep.join(sys.path), "HOME": "/nonexistent"}
    environment["NUMBA_CACHE_DIR"] = "/root/nowhere"  # which this user may not even enter
    call = [sys.executable, "-m", "exumob", "--help"]
    try:
        found = subprocess.run(call, capture_output=True, text=True, env=environment, user=65534, check=False)
    except PermissionError:
        pytest.skip("the interpreter is in a folder that other users cannot enter")
    assert found.returncode == 0 and "lane-change" in found.stdout, found.stderr
    assert "Traceback" not in found.stderr
