"""Questions about data: files of every kind, and records at the edges of what a method takes."""

import tempfile
from pathlib import Path

import control
import numpy as np
from asked_designs import designed
from asked_loops import PLANTS

import pidalab
from pidalab import Record, areas, identification
from pidalab.rules import magnitude_optimum

FIRST = PLANTS["first order"]
TABLE = "time,valve,level\n0,40,20\n1,40,20.1\n2,47,20\n3,47,21.5\n4,47,23\n5,47,24.1\n6,47,24.9\n"
FILES = {
    "plain": TABLE,
    "semicolons": TABLE.replace(",", ";"),
    "tabs": TABLE.replace(",", "\t"),
    "decimal commas": TABLE.replace(",", ";").replace(".", ","),
    "no header": TABLE.partition("\n")[2],
    "units below": TABLE.replace("level\n", "level\ns,%,degC\n"),
    "units beside": TABLE.replace("time,valve,level", "Time [s],Valve (%),level"),
    "empty": "",
    "blank lines": TABLE.replace("\n", "\n\n"),
    "missing": TABLE.replace("21.5", "Bad").replace("23\n", "\n"),
    "word": TABLE.replace("21.5", "hello"),
    "short row": TABLE.replace("3,47,21.5", "3,47"),
    "words alone": "a,b,c\nd,e,f\n",
    "clock": "".join(f"10:00:0{i},{40 + 7 * (i > 2)},{20 + i * (i > 3)}\n" for i in range(10)),
    "dates": "t,u,y\n"
    + "".join(f"2024-03-01 23:59:{50 + i},{40 + 7 * (i > 2)},{20 + i}\n" for i in range(9)),
    "past midnight": "t,u,y\n"
    + "".join(f"01/02/2024 23:59:5{i},40,20\n" for i in range(9))
    + "".join(f"02/02/2024 00:00:0{i},47,{20 + i}\n" for i in range(5)),
    "dates and status": "t;state;u;y\n"
    + "".join(f"2024-03-01T10:00:{10 + i}Z;Good;4{i % 2},0;2{i},5\n" for i in range(9)),
    "twice": TABLE.replace("valve", "level"),
    "last wins": TABLE + "7,47,1e999\n",
}


def files():
    """Files of records, by names and by numbers of columns."""
    asked = {}
    for name, text in FILES.items():
        for columns in (
            (0, 1, 2),
            ("time", "valve", "level"),
            ("Time", "valve", "LEVEL"),
            ("t", "u", "y"),
            (0, 1, 9),
        ):
            asked[f"file: {name}, {columns}"] = lambda text=text, columns=columns: _read(text, columns)
        asked[f"file: {name}, told"] = lambda text=text: _read(text, (0, 1, 2), ";", ",")
    asked["file: latin"] = lambda: _read(
        TABLE.replace("level", "H\xf6he").encode("latin-1"), (0, 1, "H\xf6he")
    )
    asked["file: byte order mark"] = lambda: _read(TABLE.encode("utf-8-sig"), ("time", "valve", "level"))
    t = np.linspace(0.0, 50.0, 101)
    u, y = np.where(t > 9.9, 2.0, 1.0), np.where(t > 12.0, 1 - np.exp(-np.maximum(t - 12.0, 0.0) / 4), 0.0)
    for i, given in enumerate(
        (
            (t, u, y[:-1]),
            (t, u, y, 60.0),
            (t, u, y, 5.0),
            (t[:3], u[:3], y[:3]),
            (t[:2], u[:2], y[:2]),
            (t, u, "a"),
            (t, 0 * u, y),
            (t, u, 0 * y),
            ([1, 2], [3, 4], [[1]]),
            (0 * t, u, y),
        )
    ):
        asked[f"record, edge {i}"] = lambda given=given: (
            lambda r: (str(r), repr(r), r.doubts, r.after_step())
        )(Record(*given))
    for i, call in enumerate(
        (
            lambda: identification.three_point(t),
            lambda: identification.three_point(Record(t, u, y), y),
            lambda: identification.three_point(t, y, 0.0),
            lambda: identification.three_point(t[:29], y[:29]),
            lambda: identification.three_point(t[:30], y[:30]),
            lambda: identification.three_point(t, y, levels=(0.1, 0.1, 0.5)),
            lambda: identification.three_point(t, y, levels=(0.1, 0.5)),
            lambda: identification.three_point(t, 0 * y),
            lambda: identification.three_point(t, y + 0.11 * (np.abs(t - 25) < 1)),
            lambda: identification.three_point(t, y + 0.09 * (np.abs(t - 25) < 1)),
            lambda: identification.three_point(t, 1 - np.exp(-t)),
            lambda: identification.three_point(t, y, crossing="near"),
            lambda: identification.ipdt_tangent(t, y, span=0.2),
            lambda: identification.ipdt_tangent(t, y, span=0.25),
            lambda: identification.ipdt_tangent(t, y, span=50.0),
            lambda: identification.ipdt_tangent(t, y, span=51.0),
            lambda: identification.ipdt_tangent(t, y - y[-1] * (t == 0)),
            lambda: identification.ipdt_tangent(t, t),
            lambda: identification.ipdt_tangent(t, 1 - np.exp(-t)),
            lambda: identification.ipdt_least_squares(t, y, rise=1.0),
            lambda: identification.ipdt_least_squares(t, y, rise=0.99),
            lambda: identification.ipdt_least_squares(t[:4], t[:4]),
            lambda: identification.ipdt_least_squares(t[:5], t[:5]),
            lambda: identification.ipdt_least_squares(t, 0 * t),
            lambda: identification.binomial_filtered(t, y, 0.0, 1),
            lambda: identification.binomial_filtered(t, y, 1.0, 0),
            lambda: identification.binomial_filtered(t, y, 1.0, 1),
            lambda: identification.fit(Record(t, u, y), "other"),
            lambda: identification.fit(Record(t, 0 * u, y)),
            lambda: _fitted(identification.fit(Record(t, u, y))),
            lambda: _fitted(identification.fit(Record(t, u, y + 0.02 * np.sin(t**1.7)), "ipdt")),
            lambda: _fitted(identification.fit(Record(t, u, y + 0.3 * np.sin(t**1.7)), "sopdt")),
            lambda: areas.from_record(t, u, y, 5),
            lambda: areas.from_record(t, u, y, 1),
            lambda: areas.from_record(t, u, y, 0),
            lambda: areas.from_record(t, u, y),
            lambda: areas.from_record(t, u),
            lambda: areas.from_record(Record(t, u, y), u),
            lambda: areas.from_record(t, u, y, 3, (1.0, 0.0)),
            lambda: areas.from_record(t, u, y, 3, (0.9, 0.1)),
            lambda: areas.from_record(t, u, y, 3, settled_from=30.0),
            lambda: areas.from_record(t, u, y, 3, settled_from=49.9),
            lambda: areas.from_record(t, u, y, 3, settled_from=50.1),
            lambda: areas.from_record(t, u, y, 3, settled_from=5.0),
            lambda: areas.from_record(t, u, y, 3, between="other"),
            lambda: areas.from_record(t[:45], u[:45], y[:45], 3),
            lambda: areas.from_record(t, u, y + 0.05 * np.sin(t**1.7), 4),
            lambda: areas.from_record(t, u, y + 0.001 * t, 3),
            lambda: areas.from_record(t, 0 * t, y, 3),
            lambda: (lambda a: (a.gain, a.uncertainty))(
                areas.from_record(t, u, y + 0.01 * np.sin(t**1.7), 3)
            ),
            lambda: designed(magnitude_optimum.tune(areas.from_record(t, u, y, 5), 1, 2, 0.3)),
            lambda: designed(
                magnitude_optimum.tune(areas.from_record(t, u, y + 0.02 * np.sin(t**1.7), 5), 1, 2, 0.3)
            ),
            lambda: designed(magnitude_optimum.tune(areas.from_record(t, u, y, 3), 2, 3, 0.3)),
            lambda: areas.with_filter([1.0, 2.0, 3.0], control.tf([1.0], [0.5, 1.0])),
            lambda: areas.with_filter([1.0, 2.0, 3.0], control.tf([1.0], [0.5, -1.0])),
            lambda: areas.from_process(FIRST, 0),
            lambda: areas.exact(FIRST, 3),
        )
    ):
        asked[f"data, edge {i}"] = call
    return asked


def moving():
    """Records whose input moves: a pulse, many steps, more samples than a fit looks at."""
    asked = {}
    t = np.linspace(0.0, 60.0, 601)
    step = pidalab.open_loop_step(pidalab.sopdt(1.3, 2.0, 0.8, 1.0), t).y
    wave = 0.01 * np.sin(t**1.7)
    inputs = {
        "pulse": np.where((t > 5) & (t < 15), 1.0, 0.0),
        "two steps": np.where(t > 5, 1.0, 0.0) + np.where(t > 30, 0.5, 0.0),
        "many": np.sign(np.sin(0.35 * t)) * (t > 4) + np.sign(np.sin(0.9 * t)),
        "ramp": np.minimum(t, 20.0),
    }
    for name, u in inputs.items():
        y = 3.0 + np.convolve(np.diff(u, prepend=u[0]), step)[: t.size] + wave
        asked[f"moving: {name}"] = lambda u=u, y=y: _fitted(identification.fit(Record(t, u, y), "sopdt"))
        asked[f"moving, read: {name}"] = lambda u=u, y=y: (
            lambda r: (str(r), r.steps, r.doubts, r.uniform(), r.spectrum())
        )(Record(t, u, y))
        asked[f"moving, areas: {name}"] = lambda u=u, y=y: areas.from_record(t, u, y, 3)
    long = np.linspace(0.0, 80.0, 9001)
    y = pidalab.open_loop_step(pidalab.fopdt(1.3, 5.0, 1.0), np.linspace(0.0, 72.0, 8101)).y
    y = np.concatenate([np.zeros(900), y]) + 0.01 * np.sin(long**1.7)
    asked["moving: long"] = lambda: _fitted(
        identification.fit(Record(long, np.where(long >= long[900], 1.0, 0.0), y), "fopdt")
    )
    return asked


def _read(text, columns, *more):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "record.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        record = Record.read_csv(path, *columns, *more)
        return record.t - record.t[0], record.u, record.y, record.doubts


def _fitted(fit):
    return str(fit), fit.process, dict(fit.uncertainty), fit.deviation
