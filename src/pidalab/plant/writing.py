"""Write files completely or not at all, and replace edited files only on request."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

PREFIX = ".pidalab-"  # beginning of the name of the hidden, temporary folder


def write_files(folder: str | Path, texts: Mapping[str, str], *, replace: bool = False) -> list[Path]:
    """Write texts as files of a folder, all of them or none.

    Parameters
    ----------
    folder : str or pathlib.Path
        The folder, which is created if it does not exist.
    texts : mapping of str to str
        Contents by file name.
    replace : bool, optional
        Replace files of the same names even if their contents differ.

    Returns
    -------
    list of pathlib.Path
        Paths of the files.

    Raises
    ------
    FileExistsError
        If a file of one of these names has other contents, and `replace` is false.
    OSError
        If a file cannot be written, or if a folder has one of these names.

    Notes
    -----
    The files are first written to a hidden folder, and renamed after the last file is on the disk. If the renaming is
    interrupted, even by Ctrl-C, the earlier contents are restored.

    Examples
    --------
    >>> import tempfile
    >>> from pidalab.plant.writing import write_files
    >>> folder = tempfile.mkdtemp()
    >>> [path.name for path in write_files(folder, {"a.txt": "first", "b.txt": "second"})]
    ['a.txt', 'b.txt']
    >>> [path.read_text() for path in write_files(folder, {"a.txt": "edited"}, replace=True)]
    ['edited']
    """
    folder = Path(folder)
    wanted = {folder / name: text for name, text in texts.items()}
    if not replace:
        refuse_others(wanted)
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix=PREFIX) as hidden:
            for name, text in texts.items():
                with Path(hidden, name).open("w", encoding="utf-8", newline="\n") as file:
                    file.write(text)
                    file.flush()
                    os.fsync(file.fileno())
            _rename(Path(hidden), list(wanted))
    except BaseException:
        for path in made:
            if path.is_dir() and not any(path.iterdir()):
                path.rmdir()
        raise
    return list(wanted)


def _rename(hidden: Path, paths: Sequence[Path]) -> None:
    """Move the hidden files to their final paths. If this fails, restore the earlier files."""
    earlier = hidden / ".earlier"
    earlier.mkdir()
    for path in paths:
        if path.is_dir():
            raise IsADirectoryError(f"{path} must be a file, found a folder")
        if os.path.lexists(path):
            shutil.copy2(path, earlier / path.name, follow_symlinks=False)
    try:
        for path in paths:
            Path(hidden, path.name).replace(path)
    except BaseException:
        for path in paths:
            if os.path.lexists(earlier / path.name):
                (earlier / path.name).replace(path)
            elif not os.path.lexists(hidden / path.name):  # the file was renamed already
                path.unlink()
        raise


def refuse_others(texts: Mapping[Path, str | None]) -> None:
    """Raise an error if a path exists with other contents. A path whose text is None must not exist."""
    others = [
        path.name or str(path)
        for path, text in texts.items()
        if os.path.lexists(path)
        and (text is None or not path.is_file() or path.read_bytes() != text.encode("utf-8"))
    ]
    if others:
        raise FileExistsError(
            f"{', '.join(others)} exist{'s' * (len(others) == 1)} and would be overwritten: "
            "write to another place, or replace with --force"
        )
