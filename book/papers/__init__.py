"""What the chapters of the book compute with, a module for each paper."""

from collections.abc import Hashable, Mapping

import pandas as pd


def spell(id: str, words: Mapping[str, str]) -> str:
    """Return an id of the ledger, or a part of one, as the paper writes its names."""
    parts = id.split(".")
    if id in words or words.keys().isdisjoint(parts):  # a name already
        return words.get(id, id)
    return ", ".join(words.get(part, part) for part in parts)


def spelled(table: pd.DataFrame, words: Mapping[str, str]) -> pd.DataFrame:
    """Return a table with its ids spelled; other labels stay."""

    def shown(label: Hashable) -> Hashable:
        return spell(label, words) if isinstance(label, str) else label

    return table.rename(index=shown, columns=shown)
