/* The lab: every <div class="pidalab-lab"> of a page becomes a place to design in. State lives in one object, which is
   also what the page's address and the exported file hold; whatever changes it draws everything anew. */
(function () {
  "use strict";
  const { PLANTS, RULES, ORDER, ownPlant, controller, study, write, read } = globalThis.pidalabModel;
  const plot = globalThis.pidalabPlot;

  const START = {
    plant: "lags3", own: { gain: 1, t1: 1, t2: 1, t3: 1, damping: 1, zero: 0, delay: 1, integrating: false },
    given: null, record: null,
    design: { kind: "PIDA", kp: 0.87, ti: 3, td: 1, ta: 0.333, filterTime: 0.1, filterOrder: 3 },
    rule: "cancellation", ms: 1.4, tc: 1,
    limited: false, low: -1, high: 3, antiWindup: "clamping", sampled: false, sampleTime: 0.1, noisy: false, noise: 0.02,
    kept: [],
  };
  const MOST_KEPT = 4;

  // --- small parts of the page --------------------------------------------------------------------------------------

  function element(name, attributes = {}, ...children) {
    const made = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) {
      if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
      else if (value === true) made.setAttribute(key, "");
      else if (value !== false && value != null) made.setAttribute(key, value);
    }
    made.append(...children);
    return made;
  }

  const digits = (value, count = 3) =>
    Number.isFinite(value) ? String(Number(value.toPrecision(count))) : value === Infinity ? "∞" : "–";

  let names = 0;

  /* A slider and a number for one value: the number takes any value, the slider the usual ones, three digits of them:
     a step must show in these, or a key would move the slider and leave the value. */
  function slider({ label, help, low, high, log, step, get, set }) {
    const id = `lab-input-${++names}`;
    const to = log ? (x) => Math.log10(Math.max(x, low)) : (x) => x, from = log ? (x) => Math.pow(10, x) : (x) => x;
    const bar = element("input", {
      type: "range", id, min: to(low), max: to(high), step: step ?? (to(high) - to(low)) / 200,
      oninput: () => set(Number(from(Number(bar.value)).toPrecision(3))),
    });
    const box = element("input", {
      type: "number", step: "any", "aria-label": `${label}, number`,
      onchange: () => { if (Number.isFinite(box.valueAsNumber)) set(box.valueAsNumber); },
    });
    const row = element("div", { class: "lab-row", title: help }, element("label", { for: id }, label), bar, box);
    let known, stood, text; // what the row shows: most of them rest while one is dragged
    row.refresh = () => {
      const value = get();
      if (value !== known) {
        text = digits(value, 4);
        bar.setAttribute("aria-valuetext", `${label} ${digits(value)}`);
      }
      if (value !== known || bar.value !== stood) bar.value = to(value);
      if (document.activeElement !== box && box.value !== text) box.value = text;
      [known, stood] = [value, bar.value];
    };
    return row;
  }

  function choice({ label, options, get, set }) {
    const id = `lab-input-${++names}`;
    const box = element("select", { id, onchange: () => set(box.value) },
      ...options.map(([value, text]) => element("option", { value }, text)));
    const row = element("div", { class: "lab-row lab-choice" }, element("label", { for: id }, label), box);
    row.refresh = () => { if (box.value !== get()) box.value = get(); };
    return row;
  }

  function tick({ label, get, set }) {
    const id = `lab-input-${++names}`, box = element("input", { type: "checkbox", id, onchange: () => set(box.checked) });
    const row = element("div", { class: "lab-tick-row" }, box, element("label", { for: id }, label));
    row.refresh = () => { box.checked = get(); };
    return row;
  }

  const button = (text, onclick) => element("button", { type: "button", class: "lab-button", onclick }, text);

  // --- a step record ------------------------------------------------------------------------------------------------

  /* Numbers of a line; between semicolons or tabs a comma is a decimal one. A clock or a date is no number. */
  const numbersOf = (line) => (/[;\t]/.test(line) ? line.replace(/,/g, ".").split(/[;\t]/) : line.split(",")).map(
    (entry) => Number(entry.replace(/"/g, "").trim() || NaN));

  /* Times and outputs of a step: the first two columns of a file with commas, semicolons or tabs, or the first and the third
     of three (t, u, y). */
  function readRecord(text) {
    const rows = text.split(/\r?\n/).map(numbersOf).filter((row) => row.length >= 2 && row.every(Number.isFinite));
    if (rows.length < 10) throw new RangeError(`the file needs ten rows of numbers or more (time, output; or time, input, output), found ${rows.length}`);
    const back = rows.findIndex((row, k) => k && !(row[0] > rows[k - 1][0]));
    if (back > 0) throw new RangeError(`times must rise, found ${rows[back][0]} after ${rows[back - 1][0]}`);
    const three = rows[0].length > 2;
    let start = 0, size = 1;
    if (three) {
      start = rows.findIndex((row, k) => k && row[1] !== rows[k - 1][1]);
      if (start < 0) throw new RangeError("the input, the second of three columns, does not step");
      size = rows[rows.length - 1][1] - rows[Math.max(start - 1, 0)][1];
      if (!size) throw new RangeError("the input, the second of three columns, ends where it began");
    }
    const rest = rows.slice(0, Math.max(start, 1)), column = three ? 2 : 1;
    const level = rest.reduce((sum, row) => sum + row[column], 0) / rest.length;
    const t = [], y = [];
    for (const row of rows.slice(Math.max(start, 0))) { t.push(row[0] - rows[start][0]); y.push((row[column] - level) / size); }
    return { t, y };
  }

  /* Three points of the record give three lags and a dead time (haalman2024, eq. (5), levels 5, 35.3 and 85.3 %). */
  function threePoint({ t, y }) {
    const tail = y.slice(-Math.max(3, Math.floor(y.length / 20)));
    const gain = tail.reduce((sum, value) => sum + value, 0) / tail.length;
    const at = (level) => {
      const k = y.findIndex((value) => value / gain >= level);
      if (k < 1) throw new RangeError(`the record does not rise through ${100 * level} % of its change`);
      return t[k - 1] + ((level * gain - y[k - 1]) / (y[k] - y[k - 1])) * (t[k] - t[k - 1]);
    };
    const t5 = at(0.05), t35 = at(0.353), t85 = at(0.853);
    const apparent = 1.3 * t35 - 0.29 * t85, tau = 0.67 * (t85 - t35);
    if (!(apparent > 0 && tau > 0 && t5 > 0)) throw new RangeError("three points of the record give no three lags and a dead time: it rises too early or too late");
    const alpha = 0.598 + 0.4799 * (t5 / apparent) - 0.41 * Math.pow(tau / t5, 0.6);
    if (!(alpha >= 0 && alpha <= 1)) throw new RangeError(`y does not fit a third-order model with dead time: alpha = ${digits(alpha, 4)} is outside [0, 1] (below 0 the response is too sluggish at first, above 1 too sudden)`);
    const own = { t1: tau, t2: ((1 - alpha) * apparent) / 2, t3: ((1 - alpha) * apparent) / 2 };
    return { gain, ...own, damping: 1, zero: 0, delay: alpha * apparent, integrating: false };
  }

  // --- the plots ----------------------------------------------------------------------------------------------------

  /* The control signal has more times than the output where derivatives kick. */
  const signals = (s, key, which) => (key === "u" && s[which].fine) || s[which];

  const made = new WeakMap(); // of what the engine found, what was made of it for a plot

  function once(source, key, make) {
    if (!made.has(source)) made.set(source, {});
    return (made.get(source)[key] ??= make());
  }

  /* Least and largest value, 0 among them. */
  function extent(values) {
    let low = 0, high = 0;
    for (let k = 0; k < values.length; k++) {
      if (values[k] < low) low = values[k]; // what is no number any more says nothing
      if (values[k] > high) high = values[k];
    }
    return [Math.max(low, -50), Math.min(high, 50)];
  }

  /* Range of a signal of all runs, from 0, in which an unstable loop does not squeeze the others. */
  function rangeOf(shown, key, which) {
    const calm = shown.filter((s) => s.stable);
    let low = 0, high = 0;
    for (const s of calm.length ? calm : shown) {
      const run = signals(s, key, which);
      const [least, most] = once(run, `range of ${key}`, () => extent(run[key]));
      [low, high] = [Math.min(low, least), Math.max(high, most)];
    }
    return [low - 0.06 * (high - low || 1), high + 0.06 * (high - low || 1)];
  }

  /* A signal until the end of the axis. */
  const until = (run, key, end) => once(run, `${key} until ${end}`, () => {
    let count = run.t.length;
    while (count > 1 && run.t[count - 2] > end) count--;
    return { x: run.t.subarray(0, count), y: run[key].subarray(0, count) };
  });

  /* A function of the curve, to the edge of the frame, which cuts it. */
  const along = (curve, name, [low, high], f) => once(curve, `${name} from ${low} to ${high}`, () => {
    const x = [], y = [];
    curve.w.forEach((w, k) => { if (w > 0.8 * low && w < 1.25 * high) { x.push(w); y.push(f(curve, k)); } });
    return { x, y };
  });

  /* Draw what there is a place for: places is an object of elements by the name of the plot. */
  function drawPlots(places, process, shown, { ms, record }) {
    const end = process.end;
    const run = (key, which, share = 1) => ({
      x: { label: "time", range: [0, end * share] }, y: { around: rangeOf(shown, key, which) },
      lines: shown.map((s) => ({ ...until(signals(s, key, which), key, end * share), kind: s.kind, stairs: s.stairs && key === "u" })),
    });
    const bode = { label: "frequency, rad per time", log: true, range: [0.8 / end, 16000 / end] };
    const over = (name, f) => shown.map((s) => ({ ...along(s.curve, name, bode.range, f), kind: s.kind }));
    const turn = Array.from({ length: 91 }, (_, k) => (2 * Math.PI * k) / 90);
    const circle = (radius, middle = 0) => ({ x: turn.map((a) => middle + radius * Math.cos(a)), y: turn.map((a) => radius * Math.sin(a)), kind: "mark" });
    const around = (Array.isArray(ms) ? ms : [ms]).filter(Number.isFinite);
    const PLOTS = {
      setpoint: () => ({ title: "Output y, step of the set point", ...run("y", "setpoint") }),
      load: () => ({ title: "Output y, step of the load", ...run("y", "load") }),
      control: () => ({ title: "Control signal u, step of the set point", ...run("u", "setpoint", shown.some((s) => s.limited) ? 1 : 1 / 3) }),
      effort: () => ({ title: "Control signal u, step of the load", ...run("u", "load") }),
      nyquist: () => ({
        title: "Nyquist curve, unit circle, circle 1/Ms", x: { label: "real part", range: [-2.4, 0.8] }, y: { range: [-1.3, 1.3] }, equal: true,
        lines: [...around.map((each) => circle(1 / each, -1)), circle(1), { x: [-1.05, -0.95], y: [0, 0], kind: "mark" }, { x: [-1, -1], y: [-0.05, 0.05], kind: "mark" }, ...shown.map((s) => ({ x: s.curve.re, y: s.curve.im, kind: s.kind }))],
      }),
      bode: () => ({
        title: "Loop gain |L|", x: bode, y: { log: true, range: [1e-3, 1e2] },
        lines: [{ x: bode.range, y: [1, 1], kind: "mark" }, ...over("loop", (c, k) => Math.hypot(c.re[k], c.im[k]))],
      }),
      closed: () => ({
        title: "From set point to output: |T|", x: { ...bode, range: [bode.range[0], bode.range[1] / 50] }, y: { range: [0, 1.5] },
        lines: [{ x: bode.range, y: [1, 1], kind: "mark" }, ...over("closed", (c, k) => Math.hypot(c.re[k], c.im[k]) / Math.hypot(1 + c.re[k], c.im[k]))],
      }),
      lead: () => ({ title: "Phase of the controller, degrees", x: bode, y: { range: [-95, 185] }, lines: [{ x: bode.range, y: [0, 0], kind: "mark" }, ...over("lead", (c, k) => c.lead[k])] }),
      noise: () => ({ title: "From measurement noise to u: |C S|", x: bode, y: { log: true }, lines: over("noise", (c, k) => c.control[k] / Math.hypot(1 + c.re[k], c.im[k])) }),
    };
    for (const [key, place] of Object.entries(places)) {
      const picture = PLOTS[key]();
      if (record && key === "setpoint") picture.lines.unshift({ x: record.t, y: record.y, kind: "dots" });
      plot(place, picture);
    }
  }

  /* What a table may show of a design: a name, the number, and whether an unstable loop has it, too. */
  const degrees = (radians) => (radians * 180) / Math.PI;
  const NUMBERS = {
    iae: ["IAE load", (s) => s.iae], iaeSetpoint: ["IAE set point", (s) => s.iaeSetpoint], ms: ["Ms", (s) => s.ms], mks: ["mks", (s) => s.mks],
    gm: ["gain margin", (s) => s.gm], pm: ["phase margin, °", (s) => s.pm], dm: ["delay margin", (s) => s.dm],
    peak: ["peak of u", (s) => s.peak], overshoot: ["overshoot, %", (s) => s.overshoot],
    sigma: ["σ(u) per σ(n)", (s) => s.sigma],
    gmLeast: ["at least Ms/(Ms−1)", (s) => s.ms / (s.ms - 1)], pmLeast: ["at least 2 asin 1/(2Ms), °", (s) => degrees(2 * Math.asin(0.5 / s.ms))],
    first: ["phase margin at the first crossover, °", (s) => s.beyond().first, true], hump: ["top of |L| beyond it", (s) => s.beyond().hump, true],
  };

  const OVER_FREQUENCY = ["nyquist", "bode", "closed", "lead", "noise"];

  /* Above a table: what noise is meant, and that curves over frequency know no sampling, where these are shown. */
  function captionOf(shown, numbers, plots) {
    const curves = shown.some((s) => s.stairs) && plots.some((key) => OVER_FREQUENCY.includes(key));
    const words = [...(numbers.includes("sigma") ? [noiseMeant(shown)] : []), ...(curves ? ["curves over frequency: the controller before it is sampled"] : [])];
    return words.length ? [["caption", {}, words.join("; ")]] : [];
  }

  /* What is said in the place of margins. */
  const verdict = (s) => (s.unknown ? "too slow for its sample time to tell whether it is stable" : "unstable");

  /* The head of a column; a formula may break at its fraction bar. */
  const heading = (text) => ["th", { scope: "col" }, ...text.split(/(?<=\/)/).flatMap((part, k) => (k ? [["wbr", {}], part] : part))];

  /* What noise the σ(u) of a table are of: a filter faster than the usual sample takes a sample time of its own. */
  function noiseMeant(shown) {
    const times = shown.map((s) => digits(s.sampleTime)), same = times.every((time) => time === times[0]);
    const none = shown.some((s) => s.stable && Number.isNaN(s.sigma)) ? "; – where the plant answers within a sample" : "";
    return `σ(u): white noise of standard deviation 1, a sample every ${same ? times[0] ?? "–" : `${times.join(", ")} (row by row)`}${none}`;
  }

  const COLUMNS = ["iae", "iaeSetpoint", "ms", "mks", "gm", "pm", "dm", "peak", "overshoot", "sigma"]; // of the lab's table

  /* A state from outside, if the lab can show it at all; of single numbers the engine judges. */
  function checked(state) {
    const { design, kept = [], given } = state, of = (kind) => Object.hasOwn(ORDER, kind);
    if (typeof state !== "object" || Array.isArray(state)) throw new RangeError("it holds no state of the lab");
    if (design?.kind !== undefined && !of(design.kind)) throw new RangeError(`there is no controller ${design.kind}`);
    if (!Array.isArray(kept) || !kept.every((each) => of(each?.kind))) throw new RangeError("its kept designs are none");
    if (given && !(given.end > 0 && Array.isArray(given.num) && Array.isArray(given.den))) throw new RangeError("its plant lacks num, den or end");
    return state;
  }

  // --- one lab ------------------------------------------------------------------------------------------------------

  class Lab {
    constructor(host) {
      this.host = host;
      this.startAnew();
      this.hear();
      this.build();
      this.change({});
      addEventListener("hashchange", () => { this.hear(); this.change({}, false); });
    }

    startAnew() {
      this.state = structuredClone(START);
      this.takeOver(this.host.dataset.state ? JSON.parse(this.host.dataset.state) : null);
    }

    /* Take over what the address holds: what it leaves out is as in a page that was just opened. */
    hear() {
      this.heard = location.hash;
      let given = null;
      try {
        given = document.getElementById(this.heard.slice(1)) ? null : read(this.heard);
        if (given === null) return;
        checked(given);
      } catch (error) {
        given = null;
        this.say(`The link is damaged: ${error.message}.`);
      }
      this.startAnew();
      this.takeOver(given);
    }

    /* Take over what is given of a state; a design without a rule is one by hand. */
    takeOver(given) {
      if (!given) return;
      Object.assign(this.state, given, { own: { ...this.state.own, ...given.own }, design: { ...this.state.design, ...given.design } });
      if (!given.rule && given.design) this.state.rule = "hand";
    }

    get process() {
      const { plant, own, given } = this.state;
      return plant === "own" ? ownPlant(own) : plant === "given" && given ? given : PLANTS[plant] ?? PLANTS.lags3;
    }

    get conditions() {
      const { limited, low, high, antiWindup, sampled, sampleTime, noisy, noise } = this.state;
      return { end: this.process.end, limits: limited ? [low, high] : null, antiWindup, sampleTime: sampled ? sampleTime : 0, noise: noisy ? noise : 0 };
    }

    /* Change the state, apply the rule, draw. */
    change(update, store = true) {
      Object.assign(this.state, update);
      const rule = RULES[this.state.rule] ?? RULES.hand;
      this.problem = "";
      try {
        this.state.design = rule.apply(this.process, this.state.design, this.state[rule.knob]);
      } catch (error) { this.problem = `${rule.name}: ${error.message}.`; }
      this.unsaved ||= store;
      if (!this.waiting) this.waiting = requestAnimationFrame(() => { this.waiting = 0; this.draw(); });
    }

    /* Put the state into the address, once the hand rests: a browser bears few changes of it in a second. Not over one that
       was given meanwhile, of which the browser is about to tell. */
    save() {
      if (!this.unsaved || location.hash !== this.heard) return;
      history.replaceState(null, "", `#${write(this.state)}`);
      this.heard = location.hash;
      this.unsaved = false;
    }

    byHand(update) { this.change({ rule: this.state.rule === "gain" && !("kp" in update) ? "gain" : "hand", design: { ...this.state.design, ...update } }); }

    build() {
      const own = (update) => this.change({ own: { ...this.state.own, ...update } });
      const ownValue = (label, key, low, high, log, help) =>
        slider({ label, help, low, high, log, get: () => this.state.own[key], set: (value) => own({ [key]: value }) });
      const value = (label, key, low, high, help) =>
        slider({ label, help, low, high, log: true, get: () => this.state.design[key], set: (x) => this.byHand({ [key]: x }) });

      this.ownRows = element("div", {},
        ownValue("gain", "gain", 0.1, 10, true), ownValue("lag T1", "t1", 0.01, 100, true),
        ownValue("lag T2", "t2", 0, 10, false), ownValue("lag T3", "t3", 0, 10, false),
        ownValue("damping", "damping", 0.05, 1, false, "below 1 the lags T1 and T2 become an oscillating pair with time T1"),
        ownValue("zero", "zero", -3, 3, false, "time constant of a zero, 1 + zero·s; negative: the wrong way first"),
        ownValue("dead time", "delay", 0, 10, false),
        tick({ label: "integrating", get: () => this.state.own.integrating, set: (x) => own({ integrating: x }) }));

      const file = element("input", { type: "file", accept: ".csv,.txt,.json,text/csv,text/plain,application/json", id: "lab-file", onchange: () => this.take(file.files[0]) });
      const drop = element("div", { class: "lab-drop" },
        element("label", { for: "lab-file" }, "A step record of your own (drop a CSV file: time, output, or time, input, output), or designs that were saved here (JSON): "), file);
      drop.addEventListener("dragover", (event) => event.preventDefault());
      drop.addEventListener("drop", (event) => { event.preventDefault(); this.take(event.dataTransfer.files[0]); });

      this.rows = [
        choice({
          label: "plant", options: [...Object.entries(PLANTS).map(([key, plant]) => [key, plant.name]), ["given", "the plant of the link"], ["own", "my own"]],
          get: () => this.state.plant, set: (plant) => this.change({ plant, record: plant === "own" ? this.state.record : null }),
        }),
        ...this.ownRows.children,
        choice({
          label: "controller", options: Object.keys(ORDER).map((kind) => [kind, kind]), get: () => this.state.design.kind,
          set: (kind) => this.change({ design: { ...this.state.design, kind, filterOrder: ORDER[kind] + 1 } }),
        }),
        choice({ label: "rule", options: Object.entries(RULES).map(([key, rule]) => [key, rule.name]), get: () => this.state.rule, set: (rule) => this.change({ rule }) }),
        this.msRow = slider({ label: "Ms", help: "largest sensitivity allowed", low: 1.1, high: 2.5, step: 0.01, get: () => this.state.ms, set: (ms) => this.change({ ms }) }),
        this.tcRow = slider({ label: "closed-loop time", low: 0.05, high: 20, log: true, get: () => this.state.tc, set: (tc) => this.change({ tc }) }),
        value("kp", "kp", 0.01, 100), value("ti", "ti", 0.05, 100),
        this.tdRow = value("td", "td", 0.005, 20), this.taRow = value("ta", "ta", 0.0005, 50, "acceleration: a squared time"),
        slider({ label: "filter time", low: 0.001, high: 10, log: true, get: () => this.state.design.filterTime, set: (x) => this.change({ design: { ...this.state.design, filterTime: x } }) }),
        slider({ label: "filter order", low: 1, high: 6, step: 1, get: () => this.state.design.filterOrder, set: (x) => this.change({ design: { ...this.state.design, filterOrder: Math.round(x) } }) }),
        tick({ label: "limits of the actuator", get: () => this.state.limited, set: (limited) => this.change({ limited }) }),
        this.lowRow = slider({ label: "lowest u", low: -10, high: 0, get: () => this.state.low, set: (low) => this.change({ low: Math.min(low, 0) }) }),
        this.highRow = slider({ label: "highest u", low: 0.1, high: 20, get: () => this.state.high, set: (high) => this.change({ high: Math.max(high, 0.01) }) }),
        this.windupRow = choice({ label: "anti-windup", options: [["none", "none"], ["clamping", "clamping"], ["conditioning", "conditioning"], ["reset", "automatic reset"]], get: () => this.state.antiWindup, set: (antiWindup) => this.change({ antiWindup }) }),
        tick({ label: "digital controller", get: () => this.state.sampled, set: (sampled) => this.change({ sampled }) }),
        this.sampleRow = slider({ label: "sample time", low: 0.005, high: 2, log: true, get: () => this.state.sampleTime, set: (sampleTime) => this.change({ sampleTime }) }),
        tick({ label: "measurement noise", get: () => this.state.noisy, set: (noisy) => this.change({ noisy }) }),
        this.noiseRow = slider({ label: "noise, ±", low: 0.001, high: 0.5, log: true, get: () => this.state.noise, set: (noise) => this.change({ noise }) }),
      ];
      const at = (label) => this.rows.findIndex((row) => row.querySelector("label").textContent === label);
      const part = (title, from, to, ...more) => element("fieldset", {}, element("legend", {}, title), ...this.rows.slice(from, to), ...more);
      const controllerAt = at("controller"), limitsAt = at("limits of the actuator");
      const plantPart = element("fieldset", {}, element("legend", {}, "Plant"), this.rows[0], this.ownRows, drop);
      const compare = element("fieldset", {}, element("legend", {}, "Side by side"), element("div", { class: "lab-actions" },
        button("PI, PID and PIDA by this rule", () => this.threeKinds()),
        button("Keep this design", () => this.keep([this.state.design])),
        button("Forget the kept ones", () => this.change({ kept: [] }))));
      const controls = element("div", { class: "lab-controls" }, plantPart, part("Controller", controllerAt, limitsAt), compare, part("Actuator, sampling, noise", limitsAt));

      this.plots = {};
      const plots = element("div", { class: "lab-plots" }, ...["setpoint", "load", "control", "nyquist", "bode", "noise"].map((key) => (this.plots[key] = element("div", {}))));
      this.table = element("div", { class: "lab-table", tabindex: 0, role: "region", "aria-label": "Numbers of the designs" });
      this.live = element("p", { class: "lab-live", role: "status" });
      this.out = element("pre", { class: "lab-out", hidden: true });
      this.saving = button("Save as a file", () => this.download());
      this.saving.hidden = true;
      const actions = element("div", { class: "lab-actions" },
        button("Copy a link", () => { this.save(); this.copy(location.href, "The link"); }),
        button("As a library call", () => this.show(this.call(), "pida_designs.py")),
        button("As JSON", () => this.show(JSON.stringify(this.exported(), null, 1), "pida_designs.json")),
        button("Start anew", () => { this.state = structuredClone(START); this.change({}); }));
      this.host.replaceChildren(element("div", { class: "lab-main" }, controls, element("div", { class: "lab-results" }, this.live, this.table, plots, actions, this.saving, this.out)));
      this.host.classList.add("lab-ready");
      document.body.classList.add("lab-page");
    }

    pick({ num, den, delay }) { return { num, den, delay }; }

    keep(designs) { this.change({ kept: [...this.state.kept, ...designs.map((design) => ({ ...design }))].slice(-MOST_KEPT) }); }

    threeKinds() {
      const rule = RULES[this.state.rule], made = [];
      for (const kind of Object.keys(ORDER)) {
        const design = { ...this.state.design, kind, filterOrder: ORDER[kind] + 1 };
        try { made.push(rule.apply(this.process, design, this.state[rule.knob])); } catch (error) { this.say(`${kind}: ${error.message}.`); }
      }
      this.change({ kept: made });
    }

    async take(file) {
      if (!file) return;
      try {
        const text = await file.text();
        if (file.name.endsWith(".json")) this.takeSaved(text); else this.takeRecord(text);
      } catch (error) { this.say(`${file.name}: ${error.message}.`); }
    }

    takeRecord(text) {
      const record = readRecord(text);
      this.change({ plant: "own", own: threePoint(record), record });
      this.say(`Record of ${record.t.length} samples read; three points give the model shown.`);
    }

    takeSaved(text) {
      const saved = JSON.parse(text).lab;
      if (!saved?.design) throw new RangeError("this JSON was not saved by the lab, it has no design under lab");
      this.takeOver(checked(saved));
      this.change({});
      this.say(`${1 + this.state.kept.length} designs read.`);
    }

    /* All designs for other programs, and the state for this one. */
    exported() {
      const designs = this.designs().map(({ kind, ...design }) => ({ kind, ...controller({ kind, ...design }) }));
      return { process: this.pick(this.process), designs, lab: this.state };
    }

    designs() { return [this.state.design, ...this.state.kept]; }

    call() {
      const { num, den, delay } = this.process, list = (x) => `[${x.map((v) => Number(v.toPrecision(8))).join(", ")}]`;
      const { limits, time, simulation, left, after } = this.conditionsInWords();
      const lines = this.designs().map((design, k) => {
        const { gains, filterTime, filterOrder } = controller(design), name = k ? `kept ${k}: ${design.kind}` : design.kind;
        return `    "${name}": pidalab.HighOrderPID(${list(gains.slice(0, ORDER[design.kind] + 2))}, filter_time=${filterTime}, filter_order=${filterOrder})${after},\n`;
      });
      return `import numpy as np\nimport pidalab\n\n${left.map((words) => `# ${words}\n`).join("")}process = pidalab.Process(${list(num)}, ${list(den)}, delay=${delay})\n` +
        `${limits}controllers = {\n${lines.join("")}}\nt = ${time}\n` +
        "for name, controller in controllers.items():\n    loop = pidalab.Loop(process, controller)\n" +
        `    load = pidalab.${simulation}\n    print(name, pidalab.margins(loop))\n    print(f"IAE {load.iae():.4g}")\n`;
    }

    /* Limits, sampling and noise as parts of a library call, and what of them it leaves out. */
    conditionsInWords() {
      const { end, limits, antiWindup, sampleTime, noise } = this.conditions, left = [], digital = sampleTime > 0;
      if (noise) left.push(`Left out: the measurement noise of the lab, ±${noise}.`);
      const reset = limits && antiWindup === "reset";
      if (reset) left.push("Left out: the automatic reset of the lab, see pidalab.rules.automatic_reset; clamping stands for it.");
      const way = { none: "None", conditioning: digital ? '"reset"' : '"conditioning"' }[antiWindup] ?? '"clamping"';
      const bounded = limits ? `limits=limits, anti_windup=${way}` : "";
      const filters = this.designs().map(controller).filter(({ filterOrder, filterTime }) => filterOrder && filterTime).map(({ filterTime }) => filterTime);
      const samples = Math.ceil(Math.max(4000, (4 * end) / Math.min(...filters, Infinity))); // limits meet a controller that is sampled fast
      return {
        left, limits: limits ? `limits = (${limits.join(", ")})\n` : "",
        after: digital ? `.discretise(${[sampleTime, bounded].filter(Boolean).join(", ")})` : "",
        time: digital ? `${sampleTime} * np.arange(${Math.round(end / sampleTime) + 1})` : `np.linspace(0, ${digits(end)}, ${limits ? samples + 1 : 2001})`,
        simulation: digital ? "simulate_sampled(loop, t, load=1.0)" : limits ? `simulate_sampled(loop, t, load=1.0, ${bounded})` : "load_response(loop, t)",
      };
    }

    show(text, name) {
      this.shown = { text, name };
      this.out.hidden = this.saving.hidden = false;
      this.out.textContent = text;
      this.saving.textContent = `Save as ${name}`;
      this.copy(text, "The text below");
    }

    download() {
      const { text, name } = this.shown, link = element("a", { download: name, href: URL.createObjectURL(new Blob([text], { type: "text/plain" })) });
      link.click();
      URL.revokeObjectURL(link.href);
      this.say(`${name} is saved.`);
    }

    copy(text, what) {
      const done = navigator.clipboard?.writeText(text);
      if (done) done.then(() => this.say(`${what} is copied.`), () => this.say(`${what} could not be copied; take it from the page.`));
    }

    say(text) { this.message = text; if (this.live) this.announce(); }

    draw() {
      const { state } = this, rule = RULES[state.rule] ?? RULES.hand, order = ORDER[state.design.kind];
      const visible = (row, yes) => { if (row.hidden === Boolean(yes)) row.hidden = !yes; };
      visible(this.ownRows, state.plant === "own");
      visible(this.rows[0].querySelector("option[value=given]"), state.given);
      visible(this.msRow, rule.knob === "ms"); visible(this.tcRow, rule.knob === "tc");
      visible(this.tdRow, order > 0); visible(this.taRow, order > 1);
      for (const row of [this.lowRow, this.highRow, this.windupRow]) visible(row, state.limited);
      visible(this.sampleRow, state.sampled); visible(this.noiseRow, state.noisy);
      for (const row of this.rows) if (!row.hidden) row.refresh?.();

      const all = this.designs(), shown = [];
      all.forEach((design, k) => {
        try { shown.push({ ...study(this.process, design, this.conditions), kind: k }); } catch (error) { if (!k) this.problem = `${error.message}.`; }
      });
      this.current = shown.find(({ kind }) => kind === 0);
      this.drawPlots(shown);
      this.drawTable(shown);
      this.announce();
    }

    drawPlots(shown) {
      const ms = RULES[this.state.rule]?.knob === "ms" ? this.state.ms : this.current?.ms;
      drawPlots(this.plots, this.process, shown, { ms, record: this.state.record });
    }

    drawTable(shown) {
      const columns = COLUMNS.map((key) => NUMBERS[key]);
      const gains = ({ kind, ...design }) => ["kp", "ti", "td", "ta"].slice(0, ORDER[kind] + 2).map((key) => `${key} ${digits(design[key])}`).join(", ");
      const numbers = (s) => (s.stable ? columns.map(([, get]) => ["td", {}, digits(get(s), 4)]) : [["td", { colspan: columns.length }, s.unknown ? verdict(s) : "unstable: it has no margins"]]);
      const rows = (s) => [
        ["tr", { class: "lab-numbers" },
          ["th", { scope: "rowgroup", rowspan: 2 }, ["span", { class: `lab-key lab-key-${s.kind}` }], ` ${s.kind ? "kept: " : ""}${s.design.kind}`], ...numbers(s)],
        ["tr", { class: "lab-gains" }, ["td", { colspan: columns.length }, gains(s.design)]],
      ];
      plot.show(this.table, ["table", {},
        ...captionOf(shown, COLUMNS, Object.keys(this.plots)),
        ["thead", {}, ["tr", {}, heading("design"), ...columns.map(([name]) => heading(name))]],
        ...shown.map((s) => ["tbody", {}, ...rows(s)])]);
    }

    /* Say the result in words and save it in the address, once the hand rests. */
    announce() {
      clearTimeout(this.speaking);
      const s = this.current;
      const numbers = !s ? "" : s.stable
        ? `${s.design.kind}: IAE ${digits(s.iae)} for a load step, Ms ${digits(s.ms)}, noise gain ${digits(s.sigma)}.`
        : `${s.design.kind}: the loop is ${verdict(s)}.`;
      this.speaking = setTimeout(() => { this.live.textContent = [this.problem, this.message, numbers].filter(Boolean).join(" "); this.message = ""; this.save(); }, 250);
    }
  }

  globalThis.pidalabLab = { Lab, readRecord, threePoint, element, slider, digits, drawPlots, NUMBERS, captionOf, verdict, heading };
  const begin = () => { for (const host of document.querySelectorAll(".pidalab-lab")) host.lab = new Lab(host); };
  if (document.readyState === "loading") addEventListener("DOMContentLoaded", begin); else begin();
})();
