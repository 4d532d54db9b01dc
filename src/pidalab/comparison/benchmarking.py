"""Judge a rule, given as a function, on 134 plants, with all rules of the library and the optima.

The rule of a user and those of the library go through the same judge, `judge`: first as published, then scaled to the
same maximum sensitivity and the same noise (`pidalab.comparison.at_equal_terms`). What the library's rules and the
optima reach is stored beside this file, in units of each plant's ultimate gain and period.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

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

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

TABLES = Path(__file__).with_name("tables")
EQUAL_MS = 1.4  # of all that is compared at equal terms
NOISE = {"quiet": 0.3, "loud": 1.5}  # relative noise gains: about two and ten times that of a PI
PUBLISHED = ("plants", "Ms", "Ms, 9 of 10 below", "relative noise gain")  # columns of what is as published
RANKED = ("plants", "of its kind", "of all", "worst tenth")  # columns of a ranking

Rule = Callable[[Process], Design | Controller]


@cache
def stored(name: str) -> pd.DataFrame:
    """Return a stored table: ``processes``, ``comparison`` or ``optima``, in units of each plant.

    Parameters
    ----------
    name : str
        Of the table.

    Returns
    -------
    pandas.DataFrame
        One for all callers: copy before you change it.

    Examples
    --------
    >>> from pidalab.comparison.benchmarking import stored
    >>> len(stored("processes").query("family not in ('frontier', 'map')"))
    134
    """
    import pandas as pd

    _check.choice("name", name, ("processes", "comparison", "optima"))
    return pd.read_csv(TABLES / f"{name}.csv", keep_default_na=True)


def judge(
    rule: str, kind: str, make: Callable[[], Design], process: Process, scale: NoiseScale
) -> Iterator[dict[str, Any]]:
    """Yield what a design is on a plant: as published, then at equal terms, loud noise first; in units of the plant.

    Parameters
    ----------
    rule, kind : str
        Names of the rows; an empty kind is read off the design.
    make : callable
        Returns the design, or raises ValueError where the rule does not apply.
    process : Process
        The plant.
    own : NoiseScale
        Of the plant.

    Yields
    ------
    dict
        A refusal is a row with its ``reason``.
    """
    row = measure_row(rule, kind, make, process, scale.sample_time, first_horizon(process))
    kind = kind or kind_of(row.design)
    yield {"rule": rule, "kind": kind, "terms": "own", **in_units(row, scale)}
    if row.design is not None:
        for terms in at_all_terms(row.design, process, scale):
            yield {"rule": rule, "kind": kind, **terms}


def in_units(row: DesignRow, scale: NoiseScale) -> dict[str, Any]:
    """Return the measures in the units of the plant; those that are not known are left out."""
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
    """Return the proportions of a design at the Ms and the noise of all others, the loud terms first."""
    rows: list[dict[str, Any]] = []
    for terms, noise in sorted(NOISE.items(), key=lambda pair: -pair[1]):
        # a filter as short as the sample stays so where less noise is allowed and not made
        if rows and rows[-1].get("filter_time") == 1 / SAMPLES and rows[-1]["noise_gain"] <= noise:
            rows.append(rows[-1] | {"terms": terms})
        else:
            rows.append({"terms": terms} | at_terms(design, noise, process, scale))
    return rows


def at_terms(design: Design, noise: float, process: Process, scale: NoiseScale) -> dict[str, Any]:
    """Return a design at equal terms, measured; its prefilter is gone, so that its set-point response says nothing."""
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
    """Return what a design is by its highest derivative: "PI", "PID" or "PIDA"; empty for anything else."""
    return "" if design is None else dict(enumerate(KINDS)).get(gains_of(design.controller).size - 2, "")


@dataclass(frozen=True, eq=False)
class Benchmark:
    """Result of `benchmark`.

    Attributes
    ----------
    name : str
        Of the rule.
    rows : pandas.DataFrame
        A row for each plant and terms (``own``, ``loud``, ``quiet``), in units of the plant: what was measured, the IAE
        over the least of its kind (``of_kind``) and of all kinds (``of_best``), and the reason of a refusal.
    """

    name: str
    rows: pd.DataFrame

    def ranking(self, terms: str = "loud") -> pd.DataFrame:
        """Return the rule among all rules of the library at equal terms, the nearest to the best first.

        Parameters
        ----------
        terms : {"loud", "quiet"}, optional
            How much noise is allowed: a relative noise gain of 1.5 or 0.3.

        Returns
        -------
        pandas.DataFrame
            A row for each rule and kind: on how many plants it could be judged, the median of its IAE over the least of
            its kind and over the least of all kinds, and what it exceeds on a tenth of the plants.

        Raises
        ------
        ValueError
            For other terms.

        Examples
        --------
        >>> import pidalab
        >>> rule = lambda process: pidalab.rules.classical.simc(process, "PI")
        >>> found = pidalab.benchmark(rule, "mine", "first_order", plants=["P2 T=1"])
        >>> found.ranking().loc[("mine", "PI"), "plants"].item()
        1
        """
        import pandas as pd

        groups = self._beside(terms).groupby(["rule", "kind"])
        best = groups["of_best"]
        columns = groups.size(), groups["of_kind"].median(), best.median(), best.quantile(0.9)
        return pd.DataFrame(dict(zip(RANKED, columns, strict=True))).sort_values("of all")

    def _beside(self, terms: str) -> pd.DataFrame:
        """Return what could be judged at equal terms: rows of all rules, and of this one under its name."""
        import pandas as pd

        _check.choice("terms", terms, tuple(NOISE))
        others = beside_least(stored("comparison").query("terms == @terms"))
        mine = self.rows.query("terms == @terms").assign(rule=self.name)
        return pd.concat([others, mine]).dropna(subset=["of_best"])

    def refusals(self) -> pd.Series:
        """Count the plants on which the rule refused or made an unstable loop, by reason.

        Returns
        -------
        pandas.Series
            Counts by message.

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
        """Return medians of what the rule is with its author's own settings, by kind.

        Returns
        -------
        pandas.DataFrame
            Plants, Ms, the Ms that nine of ten stay below, relative noise gain.

        Examples
        --------
        >>> import pidalab
        >>> rule = lambda process: pidalab.rules.classical.simc(process, "PI")
        >>> found = pidalab.benchmark(rule, "mine", "first_order", plants=["P2 T=1"])
        >>> found.as_published()["Ms"].round(2).item()
        1.66
        """
        import pandas as pd

        groups = self.rows.query("terms == 'own'").dropna(subset=["ms"]).groupby("kind")
        ms, noise_gain = groups["ms"], groups["noise_gain"]
        columns = groups.size(), ms.median(), ms.quantile(0.9), noise_gain.median()
        return pd.DataFrame(dict(zip(PUBLISHED, columns, strict=True)))

    def __str__(self) -> str:
        plants = self.rows["plant"].nunique()
        lines = [
            f"{self.name}: {plants} plants, Ms = {EQUAL_MS:g}; IAE of a load step over the least there is",
            "as published:",
            self.as_published().round(2).to_string(),
            f"at equal Ms and a relative noise gain of {NOISE['loud']:g}:",
            self.ranking().round(2).to_string(),
        ]
        if len(refused := self.refusals()):
            lines += ["refused, or unstable:", *(f"{count:4} {reason}" for reason, count in refused.items())]
        return "\n".join(lines)

    def csv(self) -> str:
        """Return the rows as the text of a CSV file, for other programs.

        Returns
        -------
        str

        Examples
        --------
        >>> import pidalab
        >>> rule = lambda process: pidalab.rules.classical.simc(process, "PI")
        >>> pidalab.benchmark(rule, "mine", "first_order", plants=["P2 T=1"]).csv().count("mine")
        1
        """
        return str(self.rows.to_csv(index=False, float_format="%.5g", lineterminator="\n"))

    def latex(self, terms: str = "loud") -> str:
        """Return the ranking as a table for a paper, with the rule in bold.

        Parameters
        ----------
        terms : {"loud", "quiet"}, optional
            As for `ranking`.

        Returns
        -------
        str
            A tabular.

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
        """Draw the spread of every rule of the same kinds over the plants, this one marked.

        Parameters
        ----------
        terms : {"loud", "quiet"}, optional
            As for `ranking`.

        Returns
        -------
        matplotlib.figure.Figure
            One panel: from the first to the ninth tenth of the plants, and the median.

        Examples
        --------
        >>> import pidalab
        >>> rule = lambda process: pidalab.rules.classical.simc(process, "PI")
        >>> found = pidalab.benchmark(rule, "mine", "first_order", plants=["P2 T=1"])
        >>> len(found.plot().axes)
        1
        """
        from matplotlib.figure import Figure

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
        # a name is no formula
        labels = [f"{rule} {kind}".replace("$", r"\$") for rule, kind in tenths.index]
        axes.set_yticks(range(len(tenths)), labels)
        axes.set(
            xscale="log", xlabel="IAE of a load step over the least there is; a tenth, median, nine tenths"
        )
        axes.grid(axis="x", which="both", alpha=0.3)
        return figure


def beside_least(rows: pd.DataFrame) -> pd.DataFrame:
    """Return rows at equal terms with their IAE over the least of their kind, and of all kinds, for the same terms."""
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
    """Judge a rule of your own on the 134 plants of Åström and Hägglund, beside all rules and the best there is.

    Parameters
    ----------
    rule : callable
        Takes a `Process`, its model of the plant, and returns a controller or a `Design`. It raises ValueError where it
        does not apply; the message is kept.
    name : str, optional
        What it is called in tables; by default the function's name.
    model : str, optional
        What the rule is given: ``process``, the plant itself, or a model of it, as the authors of rules start from:
        ``reaction`` (lag and dead time from the steepest tangent), ``first_order``, ``second_order`` (reductions),
        ``third_order`` (three points of the step response), ``integrator`` (with dead time).
    plants : iterable of str, optional
        Names of plants, for a first look; by default all.
    executor : concurrent.futures.Executor, optional
        Who computes: processes, or the executor of a cluster. The rule has to be importable there. By default this
        process, which takes about a minute.

    Returns
    -------
    Benchmark
        Print it, or take its figure, its CSV, its table for a paper.

    Raises
    ------
    TypeError, ValueError
        For a rule that cannot be called or returns something else, and for names that are unknown.

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
    import pandas as pd

    columns = (
        "plant kind terms iae_load iae_setpoint ms mks noise_gain tv delay_margin factor filter_time reason"
    )
    table = pd.DataFrame(rows).reindex(columns=columns.split())
    return beside_least(table).drop(columns=["least_of_kind", "least"])


def _escape(text: str) -> str:
    """Escape the special characters of LaTeX."""
    return "".join(f"\\{character}" if character in "&%$#_{}" else character for character in text)
