"""Requirements of a design."""

from __future__ import annotations

from typing import NamedTuple


class DesignLimits(NamedTuple):
    """Requirements of a design; None for no limit.

    Attributes
    ----------
    ms, mks, mt : float
        Largest values of |S|, |C S| and |T| over all frequencies.
    noise_gain, sample_time : float
        Largest standard deviation of u per unit of that of white measurement noise, and its sample time.
    disk : float
        Smallest disk margin.
    """

    ms: float
    mks: float | None = None
    noise_gain: float | None = None
    sample_time: float | None = None
    mt: float | None = None
    disk: float | None = None

    def named(self) -> dict[str, float]:
        """The limits that there are, by name."""
        return {name: value for name, value in self._asdict().items() if value and name != "sample_time"}

    def heights(self, room: float) -> dict[str, float]:
        """Return the largest values over all frequencies, less a share for rounding: see `HEIGHTS`."""
        found = {name: value for name, value in self.named().items() if name in ("ms", "mks", "mt")}
        if self.disk:
            found["half"] = 1 / self.disk
        return {name: value * (1 - room) for name, value in found.items()}

    def reached(self, values: dict[str, float], share: float) -> list[str]:
        """Return the names of the limits that values come up to within a share."""
        over = {name: values[name] / limit for name, limit in self.named().items()}
        return [name for name, x in over.items() if (x <= 1 + share if name == "disk" else x >= 1 - share)]

    def __str__(self) -> str:
        return ", ".join(
            f"{name} {'>=' if name == 'disk' else '<='} {value:g}" for name, value in self.named().items()
        )
