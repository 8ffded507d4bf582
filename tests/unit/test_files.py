"""Files are written whole or not at all."""

import errno
import os

import pytest

from exumob.support.files import atomic_write, require_writable


@pytest.mark.parametrize("before", [None, "old"], ids=["new file", "existing file"])
@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, OSError])
def test_an_error_leaves_the_folder_as_it_was(tmp_path, before, error):
    file = tmp_path / "table.txt"
    if before is not None:
        file.write_text(before)
    with pytest.raises(error), atomic_write(file) as temporary:
        temporary.write_text("half")
        raise error("stop")
    assert [p.name for p in tmp_path.iterdir()] == ([] if before is None else ["table.txt"])
    if before is not None:
        assert file.read_text() == before


def test_the_old_content_stands_until_the_block_ends(tmp_path):
    file = tmp_path / "table.txt"
    file.write_text("old")
    with atomic_write(str(file)) as temporary:
        assert temporary.parent == tmp_path
        temporary.write_bytes(b"new")
        assert file.read_text() == "old"
    assert file.read_text() == "new"
    assert list(tmp_path.iterdir()) == [file]


def test_the_content_reaches_the_disk_before_the_rename(tmp_path, monkeypatch):
    order, file, real = [], tmp_path / "table.txt", os.fsync
    monkeypatch.setattr(os, "fsync", lambda number: (order.append(file.exists()), real(number)))
    with atomic_write(file) as temporary:
        temporary.write_text("new")
    assert order == [False] and file.exists()


def test_a_block_that_writes_nothing_and_a_missing_folder_are_errors(tmp_path):
    with pytest.raises(OSError, match="nothing was written"), atomic_write(tmp_path / "table.txt"):
        pass
    with pytest.raises(FileNotFoundError), atomic_write(tmp_path / "none" / "table.txt") as temporary:
        temporary.write_text("new")
    assert list(tmp_path.iterdir()) == []


def test_a_planted_link_is_not_followed_and_names_cannot_be_guessed(tmp_path):
    """Whatever lies in the folder, no other file than the one wanted is touched."""
    target, names = tmp_path / "secret", set()
    target.write_text("secret")
    for n in range(5):
        (tmp_path / f".table.txt.{os.getpid() + n}.partial").symlink_to(target)
    for _ in range(20):
        with atomic_write(tmp_path / "table.txt") as temporary:
            assert not temporary.is_symlink()
            names.add(temporary.name)
            temporary.write_text("new")
    assert len(names) == 20 and target.read_text() == "secret"


def test_files_have_the_mode_of_the_users_mask(tmp_path):
    before = os.umask(0o027)
    try:
        with atomic_write(tmp_path / "table.txt") as temporary:
            temporary.write_text("new")
    finally:
        os.umask(before)
    assert (tmp_path / "table.txt").stat().st_mode & 0o777 == 0o640


def test_a_full_disk_is_found_beforehand(tmp_path, monkeypatch):
    require_writable(tmp_path / "run.npz")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ValueError, match="No such file or directory; give a folder"):
        require_writable(tmp_path / "none" / "run.npz")

    def full(number):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(ValueError, match=r"run\.npz cannot be written: No space left on device"):
        require_writable(tmp_path / "run.npz")
    with pytest.raises(OSError, match="No space left"), atomic_write(tmp_path / "table.txt") as temporary:
        temporary.write_text("new")
    assert list(tmp_path.iterdir()) == []
