"""Show a map of plants by roll-off and dead time, with the controller, its saving, a rule and a link to the lab."""

from __future__ import annotations

import base64
import json
from html import escape

import numpy as np
import pandas as pd
from IPython.display import HTML

import tables
import words

ROLLOFF = (-np.inf, 0.5, 1.0, 1.5, 2.0, np.inf)
DEAD = (-np.inf, 1e-3, 0.1, 0.2, 1 / 3, 2 / 3, np.inf)
ROWS = ("< 0.5", "0.5–1", "1–1.5", "1.5–2", "≥ 2")
COLUMNS = ("0", "< 0.1", "0.1–0.2", "0.2–0.33", "0.33–0.67", "≥ 0.67")
FEW = 3  # number of plants of a field on which a rule must work to be recommended
DIGITS = 9  # plants or rules that agree to so many digits count as equal, and the first one is used
UPWARDS = "writing-mode: vertical-rl; transform: rotate(180deg); width: 1.6rem"
PERIODS = 6.0  # time that the lab shows, in ultimate periods


def fields() -> pd.DataFrame:
    """Return the 134 plants with their fields of the map."""
    table = tables.plants()
    row = pd.cut(table["rolloff"], ROLLOFF, right=False, labels=False)
    return table.assign(row=row, column=pd.cut(table["dead_time"], DEAD, right=False, labels=False))


def facts(some: pd.DataFrame, study: tuple[pd.DataFrame, ...]) -> dict[str, object]:
    """Return the results of the study for the plants of a field."""
    saves, loud = (table[table["plant"].isin(some["plant"])] for table in study)
    steps = saves.groupby("terms")[["pid", "saves"]].median()
    saves = saves.groupby("terms")["saves"]
    rules = loud.groupby(["rule", "kind"])["of_best"].agg(["size", "median"]).reset_index()
    rules = rules[rules["size"] >= min(FEW, len(some))].round(DIGITS).sort_values(["median", "rule", "kind"])
    center = some[["rolloff", "dead_time"]].median()
    far = ((some[["rolloff", "dead_time"]] - center) / [0.5, 0.2]).pow(2).sum(axis=1).round(DIGITS)
    return {
        "kinds": {term: words.kind(*steps.loc[term]) for term in tables.NOISE},
        "saves": {
            term: (saves.median()[term], saves.min()[term], saves.max()[term]) for term in tables.NOISE
        },
        "rule": tables.with_kind(*rules.iloc[0][["rule", "kind"]]) if len(rules) else None,
        "distance": rules.iloc[0]["median"] if len(rules) else None,
        "typical": some.loc[far.idxmin()],
    }


def lab(plant: pd.Series, kind: str) -> str:
    """Return the address of the lab with a plant, the best controller of a kind, and the best of the kind below."""
    num, den = ([float(x) for x in plant[key].split()] for key in ("num", "den"))
    given = {"num": num, "den": den, "delay": float(plant["delay"])}
    given["end"] = float(f"{PERIODS * plant['ultimate_period']:.3g}")
    below = tables.KINDS[max(tables.KINDS.index(kind) - 1, 0)]
    designs = [{"kind": each, "rule": "optimum"} for each in dict.fromkeys((kind, below))]
    text = json.dumps({"plant": "given", "given": given, "designs": designs})
    code = base64.b64encode(text.encode()).decode().replace("+", "_").replace("/", "-").rstrip("=")
    return f"../lab.html#lab-{code}"


def advice(rule: str | None, distance: float | None) -> str:
    """Return advice: use the rule if the optimum saves less than a tenth of the rule's IAE, else the optimum."""
    if rule is None:
        return "No rule works here. Use the optimum, from the lab or pidalab.tune."
    far = f"{rule} is the best rule. It has {distance:.2f} times the least IAE in the median"
    near = 1 - 1 / distance < tables.WORTH
    return f"{far}, so {'it is good enough' if near else 'use the optimum instead'}."


def panel(name: str, title: str, some: pd.DataFrame, found: dict) -> str:
    """Return the panel that a click on a field shows."""

    def saving(term: str) -> str:
        middle, least, most = (f"{100 * x:.0f}" for x in found["saves"][term])
        return f"{middle} % in the median, from {least} to {most} %"

    kinds = found["kinds"]
    rows = {
        "Kind": f"{kinds['loud']} if noise may be loud, {kinds['quiet']} if it must be quiet",
        "Acceleration saves, noise loud": saving("loud"),
        "Acceleration saves, noise quiet": saving("quiet"),
        "Rule, noise loud": advice(found["rule"], found["distance"]),
    }
    plant = found["typical"]
    text = "".join(f"<dt>{key}</dt><dd>{escape(value)}</dd>" for key, value in rows.items())
    return (
        f'<div class="map-panel" id="{name}"><p><strong>{escape(title)}</strong>, {len(some)} '
        f"plant{'s' if len(some) > 1 else ''}</p><dl>{text}</dl>"
        f'<p><a href="{lab(plant, kinds["loud"])}">Open the lab</a> with {escape(plant["plant"])}, a typical plant '
        "of this field.</p></div>"
    )


def shown() -> HTML:
    """Return the map, with a field for each pair of ranges, coloured by the kind of controller for loud noise."""
    table, body, panels = fields(), [], []
    study = tables.pays(), tables.compared("loud").dropna(subset=["of_best"])
    for i in reversed(range(len(ROWS))):
        name = f'<th scope="rowgroup" rowspan="{len(ROWS)}" style="{UPWARDS}">roll-off</th>'
        cells = [name * (i + 1 == len(ROWS)), f'<th scope="row">{escape(ROWS[i])}</th>']
        for j in range(len(COLUMNS)):
            some = table[(table["row"] == i) & (table["column"] == j)]
            if some.empty:
                cells.append("<td></td>")
                continue
            found, name = facts(some, study), f"map-{i}-{j}"
            kind, saves = found["kinds"]["loud"], 100 * found["saves"]["loud"][0]
            cells.append(
                f'<td class="map-{kind}"><a href="#{name}"><strong>{kind}</strong><br>{saves:.0f} %</a></td>'
            )
            title = f"Roll-off {ROWS[i]}, dead time {COLUMNS[j]}"
            panels.append(panel(name, title, some, found))
        body.append(f"<tr>{''.join(cells)}</tr>")
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in COLUMNS)
    return HTML(
        '<div class="plant-map"><table><caption>Acceleration pays on plants with a large roll-off. Each field '
        "shows the controller to choose and, below it, how much of the PID's IAE a PIDA saves (median plant, loud "
        "noise). PIDA is named if it saves 10 % or more, PID if it saves as much of the IAE of a PI.</caption>"
        f'<thead><tr><td rowspan="2" style="width: 1.6rem"></td><td rowspan="2"></td><th scope="colgroup" '
        f'colspan="{len(COLUMNS)}">normalised dead time</th></tr><tr>{head}</tr></thead>'
        f"<tbody>{''.join(body)}</tbody></table>{''.join(panels)}</div>"
    )
