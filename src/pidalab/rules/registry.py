"""The registry of rules, which `tune`, `compare`, `report` and the command line use.

`pidalab.tune` passes the process itself to a rule. `pidalab.compare` first derives the model from the process:

===============  =====================================================================================================
model            definition
===============  =====================================================================================================
`process`        the process itself
`reaction`       lag with dead time, from the steepest tangent of the step response and the time at 63 % of its
                 final value. If the process integrates, the model is `integrator`.
`first_order`    `reduction.to_fopdt`
`second_order`   `reduction.to_sopdt`
`third_order`    `identification.three_point` of the step response
`integrator`     `identification.ipdt_tangent`
===============  =====================================================================================================

The rules are:

"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

from pidalab import _check
from pidalab._text import KINDS
from pidalab.areas import from_process
from pidalab.process import Process
from pidalab.relative_noise import sampled_noise
from pidalab.requirements import Requirements
from pidalab.rules import automatic_reset, classical, direct, haalman, itae, magnitude_optimum, mrdp
from pidalab.rules._design import Design

DEFAULT = Requirements()
ORDER = {kind: order for order, kind in enumerate(KINDS)}
TESTS = ("load", "setpoint")  # steps for which a rule is made
# If a rule does not choose the filter, the delay of the filter is at least FILTER_SHARE * dead time of the model.
FILTER_SHARE = 0.25
RESET_FILTER = 3  # order of the filter of controllers with automatic reset
IMC = "heo2023, rows IMC"
HAALMAN = {"PI": "first_order", "PID": "second_order", "PIDA": "third_order"}
CHR_1952 = "Chien, Hrones and Reswick (1952)"
ZN, ZN_1942 = "Ziegler-Nichols", "Ziegler and Nichols (1942)"


@dataclass(frozen=True)
class Rule:
    """An entry of the registry.

    Attributes
    ----------
    name : str
        Name for `pidalab.tune` and `pidalab.compare`.
    source : str
        Paper and equations.
    models : mapping
        For each kind of controller, the name of the model from which the rule starts (see the table of this module).
    design : callable
        Function of a model, a kind and `Requirements` that returns a `Design`.
    short : str
        A shorter name that is also accepted, or "".
    compared : bool
        True if `pidalab.compare` includes the rule by default.
    knows_ms : bool
        True if the rule designs for a given maximum sensitivity.
    """

    name: str
    source: str
    models: Mapping[str, str]
    design: Callable[[Process, str, Requirements], Design]
    short: str = ""
    compared: bool = True
    knows_ms: bool = False

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of controllers that the rule designs."""
        return tuple(self.models)

    def tune(self, model: Process, kind: str, requirements: Requirements = DEFAULT) -> Design:
        """Design a controller of the given kind.

        Parameters
        ----------
        model : Process
            Model from which the rule starts.
        kind : str
            One of `kinds`.
        requirements : Requirements, optional
            Ms, or noise gain and sample time. A rule ignores the requirements that it does not support.

        Returns
        -------
        Design

        Raises
        ------
        ValueError
            If the rule does not design this kind, or refuses the model.

        Examples
        --------
        >>> import pidalab
        >>> from pidalab.rules.registry import RULES
        >>> RULES["simc"].tune(pidalab.fopdt(1.0, lag=4.0, delay=1.0), "PI").controller.kp
        2.0
        """
        if kind not in self.models:
            raise ValueError(
                f"kind must be {' or '.join(map(repr, self.kinds))} for the rule {self.name!r}, found {kind!r}"
            )
        return self.design(model, kind, requirements)


def find(name: str, *others: str) -> Rule:
    """Return the rule with this name, ignoring case.

    Parameters
    ----------
    name : str
        Name or short name of a rule.
    *others : str
        Further names that the error message lists.

    Returns
    -------
    Rule

    Raises
    ------
    ValueError
        If the name is unknown.

    Examples
    --------
    >>> from pidalab.rules.registry import find
    >>> find("ziegler-nichols").name
    'Ziegler-Nichols ultimate'
    """
    known = {key.lower(): rule for rule in RULES.values() for key in (rule.name, rule.short or rule.name)}
    if not isinstance(name, str) or name.lower() not in known:
        _check.choice("rule", name, (*others, *RULES))
    return known[name.lower()]


# --- how each rule is called ------------------------------------------------------------------------------------------


def _call_with_kind(
    tune: Callable[..., Design], *args: Any
) -> Callable[[Process, str, Requirements], Design]:
    """Return a function for `Rule.design` that calls `tune` with the model, `args` and the kind."""
    return lambda model, kind, limits: tune(model, *args, kind)


def _textbook(
    name: str, tune: Callable[..., Design], model: str, source: str, *args: Any, **more: Any
) -> Rule:
    return Rule(name, source, dict.fromkeys(("PI", "PID"), model), _call_with_kind(tune, *args), **more)


def _itae(test: str) -> Rule:
    source, models = "heo2023, Table 1 and eqs. (9) and (12)", dict.fromkeys(("PID", "PIDA"), "second_order")
    return Rule(f"itae {test}", source, models, _call_with_kind(itae.tune, test), "itae" * (test == "load"))


def _direct(test: str) -> Rule:
    source, short = "fitted to optima, not from a paper", "direct" * (test == "load")
    return Rule(
        f"direct {test}", source, {"PIDA": "second_order"}, lambda model, *_: direct.tune(model, test), short
    )


def _magnitude_optimum(model: Process, kind: str, limits: Requirements) -> Design:
    """Design with the shortest filter time that meets the noise limit and is at least the sample time.

    Without a noise limit or sample time, the filter time T_F is 0.1 (A_1/A_0)/(m + 1), where A_1/A_0 is the average
    residence time.
    """
    m, noise_gain, sample_time = ORDER[kind], limits.noise_gain, limits.sample_time
    if noise_gain is None or sample_time is None:
        first = from_process(model, 2)
        return magnitude_optimum.tune(model, m, m + 1, 0.1 * float(first[1] / first[0]) / (m + 1))
    shortest = magnitude_optimum.tune(model, m, m + 1, sample_time)
    if sampled_noise(shortest.loop(), sample_time)[0] <= noise_gain:
        return shortest
    return magnitude_optimum.tune_for_filter_noise(model, m, m + 1, noise_gain, sample_time)


def _mrdp(model: Process, kind: str, limits: Requirements) -> Design:
    m = ORDER[kind]
    if model.delay == 0:
        raise ValueError("model must have a dead time for the rule 'mrdp', found delay = 0")
    share = max(FILTER_SHARE, 1.2 * mrdp.smallest_te(m, m + 1))
    return mrdp.tune(model, m, m + 1, share * model.delay)


def _automatic_reset(setting: automatic_reset.Setting) -> Rule:
    kind = "PIDA" if setting.ka else "PID" if setting.kd else "PI"
    return Rule(
        f"automatic reset {setting.name}",
        f"huba2024, {setting.source}",
        {kind: "integrator"},
        lambda model, *_: automatic_reset.tune(
            model, setting, RESET_FILTER, FILTER_SHARE * model.delay / RESET_FILTER
        ),
    )


def _chr(test: str, overshoot: int) -> Rule:
    name, source = f"CHR {test} {overshoot} %", f"{CHR_1952}, {test}, {overshoot} % overshoot"
    tune = classical.chien_hrones_reswick
    return _textbook(name, tune, "reaction", source, test, overshoot, compared=False)


# --- the rules --------------------------------------------------------------------------------------------------------

RULES: dict[str, Rule] = {
    rule.name: rule
    for rule in (
        Rule(
            "haalman",
            "haalman2024, eqs. (2) and (8) to (10)",
            HAALMAN,
            lambda model, kind, limits: haalman.tune(model, limits.ms, kind),
            knows_ms=True,
        ),
        _textbook("simc", classical.simc, "process", "Skogestad (2003), eqs. (10), (11), (23) to (25)"),
        Rule(
            "improved simc",
            "Grimholt and Skogestad (2018), improved SIMC",
            {"PID": "process"},
            lambda model, *_: classical.improved_simc(model),
            compared=False,
        ),
        _textbook("amigo", classical.amigo, "reaction", "Åström and Hägglund (2004), AMIGO"),
        _textbook("lambda", classical.lambda_tuning, "reaction", "Åström and Hägglund (2006), section 6.5"),
        _textbook(
            f"{ZN} step", classical.ziegler_nichols_step, "integrator", f"{ZN_1942}, process reaction curve"
        ),
        _textbook(
            f"{ZN} ultimate",
            classical.ziegler_nichols_ultimate,
            "process",
            f"{ZN_1942}, ultimate sensitivity",
            short="ziegler-nichols",
        ),
        *(_chr(test, overshoot) for test, overshoot in product(TESTS, (0, 20))),
        Rule(
            "imc",
            IMC,
            {"PID": "first_order"},
            lambda model, *_: Design(model, itae.imc_pid(model), source=IMC),
        ),
        *map(_itae, TESTS),
        *map(_direct, TESTS),
        Rule(
            "magnitude optimum",
            "vrancic2021, eqs. (8) and (14) to (17)",
            dict.fromkeys(KINDS, "process"),
            _magnitude_optimum,
        ),
        Rule("mrdp", "huba2018, sec. II.B", dict.fromkeys(KINDS, "integrator"), _mrdp),
        *map(_automatic_reset, automatic_reset.SETTINGS.values()),
    )
}


def _table() -> str:
    """Return the rules as a table for the documentation."""
    rows = [("name", "model for each kind", "source")]
    for rule in RULES.values():
        models = ", ".join(f"{kind}: `{model}`" for kind, model in rule.models.items())
        rows.append((rule.name + (f" (or {rule.short})" if rule.short else ""), models, rule.source))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    border = "  ".join("=" * width for width in widths)
    head, *body = ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
    return "\n".join([border, head, border, *body, border]) + "\n"


__doc__ = (__doc__ or "") + _table()
