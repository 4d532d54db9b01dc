"""Compare a rule, given as a function, with all rules of the library and the optima on 134 plants.

`judge` measures each design as published. Then `pidalab.comparison.at_equal_terms` scales the design to a fixed maximum
sensitivity and noise gain, so that the IAE of different rules can be compared, and `judge` measures the scaled design.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from pidalab import _check
from pidalab._parts import done, require_executor
from pidalab._text import KINDS, STARTING_MODELS
from pidalab.comparison import first_horizon
from pidalab.comparison.fairness import at_equal_terms, gains_of
from pidalab.comparison.judging import DesignRow, measure_row, one_line
from pidalab.comparison.plants import batch
from pidalab.controllers.base import Controller
from pidalab.process import Process
from pidalab.relative_noise import SAMPLES, NoiseScale, noise_scale
from pidalab.rules import Design
from pidalab.rules.models import StartingModels

TABLES = Path(__file__).with_name("tables")
EQUAL_MS = 1.4  # maximum sensitivity of all scaled designs
NOISE = {"quiet": 0.3, "loud": 1.5}  # limits of the relative noise gain; a PI controller typically has 0.15
# Columns of the tables that `Benchmark.as_published` and `Benchmark.ranking` return.
PUBLISHED = ("plants", "Ms", "Ms, 9 of 10 below", "relative noise gain")
RANKED = ("plants", "of its kind", "of all", "worst tenth")

Rule = Callable[[Process], Design | Controller]


@cache
def stored(name: str) -> pd.DataFrame:
    """Return a stored table: ``processes``, ``comparison`` or ``optima``.

    Parameters
    ----------
    name : str
        Name of the table.

    Returns
    -------
    pandas.DataFrame
        The table. In ``comparison`` and ``optima``, values are in units of each plant's ultimate gain and period. All
        callers share the table, so copy it before you change it.

    Examples
    --------
    >>> from pidalab.comparison.benchmarking import stored
    >>> len(stored("processes").query("family not in ('frontier', 'map')"))
    134
    """
    _check.choice("name", name, ("processes", "comparison", "optima"))
    return pd.read_csv(TABLES / f"{name}.csv", keep_default_na=True)


def judge(
    rule: str, kind: str, make: Callable[[], Design], process: Process, scale: NoiseScale
) -> Iterator[dict[str, Any]]:
    """Yield the measures of a design on a plant, in units of the plant's ultimate gain and period.

    The first row is for the design as published. The second and third rows are for the design scaled to `EQUAL_MS` and
    to a noise limit: "loud" in the second row, and "quiet" in the third.

    Parameters
    ----------
    rule, kind : str
        Name of the rule and kind of controller. If `kind` is empty, the kind of the design is used.
    make : callable
        Function that returns the design, or raises ValueError if the rule does not apply.
    process : Process
        The plant.
    scale : NoiseScale
        Result of `pidalab.noise_scale` for the plant.

    Yields
    ------
    dict
        A row. If measures are missing, ``reason`` says why. There is only the first row if the rule refused, or if a
        measurement of its design raised an error.
    """
    row = measure_row(rule, kind, make, process, scale.sample_time, first_horizon(process))
    kind = kind or kind_of(row.design)
    yield {"rule": rule, "kind": kind, "terms": "own", **in_units(row, scale)}
    if row.design is not None:
        for terms in at_all_terms(row.design, process, scale):
            yield {"rule": rule, "kind": kind, **terms}


def in_units(row: DesignRow, scale: NoiseScale) -> dict[str, Any]:
    """Return the measures that are not NaN, in units of the plant's ultimate gain and period, and the reason."""
    if not row.applies:
        return {"reason": row.reason}
    measures = {
        "iae_load": row.iae_load * scale.gain / scale.period,
        "iae_setpoint": row.iae_setpoint / scale.period,
        "ms": row.ms,
        "mks": row.mks / scale.gain,
        "noise_gain": row.noise_gain / scale.gain,
        "tv": row.tv,
        "delay_margin": row.delay_margin / scale.period,
    }
    return {key: value for key, value in measures.items() if not math.isnan(value)} | {"reason": row.reason}


def at_all_terms(design: Design, process: Process, scale: NoiseScale) -> list[dict[str, Any]]:
    """Scale a design to `EQUAL_MS` and to each limit of `NOISE`, "loud" first. Return the measures as rows."""
    rows: list[dict[str, Any]] = []
    for terms, noise in sorted(NOISE.items(), key=lambda pair: -pair[1]):
        # If the previous row has the shortest filter time and keeps this noise limit too, use the row again.
        if rows and rows[-1].get("filter_time") == 1 / SAMPLES and rows[-1]["noise_gain"] <= noise:
            rows.append(rows[-1] | {"terms": terms})
        else:
            rows.append({"terms": terms} | at_terms(design, noise, process, scale))
    return rows


def at_terms(design: Design, noise: float, process: Process, scale: NoiseScale) -> dict[str, Any]:
    """Scale a design to `EQUAL_MS` and to the limit `noise` of the relative noise gain, and measure the scaled design.

    The set-point response is left out, since scaling removes the prefilter.
    """
    try:
        scaled = at_equal_terms(design, process, EQUAL_MS, noise * scale.gain, scale.sample_time)
        row = measure_row("", "", lambda: scaled, process, scale.sample_time, first_horizon(process))
    except (ValueError, ArithmeticError) as refusal:
        return {"reason": one_line(refusal)}
    known = in_units(row, scale)
    known.pop("iae_setpoint", None)
    time: float = scaled.controller.filter_time  # type: ignore[attr-defined]  # a HighOrderPID
    return known | {"factor": scaled.factor, "filter_time": round(time / scale.period, 12)}


def kind_of(design: Design | None) -> str:
    """Return "PI", "PID" or "PIDA" by the highest derivative of a design. For other designs or None, return ""."""
    return "" if design is None else dict(enumerate(KINDS)).get(gains_of(design.controller).size - 2, "")


@dataclass(frozen=True, eq=False)
class Benchmark:
    """Result of `benchmark`.

    Attributes
    ----------
    name : str
        Name of the rule.
    rows : pandas.DataFrame
        A row for each plant and each value of the column ``terms``: ``own`` (the rule as published), ``loud`` and
        ``quiet`` (the design scaled to Ms = 1.4 and to a relative noise gain of at most 1.5 or 0.3). Measures are in
        units of the plant's ultimate gain and period. For scaled designs, ``of_kind`` is IAE / (least IAE of the kind
        of controller), and ``of_best`` is IAE / (least IAE of all kinds). ``reason`` says why measures are missing, or
        how the noise gain was measured.
    """

    name: str
    rows: pd.DataFrame

    def ranking(self, terms: str = "loud") -> pd.DataFrame:
        """Rank this rule and all rules of the library, scaled to equal Ms and noise. The lowest IAE comes first.

        Parameters
        ----------
        terms : {"loud", "quiet"}, optional
            Limit of the relative noise gain: 1.5 for ``loud``, 0.3 for ``quiet``.

        Returns
        -------
        pandas.DataFrame
            A row for each rule and kind of controller. "of its kind" is the median of IAE / (least IAE of the kind).
            "of all" is the median of IAE / (least IAE of all kinds), by which the rows are sorted. "worst tenth" is the
            value that the ratio IAE / (least IAE of all kinds) exceeds on a tenth of the plants.

        Raises
        ------
        ValueError
            If the terms are unknown.

        Examples
        --------
        >>> import pidalab
        >>> rule = lambda process: pidalab.rules.classical.simc(process, "PI")
        >>> found = pidalab.benchmark(rule, "mine", "first_order", plants=["P2 T=1"])
        >>> found.ranking().loc[("mine", "PI"), "plants"].item()
        1
        """
        groups = self._beside(terms).groupby(["rule", "kind"])
        best = groups["of_best"]
        columns = groups.size(), groups["of_kind"].median(), best.median(), best.quantile(0.9)
        return pd.DataFrame(dict(zip(RANKED, columns, strict=True))).sort_values("of all")

    def _beside(self, terms: str) -> pd.DataFrame:
        """Return the rows with these terms for all rules of the library, followed by the rows for this rule."""
        _check.choice("terms", terms, tuple(NOISE))
        others = beside_least(stored("comparison").query("terms == @terms"))
        mine = self.rows.query("terms == @terms").assign(rule=self.name)
        return pd.concat([others, mine]).dropna(subset=["of_best"])

    def refusals(self) -> pd.Series:
        """Count, for each reason, the plants on which the rule refused or gave an unstable loop.

        Returns
        -------
        pandas.Series
            Number of plants for each reason.

        Examples
        --------
        >>> import pidalab
        >>> rule = lambda process: pidalab.rules.classical.simc(process, "PI")
        >>> found = pidalab.benchmark(rule, "mine", "first_order", plants=["P2 T=1"])
        >>> len(found.refusals())
        0
        """
        published = self.rows.query("terms == 'own'")
        return published.loc[published["ms"].isna(), "reason"].value_counts()

    def as_published(self) -> pd.DataFrame:
        """Return medians of the measures for the rule as published, by kind.

        Returns
        -------
        pandas.DataFrame
            Number of plants, median Ms, the Ms that nine of ten plants stay below, and median relative noise gain.

        Examples
        --------
        >>> import pidalab
        >>> rule = lambda process: pidalab.rules.classical.simc(process, "PI")
        >>> found = pidalab.benchmark(rule, "mine", "first_order", plants=["P2 T=1"])
        >>> found.as_published()["Ms"].round(2).item()
        1.66
        """
        groups = self.rows.query("terms == 'own'").dropna(subset=["ms"]).groupby("kind")
        ms, noise_gain = groups["ms"], groups["noise_gain"]
        columns = groups.size(), ms.median(), ms.quantile(0.9), noise_gain.median()
        return pd.DataFrame(dict(zip(PUBLISHED, columns, strict=True)))

    def __str__(self) -> str:
        plants = self.rows["plant"].nunique()
        lines = [
            f"{self.name}: {plants} plants, Ms = {EQUAL_MS:g}; IAE of a load step / least IAE",
            "as published:",
            self.as_published().round(2).to_string(),
            f"at equal Ms and a relative noise gain of {NOISE['loud']:g}:",
            self.ranking().round(2).to_string(),
        ]
        if len(refused := self.refusals()):
            lines += ["refused, or unstable:", *(f"{count:4} {reason}" for reason, count in refused.items())]
        return "\n".join(lines)

    def csv(self) -> str:
        """Return the rows as the text of a CSV file.

        Returns
        -------
        str

        Examples
        --------
        >>> import pidalab
        >>> rule = lambda process: pidalab.rules.classical.simc(process, "PI")
        >>> pidalab.benchmark(rule, "mine", "first_order", plants=["P2 T=1"]).csv().partition(",")[0]
        'plant'
        """
        return str(self.rows.to_csv(index=False, float_format="%.5g", lineterminator="\n"))

    def latex(self, terms: str = "loud") -> str:
        """Return the ranking as a LaTeX table, with the rule in bold.

        Parameters
        ----------
        terms : {"loud", "quiet"}, optional
            As for `ranking`.

        Returns
        -------
        str
            A ``tabular`` environment.

        Examples
        --------
        >>> import pidalab
        >>> rule = lambda process: pidalab.rules.classical.simc(process, "PI")
        >>> found = pidalab.benchmark(rule, "mine", "first_order", plants=["P2 T=1"])
        >>> "textbf{mine}" in found.latex()
        True
        """
        head = r"rule & kind & " + " & ".join(RANKED) + r" \\"
        lines = [r"\begin{tabular}{llrrrr}", r"\hline", head, r"\hline"]
        for (rule, kind), row in self.ranking(terms).iterrows():
            name = _escape(rule)
            cells = [rf"\textbf{{{name}}}" if rule == self.name else name, kind, f"{row['plants']:.0f}"]
            lines.append(" & ".join([*cells, *(f"{row[column]:.2f}" for column in RANKED[1:])]) + r" \\")
        return "\n".join([*lines, r"\hline", r"\end{tabular}"]) + "\n"

    def plot(self, terms: str = "loud") -> Figure:
        """Draw the IAE of all rules that give the same kinds of controller as this rule, and highlight this rule.

        Parameters
        ----------
        terms : {"loud", "quiet"}, optional
            As for `ranking`.

        Returns
        -------
        matplotlib.figure.Figure
            One panel with the median of IAE / (least IAE) over the plants, and the range from the first to the ninth
            decile.

        Examples
        --------
        >>> import pidalab
        >>> rule = lambda process: pidalab.rules.classical.simc(process, "PI")
        >>> found = pidalab.benchmark(rule, "mine", "first_order", plants=["P2 T=1"])
        >>> len(found.plot().axes)
        1
        """
        table = self._beside(terms)
        table = table[table["kind"].isin(self.rows.query("terms == @terms")["kind"])]
        tenths = table.groupby(["rule", "kind"])["of_best"].quantile([0.1, 0.5, 0.9]).unstack()
        tenths = tenths.sort_values(0.5, ascending=False)
        figure = Figure(figsize=(6.4, 0.8 + 0.24 * len(tenths)), layout="constrained")
        axes = figure.subplots()
        for place, ((rule, _), row) in enumerate(tenths.iterrows()):
            wide = rule == self.name
            axes.plot(
                [row[0.1], row[0.9]], [place, place], color="C0" if wide else "0.6", lw=3.0 if wide else 1.2
            )
            axes.plot(row[0.5], place, "o", color="C0" if wide else "0.4", ms=7 if wide else 4)
        # A dollar sign in a name must not start a formula.
        labels = [f"{rule} {kind}".replace("$", r"\$") for rule, kind in tenths.index]
        axes.set_yticks(range(len(tenths)), labels)
        axes.set(xscale="log", xlabel="IAE of a load step / least IAE: deciles 1 and 9, and median")
        axes.grid(axis="x", which="both", alpha=0.3)
        return figure


def beside_least(rows: pd.DataFrame) -> pd.DataFrame:
    """Add the least IAE, and the columns ``of_kind`` and ``of_best`` (see `Benchmark`), to rows of scaled designs."""
    optima = stored("optima").query("ms_limit == @EQUAL_MS")
    terms = {noise: name for name, noise in NOISE.items()}
    least = optima.assign(
        kind=optima["order"].map(dict(enumerate(KINDS))), terms=optima["noise_limit"].map(terms)
    )
    kinds = least.groupby(["plant", "terms", "kind"])["iae"].min().rename("least_of_kind").reset_index()
    best = least.groupby(["plant", "terms"])["iae"].min().rename("least").reset_index()
    table = rows.merge(kinds, on=["plant", "terms", "kind"], how="left")
    table = table.merge(best, on=["plant", "terms"], how="left")
    iae = table["iae_load"]
    return table.assign(of_kind=iae / table["least_of_kind"], of_best=iae / table["least"])


def benchmark(
    rule: Rule,
    name: str | None = None,
    model: str = "process",
    plants: Iterable[str] | None = None,
    executor: Executor | None = None,
) -> Benchmark:
    """Compare a rule of your own with all rules and the optima on the 134 plants of Åström and Hägglund.

    Parameters
    ----------
    rule : callable
        Function that takes a `Process` (a model of the plant) and returns a controller or a `Design`. If the rule does
        not apply, it must raise ValueError.
    name : str, optional
        Name of the rule in tables. By default the name of the function.
    model : str, optional
        Model that is passed to the rule: ``process``, ``reaction``, ``first_order``, ``second_order``, ``third_order``
        or ``integrator``. The module `pidalab.rules.registry` defines them.
    plants : iterable of str, optional
        Names of the plants on which the rule is tested. By default all 134 plants.
    executor : concurrent.futures.Executor, optional
        Pool of worker processes, or a cluster, that evaluates the plants in parallel. The workers must be able to
        import the rule. Without an executor, the benchmark takes about a minute.

    Returns
    -------
    Benchmark

    Raises
    ------
    TypeError, ValueError
        If the rule is not callable or returns neither a controller nor a `Design`, or if the model or a plant is
        unknown.

    Examples
    --------
    >>> import pidalab
    >>> def half(process):
    ...     return pidalab.rules.classical.simc(process, "PI")
    >>> result = pidalab.benchmark(half, "mine", model="first_order", plants=["P2 T=1", "P4 n=4"])
    >>> result.rows.query("terms == 'loud'")["of_best"].round(1).tolist()
    [2.0, 3.3]
    """
    if not callable(rule):
        raise TypeError(f"rule must be a function of a Process, found {type(rule).__name__}")
    _check.choice("model", model, STARTING_MODELS)
    called = name or str(getattr(rule, "__name__", "rule"))
    cases = {case.name: case.process for case in batch()}
    wanted = list(cases) if plants is None else list(plants)
    if unknown := [plant for plant in wanted if plant not in cases]:
        raise ValueError(f"plants must be names such as 'P2 T=1' and 'P4 n=4', found {unknown[0]!r}")
    require_executor(executor)
    judged = done(
        partial(_rows_of, rule, model), [(plant, cases[plant]) for plant in wanted], executor, "plant"
    )
    return Benchmark(called, _with_least([row for rows in judged for row in rows]))


def _rows_of(rule: Rule, model: str, case: tuple[str, Process]) -> list[dict[str, Any]]:
    name, process = case

    def make() -> Design:
        design = rule(getattr(StartingModels(process), model))
        if isinstance(design, Design):
            return design
        if isinstance(design, Controller):
            return Design(process, design, source="a rule of the user")
        raise TypeError(f"rule must return a controller or a Design, found {type(design).__name__}")

    return [{"plant": name, **row} for row in judge("", "", make, process, noise_scale(process))]


def _with_least(rows: list[dict[str, Any]]) -> pd.DataFrame:
    columns = (
        "plant kind terms iae_load iae_setpoint ms mks noise_gain tv delay_margin factor filter_time reason"
    )
    table = pd.DataFrame(rows).reindex(columns=columns.split())
    return beside_least(table).drop(columns=["least_of_kind", "least"])


def _escape(text: str) -> str:
    """Escape the special characters of LaTeX."""
    return "".join(f"\\{character}" if character in "&%$#_{}" else character for character in text)
