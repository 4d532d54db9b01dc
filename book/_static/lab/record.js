/* Read a plant record from text, as the library does, and fit a model to it by least squares. */
(globalThis.pidalabScripts ??= []).push(function () {
  "use strict";
  const { respond } = globalThis.pidalabEngine;
  const { ownPlant } = globalThis.pidalabModel;

  const MISSING = /^(|nan|na|n\/a|null|none|-|bad|bad input|no data|#n\/a|\?)$/i;

  const MARKS = [";", "\t", ",", "|", /\s+/];
  const LONGEST_LINE = 20000, LONGEST_ENTRY = 60, LOOKED_AT = 100; // characters of a line and of an entry; rows inspected at both ends

  /* Return a time or a date in seconds, or NaN. */
  function stamp(text) {
    const clock = /^(\d+):(\d\d):(\d\d(?:\.\d+)?)$/.exec(text), day = /^(\d\d?)\.(\d\d?)\.(\d{4})[ T](.*)$/.exec(text);
    if (!/\d[:.-]\d/.test(text)) return NaN;
    if (clock) return 3600 * clock[1] + 60 * clock[2] + Number(clock[3]);
    const iso = day ? `${day[3]}-${day[2].padStart(2, "0")}-${day[1].padStart(2, "0")}T${day[4]}Z` : text.replace(" ", "T");
    return Date.parse(iso) / 1000;
  }

  /* Return an entry as a number, NaN if it is missing, or undefined if it is neither. A comma is a decimal comma unless commas
     separate the columns. */
  function number(entry, comma) {
    if (entry.length > LONGEST_ENTRY) return undefined;
    const plain = entry.replace(/["']/g, "").trim();
    if (MISSING.test(plain)) return NaN;
    const found = Number(comma ? plain.replace(/\.(?=.*,)/g, "").replace(",", ".") : plain);
    if (!Number.isNaN(found)) return found;
    const time = stamp(plain.replace(/(:\d\d),(\d)/, "$1.$2"));
    return Number.isNaN(time) ? undefined : time;
  }

  /* Return the rows of a table and the names of its columns. The separator is the mark that gives the most columns of numbers
     and the fewest other columns. The names are in the last line of words above the numbers. */
  function table(lines) {
    const long = lines.find((line) => line.length > LONGEST_LINE);
    if (long) throw new RangeError(`a line has ${long.length} characters; a record has at most ${LONGEST_LINE} in each`);
    const cut = (mark) => (line) => line.trim().split(mark).map((entry) => number(entry, mark !== ","));
    const ends = lines.length > 2 * LOOKED_AT ? [...lines.slice(0, LOOKED_AT), ...lines.slice(-LOOKED_AT)] : lines, tables = MARKS.map((mark) => ends.map(cut(mark)));
    const worth = (rows) => {
      const last = rows.slice(-50), width = Math.max(...last.map((row) => row.length));
      const full = Array.from({ length: width }, (_, k) => last.filter((row) => row[k] !== undefined).length > last.length / 2);
      return full.filter(Boolean).length ** 2 / width;
    };
    const mark = MARKS[tables.indexOf(tables.reduce((best, rows) => (worth(rows) > worth(best) ? rows : best)))], best = lines.map(cut(mark)), first = best.findIndex((row) => row.some(Number.isFinite));
    const words = first > 0 ? lines[first - 1].trim().split(mark).map((word) => word.replace(/["']/g, "").trim()) : [];
    const width = best[Math.max(first, 0)].length;
    return { rows: best, names: words.length === width ? words : Array.from({ length: width }, (_, k) => `column ${k + 1}`), named: words.length === width };
  }

  /* Return times, inputs and outputs from the chosen columns, by default the first three. Two columns are
     time and output, after a unit step of the input at the first time. Rows with a missing value are left out, times are sorted, and values at
     equal times are averaged. */
  function readRecord(text, chosen = [0, 1, 2]) {
    const lines = text.split(/\r?\n/).filter((line) => line.trim() && !line.startsWith("#"));
    if (!lines.length) throw new RangeError("the file is empty");
    const { rows, names, named } = table(lines), wide = rows.filter((row) => row.length > 2).length > rows.length / 2 ? 3 : 2;
    const columns = chosen.slice(0, wide);
    const usable = rows.map((row) => columns.map((k) => row[k])).filter((row) => row.every(Number.isFinite));
    if (usable.length < 10) throw new RangeError(`the file needs ten rows of numbers or more (time, output; or time, input, output), found ${usable.length}`);
    usable.sort((a, b) => a[0] - b[0]);
    const t = [], u = [], y = [];
    for (let k = 0, next; k < usable.length; k = next) {
      for (next = k; next < usable.length && usable[next][0] === usable[k][0];) next++;
      const same = usable.slice(k, next);
      t.push(usable[k][0] - usable[0][0]);
      u.push(wide > 2 ? same[same.length - 1][1] : 1);
      y.push(same.reduce((sum, row) => sum + row[wide - 1], 0) / same.length);
    }
    if (t.length < 10) throw new RangeError("the times do not rise");
    for (const [name, signal] of [["input", wide > 2 ? u : [0, 1]], ["output", y]]) if (signal.every((x) => x === signal[0])) throw new RangeError(`the ${name} never changes`);
    return { t, u, y, columns, names, named, missing: lines.length - usable.length - Math.max(rows.findIndex((row) => row.some(Number.isFinite)), 0) };
  }

  /* Minimise by the simplex method of Nelder and Mead. */
  function simplex(f, start, size, turns = 250) {
    let points = [start, ...start.map((_, j) => start.map((v, k) => v + (j === k ? size : 0)))].map((x) => ({ x, f: f(x) }));
    for (let turn = 0; turn < turns; turn++) {
      points.sort((a, b) => a.f - b.f);
      const worst = points[points.length - 1], rest = points.slice(0, -1), middle = start.map((_, k) => rest.reduce((sum, p) => sum + p.x[k], 0) / rest.length);
      if (worst.f - points[0].f < 1e-10 * Math.abs(points[0].f)) break;
      const toward = (share) => { const x = middle.map((v, k) => v + share * (worst.x[k] - v)); return { x, f: f(x) }; };
      let better = toward(-1);
      if (better.f < points[0].f) { const far = toward(-2); if (far.f < better.f) better = far; } else if (better.f >= rest[rest.length - 1].f) better = toward(better.f < worst.f ? -0.5 : 0.5);
      points = better.f < worst.f ? [...rest, better] : points.map((p) => { const x = p.x.map((v, k) => (v + points[0].x[k]) / 2); return { x, f: f(x) }; });
    }
    return points.sort((a, b) => a.f - b.f)[0];
  }

  const MOST = 800; // largest number of samples of a fit
  const NEGLIGIBLE = 2e-3; // a lag or dead time below this share of the sum of all times is left out
  const share = (x) => 1 / (1 + Math.exp(-x));
  /* List model structures, the simplest first, so that noise does not add lags. The unknowns are unbounded: logarithms of times,
     and a share or a damping. */
  const STRUCTURES = [
    { name: "a lag and a dead time", from: [], own: ([t]) => ({ t1: Math.exp(t), t2: 0, t3: 0, damping: 1, integrating: false }) },
    { name: "lags and a dead time", from: [0, -1], own: ([t, s, r]) => ({ t1: Math.exp(t), t2: Math.exp(t) * share(s), t3: Math.exp(t) * share(s) * share(r), damping: 1, integrating: false }) },
    { name: "an integrator, a lag and a dead time", from: [], own: ([t]) => ({ t1: Math.exp(t), t2: 0, t3: 0, damping: 1, integrating: true }) },
    { name: "an oscillating pair and a dead time", from: [0], own: ([t, s]) => ({ t1: Math.exp(t), t2: 0, t3: 0, damping: 0.02 + 0.97 * share(s), integrating: false }) },
  ];

  /* Return the least-squares model. A structure is preferred to a simpler one only if it reduces the residual by a tenth. Gain and
     rest level follow by linear regression, dead time and time constants by a search from several starts. */
  function fit({ t, u, y }) {
    const span = t[t.length - 1], steps = t.slice(1).map((x, k) => x - t[k]).sort((a, b) => a - b), h = Math.max(steps[steps.length >> 1], span / MOST);
    const grid = Array.from({ length: Math.floor(span / h + 1e-9) + 1 }, (_, k) => k * h), input = [], output = [];
    for (let k = 0, i = 0; k < grid.length; k++) {
      while (i + 1 < t.length && t[i + 1] <= grid[k] + 1e-6 * h) i++;
      const next = Math.min(i + 1, t.length - 1), part = next > i ? (grid[k] - t[i]) / (t[next] - t[i]) : 0;
      input.push(u[i]);
      output.push(y[i] + part * (y[next] - y[i]));
    }
    const start = u.every((x) => x === u[0]) ? 0 : u[0], moved = input.map((x) => x - start);
    const made = (structure, x) => ({ zero: 0, gain: 1, ...structure.own(x), delay: Math.exp(x[x.length - 1]) });
    const judged = (own) => {
      const z = respond(ownPlant(own), moved, h), n = z.length;
      let sz = 0, sy = 0, szz = 0, szy = 0, rest = 0;
      for (let k = 0; k < n; k++) { sz += z[k]; sy += output[k]; szz += z[k] * z[k]; szy += z[k] * output[k]; }
      const gain = (n * szy - sz * sy) / (n * szz - sz * sz), level = (sy - gain * sz) / n;
      const fitted = z.map((value) => level + gain * value);
      for (let k = 0; k < n; k++) rest += (output[k] - fitted[k]) ** 2;
      return { rest: Number.isFinite(rest) ? rest : Infinity, gain, fitted, own: { ...own, gain } };
    };
    let best = null;
    for (const structure of STRUCTURES) {
      const cost = (x) => (x.some((v) => Math.abs(v) > 30) || x[0] > Math.log(10 * span) || x[x.length - 1] > Math.log(0.7 * span) ? Infinity : judged(made(structure, x)).rest);
      const starts = [0.02, 0.06, 0.2].flatMap((a) => [0.003, 0.03, 0.1].map((d) => [Math.log(a * span), ...structure.from, Math.log(d * span)]));
      const ends = starts.map((x) => ({ x, f: cost(x) })).sort((a, b) => a.f - b.f).slice(0, 2).map(({ x }) => simplex(cost, simplex(cost, x, 0.5).x, 0.1));
      const found = { ...judged(made(structure, (ends[0].f < ends[1].f ? ends[0] : ends[1]).x)), structure };
      if (!best || found.rest < 0.9 * best.rest) best = found;
    }
    if (!Number.isFinite(best.rest)) throw new RangeError("no model fits this record");
    // Leave out a lag or a dead time that is too short for the samples.
    const together = best.own.t1 + best.own.t2 + best.own.t3 + best.own.delay;
    for (const lag of [...(best.own.integrating ? ["t1"] : []), "t2", "t3", "delay"]) if (best.own[lag] < NEGLIGIBLE * together) best.own[lag] = 0;
    const whole = output.reduce((sum, value) => sum + value, 0) / output.length, total = output.reduce((sum, value) => sum + (value - whole) ** 2, 0);
    return { own: best.own, name: best.structure.name, t: grid, fitted: Array.from(best.fitted), sigma: Math.sqrt(best.rest / output.length), explained: 1 - best.rest / total, span: Math.max(...moved) - Math.min(...moved, 0), h };
  }

  globalThis.pidalabRecord = { readRecord, fit };
});
globalThis.pidalabScripts.at(-1)();
