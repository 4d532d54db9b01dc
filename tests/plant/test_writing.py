"""Files are written whole or not at all, and an edited one stays."""

import errno
import os
from pathlib import Path

import pytest

from pidalab.plant.writing import refuse_others, write_files

OLD = {"controller.c": "old c", "controller.py": "old python"}
NEW = {"controller.c": "new c", "controller.py": "new python", "report.html": "page"}


def texts(folder):
    """What lies in a folder; hidden files, too."""
    return {path.name: path.read_text(encoding="utf-8") for path in folder.iterdir()}


def full_disk(monkeypatch, room):
    """Let the disk be full after so many files."""
    left = [room]

    def fsync(_):
        if not left[0]:
            raise OSError(errno.ENOSPC, "No space left on device")
        left[0] -= 1

    monkeypatch.setattr(os, "fsync", fsync)


def test_files_are_written_with_the_folders_above_them(tmp_path):
    folder = tmp_path / "a" / "b"
    assert write_files(folder, NEW) == [folder / name for name in NEW]
    assert texts(folder) == NEW
    assert write_files(str(folder), NEW) == [folder / name for name in NEW]  # the same again is no change
    (folder / "note").write_bytes(b"")
    write_files(folder, {"line.txt": "µ\nline"})
    assert (folder / "line.txt").read_bytes() == "µ\nline".encode()


@pytest.mark.parametrize("room", range(len(NEW)))
@pytest.mark.parametrize("before", [{}, OLD], ids=["new", "over an older set"])
def test_a_full_disk_leaves_what_was_there(tmp_path, monkeypatch, room, before):
    folder = tmp_path / "a" / "b"
    if before:
        write_files(folder, before)
    full_disk(monkeypatch, room)
    with pytest.raises(OSError, match="No space left"):
        write_files(folder, NEW, replace=True)
    assert (texts(folder) if before else list(tmp_path.iterdir())) == (before or [])


@pytest.mark.parametrize("first", [{}, OLD], ids=["new", "over an older set"])
def test_a_file_that_cannot_be_replaced_leaves_the_set_that_was_there(tmp_path, monkeypatch, first):
    """A folder in its place, or on Windows a program that holds it open."""
    write_files(tmp_path, first)
    (tmp_path / "report.html").mkdir()
    with pytest.raises(FileExistsError, match=r"report\.html"):
        write_files(tmp_path, NEW)
    with pytest.raises(IsADirectoryError, match=r"report\.html must be a file, found a folder"):
        write_files(tmp_path, NEW, replace=True)
    (tmp_path / "report.html").rmdir()
    assert texts(tmp_path) == first
    (tmp_path / "report.html").write_text("kept", encoding="utf-8")
    own = Path.replace

    def held(self, target):
        if self.name == Path(target).name == "report.html" and self.parent.name != ".earlier":
            raise PermissionError(errno.EACCES, "held by another program")
        return own(self, target)

    for linked in (True, False):
        with monkeypatch.context() as patched:
            patched.setattr(Path, "replace", held)
            if not linked:  # a disk without hard links
                patched.setattr(os, "link", lambda *_, **__: (_ for _ in ()).throw(PermissionError(1, "no")))
            with pytest.raises(PermissionError, match="held by another"):
                write_files(tmp_path, NEW, replace=True)
        assert texts(tmp_path) == {**first, "report.html": "kept"}


def test_what_another_run_has_put_there_meanwhile_stays(tmp_path, monkeypatch):
    own = os.fsync

    def meanwhile(number):
        (tmp_path / "controller.py").write_text("of the other run", encoding="utf-8")
        own(number)

    monkeypatch.setattr(os, "fsync", meanwhile)
    with pytest.raises(FileExistsError, match=r"^controller\.py is there"):
        write_files(tmp_path, NEW)
    assert texts(tmp_path) == {"controller.py": "of the other run"}


@pytest.mark.skipif(os.name == "nt", reason="links need rights there")
def test_a_link_is_replaced_and_what_it_points_to_stays(tmp_path):
    (tmp_path / "elsewhere").write_text("mine", encoding="utf-8")
    folder = tmp_path / "out"
    folder.mkdir()
    for name, target in (("controller.c", "elsewhere"), ("controller.py", "nowhere")):
        (folder / name).symlink_to(tmp_path / target)
    with pytest.raises(FileExistsError, match=r"controller\.c, controller\.py are"):
        write_files(folder, NEW)
    write_files(folder, NEW, replace=True)
    assert texts(folder) == NEW
    assert texts(tmp_path / "out") == NEW
    assert (tmp_path / "elsewhere").read_text(encoding="utf-8") == "mine"
    assert not (tmp_path / "nowhere").exists()


def test_a_folder_that_cannot_be_made_is_an_error_and_leaves_nothing(tmp_path):
    (tmp_path / "file").write_text("kept", encoding="utf-8")
    with pytest.raises(OSError, match="file"):
        write_files(tmp_path / "file" / "out", NEW)
    assert texts(tmp_path) == {"file": "kept"}


def test_an_edited_file_is_named_and_kept_unless_it_may_be_replaced(tmp_path):
    write_files(tmp_path, OLD)
    (tmp_path / "controller.c").write_text("edited", encoding="utf-8")
    with pytest.raises(FileExistsError, match=r"^controller\.c is there and holds .*--force"):
        write_files(tmp_path, OLD)
    with pytest.raises(FileExistsError, match=r"^controller\.c, controller\.py are there and hold .*--force"):
        write_files(tmp_path, NEW)
    assert texts(tmp_path) == {**OLD, "controller.c": "edited"}
    write_files(tmp_path, NEW, replace=True)
    assert texts(tmp_path) == NEW


def test_files_that_are_not_made_yet_are_refused_before(tmp_path):
    refuse_others({tmp_path / "a": None, tmp_path / "b": "text"})
    (tmp_path / "a").write_text("", encoding="utf-8")
    (tmp_path / "b").mkdir()
    with pytest.raises(FileExistsError, match=r"^a is "):
        refuse_others({tmp_path / "a": None})
    with pytest.raises(FileExistsError, match=r"^b is "):
        refuse_others({tmp_path / "b": "text"})


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_a_device_that_is_full_is_an_error(tmp_path):
    (tmp_path / "controller.c").symlink_to("/dev/full")
    with pytest.raises(FileExistsError, match=r"controller\.c"):
        write_files(tmp_path, OLD)
