"""Numbers that the prose of the chapter and of its audit quotes, as text by name."""

import math
from itertools import product

import numpy as np
import pidalab
from pidalab.ledger import Ledger

from . import beyond, schemes
from .examples import experiment, processes, proposed, tuned
from .printed_itae import PID_VALUES, PIDA_VALUES, exact, proposed_misses, row, sampled
from .statements import CHOSEN, filter_costs, largest_gains
from .table1 import crossings, data, figure1


def of_chapter(book: Ledger) -> dict[str, str]:
    """What the method chapter quotes."""
    return _rules() | _full() | _models() | _printed(book) | _loops() | _sampled()


def of_audit(book: Ledger) -> dict[str, str]:
    """What the audit quotes."""
    return _rules() | _models() | _printed(book) | _schemes(book) | _loops()


def _share(value: float) -> str:
    return f"{100 * value:.0f} %"


def _rules() -> dict[str, str]:
    """How the rules do on models that no fit has seen."""
    unseen = beyond.contest().query("role == 'validation'")
    by_rule = unseen.pivot(index=["kind", "damping", "ratio"], columns="rule", values="itae")
    wins = {
        f"{rule}_{kind}": f"{(by_rule.loc[kind, rule] < by_rule.loc[kind, 'Table 1']).sum()}"
        for rule, kind in product(("refit", "direct"), beyond.CONTEST)
    }
    return wins | {
        "n_unseen": f"{len(by_rule.loc['load'])}",
        "direct_unseen": _share(by_rule.loc["setpoint", "direct"].max() - 1),
    }


def _full() -> dict[str, str]:
    """How the rules do on the processes whose models they are given."""
    servo, load = (beyond.on_full(kind) for kind in beyond.CONTEST)
    better = sum(one["direct"][0] < one["Table 1"][0] for one in servo.values())
    return {
        "n_full": f"{len(servo)}",
        "full_wins": f"{better}",
        "full_losses": f"{len(servo) - better}",
        "full_direct_ms": f"{max(one['direct'][1] for one in load.values()):.2f}",
        "full_table1_ms": f"{max(one['Table 1'][1] for one in load.values()):.1f}",
    }


def _models() -> dict[str, str]:
    """What is known of the optima, and of Table 1 over its range."""
    fit = beyond.contest().query("role == 'fit' and kind == 'setpoint'")
    means = np.exp(np.log(fit.itae).groupby(fit.rule).mean())
    ms = beyond.contest().query("role == 'grid' and kind == 'load' and rule == 'Table 1'").ms
    stored = data("itae_optima.csv").query("kind == 'load' and role == 'fit' and ms_bound == 2")
    return {
        "n_fit": f"{len(stored)}",
        "with_best": f"{means['best factors']:.2f}",
        "with_table1": f"{means['Table 1']:.2f}",
        "direct_fit": _share(fit.query("rule == 'direct'").itae.max() - 1),
        "cancelled": f"{sum(off < 0.02 for _, _, off in beyond.zeros().values())}",
        "free_ms": f"{np.median(beyond.free_peaks()):.1f}",
        "fd_median": f"{stored.f_d.median():.3f}",
        "unstable": _share(np.isinf(ms).mean()),
        "fragile": _share((ms > 6).mean()),
        "median_rest": f"{ms[ms <= 6].median():.1f}",
        "crossing": f"{np.mean(crossings()):.2f}",
    }


def _printed(book: Ledger) -> dict[str, str]:
    """The printed ITAE values, and the optimum of Paper Fig. 1."""
    printed = {key: book.printed(row(key)) for key in PID_VALUES + PIDA_VALUES}
    by_exact = [abs(exact(key) / printed[key] - 1) for key in PID_VALUES]
    own = [abs(sampled(key) / printed[key] - 1) for key in PIDA_VALUES]
    hits = sum(abs(sampled(key) - printed[key]) <= book.row(row(key)).half_unit for key in PID_VALUES)
    over = [one["PIDA, proposed"].itae() / one["PIDA, optimal"].itae() - 1 for one in figure1().values()]
    return {
        "hits": f"{hits}",
        "by_exact": f"{100 * max(by_exact):.2f} %",
        "own_low": _share(min(own)),
        "own_high": _share(max(own)),
        "figure1_low": _share(min(over)),
        "figure1_high": _share(max(over)),
    }


def _schemes(book: Ledger) -> dict[str, str]:
    """The schemes of sampling that were tried on the printed ITAE values."""
    nearest = min(max(map(abs, misses)) for misses in proposed_misses(book).values())
    return {
        "n_pid": f"{len(schemes.pid_variants())}",
        "n_pida": f"{len(schemes.pida_variants())}",
        "nearest": f"{100 * nearest:.1f} %",
    }


def _loops() -> dict[str, str]:
    """Gains and noise."""
    rise = largest_gains()["PIDA"] / largest_gains()["PID"]
    noise = filter_costs()[1].loc[experiment(1, "load"), CHOSEN]
    C = proposed()[1, "setpoint"]
    return {
        "gain_low": f"{rise.min():.1f}",
        "gain_high": f"{rise.max():.1f}",
        "noise_move": f"{0.001 * noise:.0f}",
        "filter_time": f"{C.alpha_a * C.tau_a:.3f}",
    }


def _sampled() -> dict[str, str]:
    """What a limited actuator and a digital controller leave."""
    return {
        "at_30": beyond.gained(30.0),
        "at_10": beyond.gained(10.0),
        "at_2": beyond.gained(2.0),
        "pid_itae": f"{_digital('itae2', 0.001):.2f}",
        "fine_itae": f"{_digital('proposed', 0.0001):.2f}",
        "coarse_itae": f"{_digital('proposed', 0.001):.2f}",
    }


def _digital(method: str, h: float) -> float:
    """ITAE of Example 1 with the set point and a digital controller."""
    loop = pidalab.Loop(processes()[1], tuned()[1, method, "setpoint"])
    return pidalab.simulate_sampled(loop, h * np.arange(math.ceil(15 / h) + 1), setpoint=1.0).itae()
