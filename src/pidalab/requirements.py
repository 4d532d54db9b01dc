"""Requirements of a design: limits of robustness and noise."""

from __future__ import annotations

from dataclasses import dataclass

from pidalab import _check
from pidalab.process import Process, require_no_zero_at_origin

LARGEST_DISK = 2.0  # disk margin of a loop without feedback


@dataclass(frozen=True, kw_only=True)
class Requirements:
    """Requirements of a design. A limit of None is not applied.

    Attributes
    ----------
    ms : float
        Upper limit of the maximum sensitivity, above 1.
    mks : float, optional
        Upper limit of the gain from measurement noise to u at all frequencies, in units of u per unit of y.
    mt : float, optional
        Upper limit of \\|T\\| at all frequencies, above 1.
    disk : float, optional
        Lower limit of the disk margin, between 0 and 2.
    noise_gain : float, optional
        Upper limit of the noise gain, in units of u per unit of y.
    sample_time : float, optional
        Sample time of the noise. Give it only with `noise_gain`.
    family : tuple of Process
        Other plants, with which Ms must be at most `ms_worst`.
    ms_worst : float
        Upper limit of the maximum sensitivity with each plant of the family, above 1.

    Raises
    ------
    TypeError, ValueError
        If a value is out of range.

    Examples
    --------
    >>> from pidalab.requirements import Requirements
    >>> print(Requirements(ms=1.4, noise_gain=3.0, sample_time=0.1))
    ms <= 1.4, noise_gain <= 3
    """

    ms: float = 1.6
    mks: float | None = None
    mt: float | None = None
    disk: float | None = None
    noise_gain: float | None = None
    sample_time: float | None = None
    family: tuple[Process, ...] = ()
    ms_worst: float = 2.0

    def __post_init__(self) -> None:
        checked = {name: _check.real(name, getattr(self, name), above=1.0) for name in ("ms", "ms_worst")}
        least = {"mks": 0.0, "mt": 1.0, "disk": 0.0, "noise_gain": 0.0, "sample_time": 0.0}
        for name, bound in least.items():
            if getattr(self, name) is not None:
                checked[name] = _check.real(name, getattr(self, name), above=bound)
        if self.disk is not None and checked["disk"] >= LARGEST_DISK:
            raise ValueError(
                f"disk must be below {LARGEST_DISK:g} (reached without feedback), found {self.disk:g}"
            )
        if self.sample_time is not None and self.noise_gain is None:
            raise ValueError("sample_time needs noise_gain as well, found noise_gain=None")
        for k, plant in enumerate(self.family):
            require_no_zero_at_origin(f"family[{k}]", plant)
        for name, value in {**checked, "family": tuple(self.family)}.items():
            object.__setattr__(self, name, value)

    def limits(self) -> dict[str, float]:
        """Return the limits for the process itself, not for the family, by name."""
        names = ("ms", "mks", "noise_gain", "mt", "disk")
        return {name: value for name in names if (value := getattr(self, name)) is not None}

    def peaks(self, slack: float = 0.0) -> dict[str, float]:
        """Return the limits of peaks, multiplied by ``1 - slack``. The keys are names in `optimal.problem.PEAKS`."""
        limits = {name: value for name, value in self.limits().items() if name in ("ms", "mks", "mt")}
        if self.disk is not None:
            limits["inverse_disk"] = 1 / self.disk
        return {name: value * (1 - slack) for name, value in limits.items()}

    def reached(self, values: dict[str, float], share: float) -> list[str]:
        """Return the names of the limits that the values reach, within a relative tolerance `share`."""
        over = {name: values[name] / limit for name, limit in self.limits().items()}
        return [name for name, x in over.items() if (x <= 1 + share if name == "disk" else x >= 1 - share)]

    def __str__(self) -> str:
        return ", ".join(
            f"{name} {'>=' if name == 'disk' else '<='} {value:g}" for name, value in self.limits().items()
        )
