"""Files are written whole or not at all."""

import os

import pytest

from exumob.support.files import atomic_write


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
    with pytest.raises(FileNotFoundError), atomic_write(tmp_path / "table.txt"):
        pass
    with pytest.raises(FileNotFoundError), atomic_write(tmp_path / "none" / "table.txt") as temporary:
        temporary.write_text("new")
    assert list(tmp_path.iterdir()) == []
