"""Check that files are written completely or not at all, and that edited files are kept."""

import errno
import os
from pathlib import Path

import pytest

from pidalab.plant.writing import write_files

OLD = {"controller.c": "old c", "controller.py": "old python"}
NEW = {"controller.c": "new c", "controller.py": "new python", "report.html": "page"}


def texts(folder):
    """Return all files of a folder, also hidden files."""
    return {path.name: path.read_text(encoding="utf-8") for path in folder.iterdir()}


def fail_at(monkeypatch, owner, name, count, error, after=False):
    """Make call number `count` of a function fail before or after its work."""
    own, calls = getattr(owner, name), iter(range(100))

    def failing(*arguments, **options):
        fails = next(calls) == count
        if fails and not after:
            raise error
        result = own(*arguments, **options)
        if fails:
            raise error
        return result

    monkeypatch.setattr(owner, name, failing)


def test_files_and_folders_are_written(tmp_path):
    folder = tmp_path / "a" / "b"
    assert write_files(folder, NEW) == [folder / name for name in NEW]
    assert texts(folder) == NEW
    assert write_files(str(folder), NEW) == [folder / name for name in NEW]
    write_files(folder, {"line.txt": "µ\nline"})
    assert (folder / "line.txt").read_bytes() == "µ\nline".encode()


@pytest.mark.parametrize("before", [{}, OLD], ids=["new", "over an older set"])
@pytest.mark.parametrize("after", [False, True], ids=["before", "after"])
@pytest.mark.parametrize("count", range(len(NEW)))
@pytest.mark.parametrize(
    ("owner", "name", "error"),
    [
        (os, "fsync", OSError(errno.ENOSPC, "full disk")),
        (Path, "replace", PermissionError(errno.EACCES, "held by another program")),
        (Path, "replace", KeyboardInterrupt()),
        (os, "fsync", KeyboardInterrupt()),
    ],
)
def test_failure_leaves_the_earlier_set(tmp_path, monkeypatch, owner, name, error, count, after, before):
    folder = tmp_path / "a" / "b"
    if before:
        write_files(folder, before)
    with monkeypatch.context() as patched:
        fail_at(patched, owner, name, count, error, after)
        with pytest.raises(type(error)):
            write_files(folder, NEW, replace=True)
    assert (texts(folder) if before else list(tmp_path.iterdir())) == (before or [])


def test_folder_in_place_of_a_file_is_refused(tmp_path):
    write_files(tmp_path, OLD)
    (tmp_path / "report.html").mkdir()
    with pytest.raises(FileExistsError, match=r"report\.html"):
        write_files(tmp_path, NEW)
    with pytest.raises(IsADirectoryError, match=r"report\.html"):
        write_files(tmp_path, NEW, replace=True)
    (tmp_path / "report.html").rmdir()
    assert texts(tmp_path) == OLD
    with pytest.raises(OSError, match="controller"):
        write_files(tmp_path / "controller.c" / "out", NEW)


@pytest.mark.skipif(os.name == "nt", reason="links need rights there")
def test_link_is_replaced_and_its_target_stays(tmp_path):
    (tmp_path / "elsewhere").write_text("mine", encoding="utf-8")
    folder = tmp_path / "out"
    folder.mkdir()
    for name, target in (("controller.c", "elsewhere"), ("controller.py", "nowhere")):
        (folder / name).symlink_to(tmp_path / target)
    with pytest.raises(FileExistsError, match=r"controller\.c, controller\.py"):
        write_files(folder, NEW)
    write_files(folder, NEW, replace=True)
    assert texts(folder) == NEW
    assert (tmp_path / "elsewhere").read_text(encoding="utf-8") == "mine"
    assert not (tmp_path / "nowhere").exists()


def test_edited_files_are_named_and_kept(tmp_path):
    write_files(tmp_path, OLD)
    (tmp_path / "controller.c").write_text("edited", encoding="utf-8")
    with pytest.raises(FileExistsError, match=r"^controller\.c exists .*--force"):
        write_files(tmp_path, OLD)
    assert texts(tmp_path) == {**OLD, "controller.c": "edited"}
    write_files(tmp_path, NEW, replace=True)
    assert texts(tmp_path) == NEW
