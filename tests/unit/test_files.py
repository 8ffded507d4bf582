"""Files are written whole or not at all."""

import errno
import os
import stat

import numpy as np
import pytest
import xarray as xr
from damage import damage

from exumob.simulation.result_files import load_dataset, save_dataset
from exumob.support.files import SEAL_LENGTH, atomic_write, read_netcdf, require_writable


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
    with (
        pytest.raises(FileNotFoundError, match="create it first"),
        atomic_write(tmp_path / "none" / "t.txt") as temporary,
    ):
        temporary.write_text("new")
    assert list(tmp_path.iterdir()) == []


# -- no predictable names ----------------------------------------------------------------------------------------------


def test_temporary_names_cannot_be_foreseen(tmp_path):
    names = set()
    for _ in range(20):
        with atomic_write(tmp_path / "table.txt") as temporary:
            assert temporary.name.startswith(".table.txt.") and temporary.name.endswith(".partial")
            names.add(temporary.name)
            temporary.write_text("new")
    assert len(names) == 20 and str(os.getpid()) not in "".join(name.split(".")[3] for name in names)


def test_a_planted_link_is_not_followed(tmp_path, monkeypatch):
    """Even where the name could be foreseen: it must be new."""
    precious = tmp_path / "precious"
    precious.write_text("mine")
    monkeypatch.setattr("secrets.token_hex", lambda n: "0")
    (tmp_path / ".table.txt.0.partial").symlink_to(precious)
    with pytest.raises(FileExistsError), atomic_write(tmp_path / "table.txt") as temporary:
        temporary.write_text("theirs")
    assert precious.read_text() == "mine"


def test_a_link_at_the_target_is_replaced_and_not_written_through(tmp_path):
    precious, file = tmp_path / "precious", tmp_path / "table.txt"
    precious.write_text("mine")
    file.symlink_to(precious)
    with atomic_write(file) as temporary:
        temporary.write_text("new")
    assert (precious.read_text(), file.read_text(), file.is_symlink()) == ("mine", "new", False)


@pytest.mark.parametrize("mask", [0o022, 0o077, 0o002])
def test_mode_is_that_of_the_umask(tmp_path, mask):
    before = os.umask(mask)
    try:
        with atomic_write(tmp_path / "table.txt") as temporary:
            temporary.write_text("new")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "table.txt").stat().st_mode) == 0o666 & ~mask


def test_long_names_can_be_written(tmp_path):
    file = tmp_path / ("x" * 250 + ".txt")
    with atomic_write(file) as temporary:
        temporary.write_text("new")
    assert file.read_text() == "new"


# -- netCDF ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A small result and its file's content."""
    rng = np.random.default_rng(0)
    result = xr.Dataset(
        {"position": (("time", "axis"), rng.standard_normal((200, 3)), {"units": "m"})},
        {"time": 0.01 * np.arange(200), "axis": ["x", "y", "z"]},
        {"status": "completed", "parameters": '{"a": 1}' * 30},
    )  # fmt: skip
    return result, save_dataset(result, tmp_path_factory.mktemp("whole") / "run.nc").read_bytes()


@pytest.mark.parametrize("seed", range(60))
def test_a_damaged_result_is_the_right_one_or_refused(written, tmp_path, seed):
    """Cut off, bits turned over, pieces left out: at places drawn at random, and at both ends."""
    result, data = written
    file = tmp_path / "run.nc"
    file.write_bytes(data)
    damage(file, seed, (0, -1, 8, -SEAL_LENGTH))
    try:
        found = load_dataset(file)
    except ValueError as error:
        assert str(file) in str(error) and "make it anew" in str(error)
    else:
        xr.testing.assert_identical(found, result)


@pytest.mark.parametrize("content", [b"", b"\0", b"{}", b"\x89HDF\r\n\x1a\n", b"CDF\x01" + 100 * b"\0", 5000 * b"x"])
def test_other_files_are_refused(tmp_path, content):
    file = tmp_path / "run.nc"
    file.write_bytes(content)
    with pytest.raises(ValueError, match=r"run\.nc cannot be read as netCDF-4"):
        load_dataset(file)


def test_what_is_missing_is_named(written, tmp_path):
    file = tmp_path / "run.nc"
    with pytest.raises(FileNotFoundError, match=r"run\.nc does not exist"):
        load_dataset(file)
    with pytest.raises(ValueError, match="is a folder"):
        load_dataset(tmp_path)
    file.write_bytes(written[1])
    assert read_netcdf(file, ["position", "time", "status"]).sizes["time"] == 200
    with pytest.raises(ValueError, match=r"run\.nc holds no yaw, no water_wrench"):
        read_netcdf(file, ["position", "yaw", "water_wrench"])


def test_files_of_others_and_files_written_anew_are_read(written, tmp_path):
    """They carry no seal."""
    written[0].to_netcdf(tmp_path / "theirs.nc", engine="h5netcdf")
    xr.testing.assert_identical(load_dataset(tmp_path / "theirs.nc"), written[0])


def test_a_full_disk_is_found_beforehand(tmp_path, monkeypatch):
    require_writable(tmp_path / "run.npz")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ValueError, match=r"the folder .*none does not exist; create it first"):
        require_writable(tmp_path / "none" / "run.npz")

    def full(number):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(ValueError, match=r"run\.npz cannot be written: No space left on device"):
        require_writable(tmp_path / "run.npz")
    with pytest.raises(OSError, match="No space left"), atomic_write(tmp_path / "table.txt") as temporary:
        temporary.write_text("new")
    assert list(tmp_path.iterdir()) == []
