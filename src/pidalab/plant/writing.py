"""Files that are written whole or not at all, and that take the place of no edited one unless asked to."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path


def write_files(folder: str | Path, texts: Mapping[str, str], replace: bool = False) -> list[Path]:
    """Write texts as files of a folder: all of them whole, or none.

    They are written into a temporary folder beside their places and renamed when the last one is on the disk, so a full
    disk leaves nothing cut, and no mixture of an old set and a new one. Nor does a file that cannot be replaced: those
    before it get back what they were.

    Parameters
    ----------
    folder : str or pathlib.Path
        Where to; made if it is not there.
    texts : mapping of str to str
        Names of the files, and what is in them.
    replace : bool, optional
        Whether they may take the place of files of the same names that hold something else.

    Returns
    -------
    list of pathlib.Path
        The files.

    Raises
    ------
    FileExistsError
        If a file with something else in it has one of the names, and `replace` is false.
    OSError
        If they cannot be written, or a folder has one of the names.

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
    paths = [folder / name for name in texts]
    if not replace:
        refuse_others({path: texts[path.name] for path in paths})
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix=".pidalab-") as beside:
            for name, text in texts.items():
                with Path(beside, name).open("w", encoding="utf-8", newline="\n") as file:
                    file.write(text)
                    file.flush()
                    os.fsync(file.fileno())
            if not replace:  # once more: what another run has put there meanwhile stays, too
                refuse_others({path: texts[path.name] for path in paths})
            _put(Path(beside), paths)
    except OSError:
        for path in made:  # the folders that were made for it, from the inside
            if path.is_dir() and not any(path.iterdir()):
                path.rmdir()
        raise
    return paths


def _put(beside: Path, paths: Sequence[Path]) -> None:
    """Rename files to their places; if one cannot be, those before it get back what was there."""
    earlier = beside / ".earlier"
    earlier.mkdir()
    done: list[Path] = []
    try:
        for path in paths:
            if path.is_dir():
                raise IsADirectoryError(f"{path} must be a file, found a folder")
            if os.path.lexists(path):
                _keep(path, earlier / path.name)
            Path(beside, path.name).replace(path)
            done.append(path)
    except OSError:
        for path in done:
            if os.path.lexists(earlier / path.name):
                (earlier / path.name).replace(path)
            else:
                path.unlink()
        raise


def _keep(path: Path, place: Path) -> None:
    """Give a file, or a link as such, a second place; the first one stays."""
    try:
        os.link(path, place, follow_symlinks=False)
    except (OSError, NotImplementedError):  # not every disk has such links
        shutil.copy2(path, place, follow_symlinks=False)


def refuse_others(texts: Mapping[Path, str | None]) -> None:
    """Refuse paths at which something else lies than a text; of a text that is not known yet, anything.

    Raises
    ------
    FileExistsError
        With the names.
    """
    others = [
        path.name or str(path)
        for path, text in texts.items()
        if os.path.lexists(path)
        and (text is None or not path.is_file() or path.read_bytes() != text.encode("utf-8"))
    ]
    if others:
        raise FileExistsError(
            f"{', '.join(others)} {'is' if len(others) == 1 else 'are'} there and hold{'s' * (len(others) == 1)} "
            "something else (edited, or of another run): write to another place, or replace with --force"
        )
