"""Which compiled kernels a change makes stale."""

import os

import pytest
from numba_cache import prepare

SOURCES = {
    "__init__.py": "from made_up.drag import drag\n",
    "constants.py": "DENSITY = 1000.0\n",
    "shapes/__init__.py": "",
    "shapes/area.py": "from made_up import constants\nfrom numba import njit\n",
    "drag.py": "def late():\n    from made_up.shapes.area import area\nimport numba\n",
    "plot.py": "from made_up.drag import drag\n",
    "heat.py": "from numba import njit\n",
}
KERNELS = ("area", "drag", "heat")


@pytest.fixture
def package(tmp_path):
    root = tmp_path / "made_up"
    for name, text in SOURCES.items():
        (root / name).parent.mkdir(exist_ok=True, parents=True)
        (root / name).write_text(text)
    prepare(tmp_path / "cache", root)
    (tmp_path / "cache" / "made_up_123").mkdir()
    for name in KERNELS:
        for ending in ("nbi", "1.nbc"):
            (tmp_path / "cache" / "made_up_123" / f"{name}.{name}-1.py311.{ending}").touch()
    return root


@pytest.mark.parametrize(
    ("changed", "stale"),
    [
        ("constants.py", {"area", "drag"}),
        ("shapes/area.py", {"area", "drag"}),
        ("drag.py", {"drag"}),
        ("heat.py", {"heat"}),
        ("plot.py", set()),
        ("__init__.py", set()),
    ],
)
def test_kernels_of_changed_files_and_of_those_that_import_them_go(package, changed, stale):
    (package / changed).write_text(SOURCES[changed] + "# changed\n")
    cache = package.parent / "cache"
    prepare(cache, package)
    left = [file.name.split(".")[0] for file in cache.glob("*/*.nb[ic]")]
    assert sorted(left) == sorted(2 * list(set(KERNELS) - stale))


def test_nothing_changed_nothing_goes(package):
    os.utime(package / "constants.py")
    prepare(package.parent / "cache", package)
    assert len(list(package.parent.glob("cache/*/*.nb[ic]"))) == 2 * len(KERNELS)


def test_a_cache_that_others_may_write_is_not_used(package, tmp_path):
    cache = tmp_path / "cache"
    cache.chmod(0o777)
    with pytest.raises(PermissionError, match="others may write"):
        prepare(cache, package)
    (tmp_path / "link").symlink_to(tmp_path)
    with pytest.raises(PermissionError, match="is a link"):
        prepare(tmp_path / "link", package)
