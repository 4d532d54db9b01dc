/* The lab: every <div class="pidalab-lab"> of a page becomes a lab. One object holds the state, as do the address of the page
   and the exported file. Each change redraws everything. */
(function () {
  "use strict";
  const { PLANTS, RULES, ORDER, alike, ownPlant, controller, study, noiseScale, noiseGainAt, readNumber, write, read } = globalThis.pidalabModel;
  const { readRecord, fit } = globalThis.pidalabRecord;
  const plot = globalThis.pidalabPlot, { element, marked } = plot;

  /* A design is a card with its rule, limits and anti-windup. In a fair comparison all designs share Ms and relative noise
     gain, which determine the gain and filter of a rule. */
  const DESIGN = {
    name: "", kind: "PIDA", rule: "hand", kp: 0.87, ti: 3, td: 1, ta: 0.333, filterTime: 0.1, filterOrder: 3,
    limited: false, low: -1, high: 3, antiWindup: "clamping",
  };
  const START = {
    plant: "lags3", own: { gain: 1, t1: 1, t2: 1, t3: 1, damping: 1, zero: 0, delay: 1, integrating: false },
    given: null, record: null, fair: true, ms: 1.4, noiseGain: 1.5, tc: 1,
    sampled: false, sampleTime: 0.1, noisy: false, noise: 0.02, margins: false, chosen: 0, designs: [{ ...DESIGN, rule: "cancellation" }],
  };
  const MOST = 5, PAST = 100, LARGEST_FILE = 5e7;
  const LOOKS = { PIDA: 0, PID: 1, PI: 4 };

  /* Return a colour and a dash for each design: those of its kind or, for a second design of a kind, the next free ones. */
  function looksOf(kinds) {
    const taken = new Set();
    return kinds.map((kind) => {
      const look = [LOOKS[kind], 2, 3, 1, 4, 0].find((each) => !taken.has(each)) ?? 0;
      taken.add(look);
      return look;
    });
  }

  // --- controls -----------------------------------------------------------------------------------------------------

  const digits = (value, count = 3) =>
    Number.isFinite(value) ? String(Number(value.toPrecision(count))) : value === Infinity ? "∞" : "–";

  let names = 0;

  /* Create a slider and a number for one value. The number takes any value, and the slider takes usual values with three
     digits. A step must change these digits, or a key would move the slider without changing the value. On a logarithmic slider
     a negative value keeps its sign. A value beyond the end of a slider extends the slider. */
  function slider({ label, help, low, high, log, step, get, set }) {
    const id = `lab-input-${++names}`;
    const to = log ? (x) => Math.log10(Math.max(Math.abs(x), low)) : (x) => x;
    const from = log ? (x) => Math.sign(get() || 1) * Math.pow(10, x) : (x) => x;
    const bar = element("input", {
      type: "range", id, min: to(low), step,
      oninput: () => set(Number(from(Number(bar.value)).toPrecision(3))),
    });
    const box = element("input", {
      type: "text", inputmode: "decimal", autocomplete: "off", "aria-label": `${label}, number`,
      onchange: () => {
        const entered = readNumber(box.value);
        if (Number.isFinite(entered)) set(entered);
        else box.dispatchEvent(new CustomEvent("lab-refused", { bubbles: true, detail: `${label} must be a number, such as 2.5, 2,5 or 5/2, found “${box.value.slice(0, 30)}”. Its value is unchanged.` }));
        box.value = digits(get(), 4);
      },
    });
    const reach = (most) => { bar.max = to(most); bar.step = step ?? (bar.max - bar.min) / 200; };
    reach(high);
    const row = element("div", { class: "lab-row", title: help }, element("label", { for: id }, ...marked(label)), bar, box);
    row.refresh = () => {
      const value = get();
      if (to(value) > to(high)) reach(high = 2 * Math.abs(value));
      bar.value = to(value);
      bar.setAttribute("aria-valuetext", `${label} ${digits(value)}`);
      if (document.activeElement !== box) box.value = digits(value, 4);
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
    const row = element("div", { class: "lab-tick-row" }, box, element("label", { for: id }, ...marked(label)));
    row.refresh = () => { box.checked = get(); };
    return row;
  }

  const button = (text, onclick) => element("button", { type: "button", class: "lab-button", onclick }, text);

  // --- the plots ----------------------------------------------------------------------------------------------------

  /* The control signal has extra times at kicks, and the output between samples. */
  const signals = (s, key, which) => (key === "u" ? s[which].fine : s[which].between) || s[which];

  /* Return the range of a signal in all runs, including 0. Unstable loops count only if all loops are unstable. */
  function rangeOf(shown, key, which) {
    const calm = shown.filter((s) => s.stable);
    let low = 0, high = 0;
    for (const s of calm.length ? calm : shown) {
      for (const value of signals(s, key, which)[key]) {
        if (value < low) low = Math.max(value, -50); // an unstable loop may exceed the range of numbers
        if (value > high) high = Math.min(value, 50);
      }
    }
    return [low - 0.06 * (high - low || 1), high + 0.06 * (high - low || 1)];
  }

  /* Return a signal up to the end of the axis. The last point may lie beyond. */
  function until(run, key, end) {
    const count = run.t.findIndex((time) => time >= end) + 1 || run.t.length;
    return { x: run.t.subarray(0, count), y: run[key].subarray(0, count) };
  }

  /* Return a curve up to slightly beyond the frame, which clips it. */
  function along(curve, [low, high], f) {
    const x = [], y = [];
    curve.w.forEach((w, k) => { if (w > 0.8 * low && w < 1.25 * high) { x.push(w); y.push(f(curve, k)); } });
    return { x, y };
  }

  /* Draw the plots that have an element in `places`, by name. */
  function drawPlots(places, process, shown, { ms, record, handles = {} }) {
    const end = process.end;
    const run = (key, which, share = 1) => ({
      x: { label: "time", range: [0, end * share] }, y: { around: rangeOf(shown, key, which) },
      lines: shown.map((s) => ({ ...until(signals(s, key, which), key, end * share), kind: s.look, name: s.name, stairs: s.stairs && key === "u" })),
    });
    const bode = { label: "frequency, rad per time", log: true, range: [0.8 / end, 16000 / end] };
    const over = (f) => shown.map((s) => ({ ...along(s.curve, bode.range, f), kind: s.look, name: s.name }));
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
        lines: [...around.map((each) => circle(1 / each, -1)), circle(1), { x: [-1.05, -0.95], y: [0, 0], kind: "mark" }, { x: [-1, -1], y: [-0.05, 0.05], kind: "mark" }, ...shown.map((s) => ({ x: s.curve.re, y: s.curve.im, by: s.curve.w, kind: s.look }))],
      }),
      bode: () => ({
        title: "Loop gain |L|", x: bode, y: { log: true, range: [1e-3, 1e2] },
        lines: [{ x: bode.range, y: [1, 1], kind: "mark" }, ...over((c, k) => Math.hypot(c.re[k], c.im[k]))],
      }),
      closed: () => ({
        title: "From set point to output: |T|", x: { ...bode, range: [bode.range[0], bode.range[1] / 50] }, y: { range: [0, 1.5] },
        lines: [{ x: bode.range, y: [1, 1], kind: "mark" }, ...over((c, k) => Math.hypot(c.re[k], c.im[k]) / Math.hypot(1 + c.re[k], c.im[k]))],
      }),
      lead: () => ({ title: "Phase of the controller, degrees", x: bode, y: { range: [-95, 185] }, lines: [{ x: bode.range, y: [0, 0], kind: "mark" }, ...over((c, k) => c.lead[k])] }),
      noise: () => ({ title: "From measurement noise to u: |C S|", x: bode, y: { log: true }, lines: over((c, k) => c.control[k] / Math.hypot(1 + c.re[k], c.im[k])) }),
      record: () => ({
        title: "The record and the model", x: { label: "time", range: [0, record.t[record.t.length - 1]] }, y: {},
        lines: [{ x: record.t, y: record.y, kind: "dots" }, { x: record.t, y: record.fitted, kind: "0" }],
      }),
    };
    const ways = Object.fromEntries(Object.keys(places).map((key) => [key, key === "record" ? "record" : OVER_FREQUENCY.includes(key) ? "frequency" : "time"]));
    for (const [key, place] of Object.entries(places)) {
      if (key === "record" && !record) { place.hidden = true; continue; }
      place.hidden = false;
      const follow = (at) => { for (const other in places) if (ways[other] === ways[key]) plot.point(places[other], at); };
      plot(place, { ...PLOTS[key](), handles: handles[key] ?? [], follow });
    }
  }

  /* Columns of tables: name, number of a design, and true if an unstable loop has this number. */
  const degrees = (radians) => (radians * 180) / Math.PI;
  const NUMBERS = {
    iae: ["IAE load", (s) => s.iae], iaeSetpoint: ["IAE set point", (s) => s.iaeSetpoint], ms: ["Ms", (s) => s.ms], mks: ["Mks", (s) => s.mks],
    gm: ["gain margin", (s) => s.gm], pm: ["phase margin, °", (s) => s.pm], dm: ["delay margin", (s) => s.dm],
    peak: ["peak of u", (s) => s.peak], overshoot: ["overshoot, %", (s) => s.overshoot],
    sigma: ["relative noise gain", (s) => s.sigma],
    gmLeast: ["at least Ms/(Ms−1)", (s) => s.ms / (s.ms - 1)], pmLeast: ["at least 2 asin 1/(2 Ms), °", (s) => degrees(2 * Math.asin(0.5 / s.ms))],
    first: ["phase margin at the first crossover, °", (s) => s.beyond().first, true], hump: ["top of |L| beyond it", (s) => s.beyond().hump, true],
  };

  const OVER_FREQUENCY = ["nyquist", "bode", "closed", "lead", "noise"];

  /* Return the words that replace the margins of an unstable loop. */
  const verdict = (s) => (s.unknown ? "so slow for this sample time that its stability is unknown" : "unstable");

  /* Return the head of a column. A formula may break at its fraction bar. */
  const heading = (text) => ["th", { scope: "col" }, ...text.split(/(?<=\/)/).flatMap((part, k) => [...(k ? [["wbr", {}]] : []), ...marked(part)])];

  /* Return the sentence on the noise, for all rows of a table. */
  function noiseMeant(shown, process) {
    const none = shown.some((s) => s.stable && Number.isNaN(s.sigma)) ? " A dash (–) means that it is not defined." : "", { gain } = noiseScale(process);
    return `Relative noise gain: σ(u)/σ(n) for white noise sampled every ${digits(shown[0]?.noiseTime)}, divided by the ultimate gain ${digits(gain)}.${none}`;
  }

  /* Return the columns of a loop. An unstable loop has no margins, only numbers of its loop gain. */
  const known = (s, keys) => keys.map((key) => NUMBERS[key]).filter(([, , always]) => s.stable || always);

  /* Draw the table of numbers. `below` returns a line of words for each row. */
  function drawTable(place, first, process, shown, keys, count, below) {
    const rows = (s) => {
      const found = known(s, keys), missing = keys.length - found.length, more = below?.(s);
      const name = ["th", more ? { scope: "rowgroup", rowspan: 2 } : { scope: "row" }, ["span", { class: `lab-key lab-key-${s.look}` }], ` ${s.name}`];
      return [
        ["tr", { class: "lab-numbers" }, name, ...(missing ? [["td", { colspan: missing }, verdict(s)]] : []), ...found.map(([, get]) => ["td", {}, digits(get(s), count)])],
        ...(more ? [["tr", { class: "lab-gains" }, ["td", { colspan: keys.length }, ...marked(more)]]] : []),
      ];
    };
    plot.show(place, ["table", {},
      ["thead", {}, ["tr", {}, heading(first), ...keys.map((key) => heading(NUMBERS[key][0]))]],
      ...(below ? shown.map(rows) : [shown.flatMap(rows)]).map((group) => ["tbody", {}, ...group])],
    ...(keys.includes("sigma") ? [["p", {}, noiseMeant(shown, process)]] : []));
  }

  const COLUMNS = ["iae", "iaeSetpoint", "ms", "sigma", "gm", "pm", "dm", "peak", "overshoot"]; // columns of the lab's table
  const MARGINS = ["gm", "pm", "dm"]; // columns that are shown on request

  // --- a state from outside: a link or a file -----------------------------------------------------------------------

  const WAYS = ["none", "clamping", "conditioning", "reset"], LARGEST = 1e9;
  const within = (low, high = LARGEST) => [`a number from ${low} to ${high}`, (x) => typeof x === "number" && x >= low && x <= high];
  const whole = (low, high) => [`a whole number from ${low} to ${high}`, (x) => Number.isInteger(x) && x >= low && x <= high];
  const among = (names) => [`one of ${names.join(", ")}`, (x) => typeof x === "string" && names.includes(x)];
  const SIGNED = within(-LARGEST), TIME = within(0), ABOVE = within(1e-9), FLAG = ["true or false", (x) => typeof x === "boolean"];
  const LIST = ["a list of 1 to 20 numbers", (x) => Array.isArray(x) && x.length > 0 && x.length <= 20 && x.every(SIGNED[1])];
  const KNOBS = { ms: within(1, 100), noiseGain: within(1e-6, 1e6), tc: ABOVE };
  const FIELDS = {
    design: {
      ...KNOBS, name: ["a text of at most 40 letters", (x) => typeof x === "string" && x.length <= 40], kind: among(Object.keys(ORDER)), rule: among(Object.keys(RULES)),
      kp: SIGNED, ti: SIGNED, td: SIGNED, ta: SIGNED, filterTime: TIME, filterOrder: whole(0, 20), limited: FLAG, low: SIGNED, high: SIGNED,
      antiWindup: among(WAYS), trackingTime: ABOVE, pending: FLAG,
    },
    own: { gain: SIGNED, t1: TIME, t2: TIME, t3: TIME, damping: TIME, zero: SIGNED, delay: TIME, integrating: FLAG },
    given: { num: LIST, den: LIST, delay: TIME, end: ABOVE },
    state: {
      ...KNOBS, plant: among([...Object.keys(PLANTS), "own", "given"]), fair: FLAG, sampled: FLAG, sampleTime: ABOVE, noisy: FLAG, noise: TIME, margins: FLAG,
      chosen: whole(0, MOST - 1), own: ["", () => true], given: ["", () => true], designs: ["", () => true],
    },
  };

  function require(object, kind) {
    if (object === null || typeof object !== "object" || Array.isArray(object)) throw new RangeError(`its ${kind} must be an object`);
    for (const [key, value] of Object.entries(object)) {
      const [what, good] = Object.hasOwn(FIELDS[kind], key) ? FIELDS[kind][key] : [];
      if (!good) throw new RangeError(`its ${kind} has a field ${JSON.stringify(key.slice(0, 40))}, which this lab does not know`);
      if (!good(value)) throw new RangeError(`${key} must be ${what}, found ${String(JSON.stringify(value)).slice(0, 40)}`);
    }
  }

  /* Check all fields of a state from outside, and return it. */
  function checked(state) {
    require(state, "state");
    const { own, given, designs } = state;
    if (own !== undefined) require(own, "own");
    if (given !== undefined) {
      require(given, "given");
      if (!(given.num && given.den && given.end)) throw new RangeError("its plant lacks num, den or end");
    }
    if (designs !== undefined && !(Array.isArray(designs) && designs.length && designs.length <= MOST)) throw new RangeError(`it must have 1 to ${MOST} designs`);
    for (const design of designs ?? []) require(design, "design");
    // A link without limits keeps the filters of its designs.
    const searched = (designs ?? []).every((each) => [undefined, "hand", "optimum"].includes(each.rule));
    return { fair: searched, ...state };
  }

  /* Return the fields of an object that differ from another object. Numbers are rounded to six digits. */
  const differing = (object, from) => Object.fromEntries(Object.entries(object).filter(([key, value]) => value !== from[key])
    .map(([key, value]) => [key, typeof value === "number" ? Number(value.toPrecision(6)) : value]));

  // --- searches, in a worker, one at a time, since they take a second----------------------------------------------------

  const WORK = `onmessage = ({ data: { key, process, kind, knobs } }) => {
    let found;
    try { found = pidalabOptimum.find(process, kind, knobs); } catch (error) { found = { problem: error.message }; }
    postMessage({ key, found });
  };`;

  class Seeker {
    constructor(heard) { this.known = new Map(); this.wanted = new Map(); this.heard = heard; }

    /* Return the result, or null while the search runs. */
    ask(process, kind, knobs) {
      const task = { process: { num: process.num, den: process.den, delay: process.delay }, kind, knobs }, key = JSON.stringify(task);
      if (!this.known.has(key)) { this.wanted.set(key, { key, ...task }); this.begin(); }
      return this.known.get(key) ?? null;
    }

    begin() {
      if (this.busy || !this.wanted.size) return;
      if (!this.worker) {
        const optima = `globalThis.pidalabOptima = ${JSON.stringify(globalThis.pidalabOptima)};`;
        const source = [optima, ...globalThis.pidalabScripts.map((script) => `(${script})();`), WORK].join("\n");
        this.worker = new Worker(URL.createObjectURL(new Blob([source], { type: "text/javascript" })));
        this.worker.onmessage = ({ data: { key, found } }) => { this.busy = false; this.known.set(key, found); this.wanted.delete(key); this.heard(); this.begin(); };
      }
      this.busy = true;
      this.worker.postMessage([...this.wanted.values()].pop()); // send the latest request
    }

    /* Forget searches that are no longer wanted. */
    clear() { this.wanted.clear(); }
  }

  /* Quote any text as one word of a shell. */
  const quoted = (word) => (/^[\w./-]+$/.test(word) ? word : `'${word.replaceAll("'", String.raw`'\''`)}'`);

  // --- one lab ------------------------------------------------------------------------------------------------------

  class Lab {
    constructor(host) {
      this.host = host;
      this.past = [];
      this.problems = [];
      this.seeker = new Seeker(() => this.change({}, "found"));
      this.startAnew();
      this.hear();
      this.build();
      this.change({});
      addEventListener("hashchange", () => { this.hear(); this.change({}, null); });
    }

    startAnew() {
      this.state = structuredClone(START);
      this.takeOver(this.host.dataset.state ? checked(JSON.parse(this.host.dataset.state)) : null);
    }

    /* Take over the state in the address. Missing fields get their defaults. */
    hear() {
      this.heard = location.hash;
      let given = null;
      try {
        given = document.getElementById(this.heard.slice(1)) ? null : read(this.heard);
        if (given === null) return;
        given = checked(given);
      } catch (error) {
        given = null;
        this.say(`The link is damaged: ${error.message}.`);
      }
      this.startAnew();
      this.takeOver(given);
    }

    /* Take over parts of a state. A design without a rule is by hand. */
    takeOver(given) {
      if (!given) return;
      const designs = (given.designs ?? this.state.designs).map((each) => ({ ...DESIGN, ...(each.kind ? { filterOrder: ORDER[each.kind] + 1 } : {}), ...each }));
      Object.assign(this.state, given, { own: { ...this.state.own, ...given.own }, designs, chosen: Math.min(given.chosen ?? 0, designs.length - 1) });
    }

    get design() { return this.state.designs[this.state.chosen]; }

    get process() {
      const { plant, own, given } = this.state;
      return plant === "own" ? ownPlant(own) : plant === "given" && given ? given : PLANTS[plant] ?? PLANTS.lags3;
    }

    /* Return the end of the time axis of all designs. */
    conditionsOf({ limited, low, high, antiWindup, trackingTime }) {
      const { sampled, sampleTime, noisy, noise } = this.state;
      return { end: this.process.end, limits: limited ? [low, high] : null, antiWindup, trackingTime, sampleTime: sampled ? sampleTime : 0, noise: noisy ? noise : 0 };
    }

    /* Return a setting. In a fair comparison all designs share it. */
    knob(key, design = this.design) { return this.state.fair ? this.state[key] : design[key] ?? this.state[key]; }

    /* Return true if a design follows from the common Ms and noise limit. */
    onTerms({ rule }) { return this.state.fair && RULES[rule] && !RULES[rule].slow && rule !== "hand"; }

    /* Return the design of a rule that needs no search. */
    byRule(design) {
      const rule = RULES[design.rule] ?? RULES.hand, knob = rule.knob && this.knob(rule.knob, design), { num, den, delay, end } = this.process;
      if (!this.onTerms(design)) return rule.apply(this.process, design, knob);
      return alike({ num, den, delay, end }, design, { knob, ms: this.state.ms, noise: this.state.noiseGain });
    }

    setKnob(key, value) { if (this.state.fair) this.change({ [key]: value }); else this.edit({ [key]: value }); }

    /* Return a design by its rule, or the old design and a problem. */
    ruled(design, k) {
      const rule = RULES[design.rule] ?? RULES.hand, knob = rule.knob && this.knob(rule.knob, design);
      this.problems[k] = "";
      try {
        if (!rule.slow) return this.byRule(design);
        const found = this.seeker.ask(this.process, design.kind, { ms: knob, noise: this.knob("noiseGain", design) });
        if (!found) { this.problems[k] = "the search is running"; return design; }
        if (found.problem) throw new RangeError(found.problem);
        if (found.agree < 2) this.problems[k] = `only one of ${found.ends.length} searches found this design: there may be a better one`;
        return { ...design, ...found.design, pending: undefined };
      } catch (error) {
        // A design that was never found is not shown. Other designs keep their gains.
        this.problems[k] = `${error.message}; ${this.onTerms(design) ? "without “fair” the rule uses its own gain; " : ""}${design.pending ? "no design is shown" : "the gains are unchanged"}`;
        return design;
      }
    }

    /* Change the state, apply the rules and draw. A "step" can be undone. The result of a search belongs to the step before it. */
    change(update, store = "step") {
      Object.assign(this.state, update);
      this.seeker.clear();
      this.state.designs = this.state.designs.map((design, k) => this.ruled(design, k));
      if (store && this.unsaved !== "step") this.unsaved = store;
      if (!this.waiting) this.waiting = requestAnimationFrame(() => { this.waiting = 0; this.draw(); });
    }

    /* Choose another plant. The search replaces rules that do not fit it, with a message. */
    choosePlant(plant) {
      this.change({ plant, record: plant === "own" ? this.state.record : null });
      const words = [], names = this.names(), designs = this.state.designs.map((design, k) => {
        const { slow, name } = RULES[design.rule] ?? RULES.hand;
        if (!this.problems[k] || slow) return design;
        words.push(`${names[k]}: ${this.problems[k].split("; ")[0]}; the lab uses least IAE instead of “${name}”.`);
        return { ...design, rule: "optimum", pending: true };
      });
      if (!words.length) return;
      this.say(words.join(" "));
      this.change({ designs });
    }

    edit(update) { this.change({ designs: this.state.designs.map((design, k) => (k === this.state.chosen ? { ...design, ...update } : design)) }); }

    byHand(update) { this.edit({ pending: undefined, rule: this.design.rule === "gain" && !("kp" in update) ? "gain" : "hand", ...update }); }

    /* Return the state for a link or a file: fields that differ from the defaults, without a record. */
    shared() {
      const { designs, record, given, plant, ...rest } = this.state, kept = ({ pending, ...design }) => differing(design, DESIGN);
      return {
        ...differing({ plant, ...rest }, { ...START, fair: null }), own: plant === "own" ? differing(rest.own, {}) : undefined, given: plant === "given" ? (({ num, den, delay, end }) => ({ num, den, delay, end }))(given) : undefined,
        designs: designs.map(kept),
      };
    }

    link() { return write(this.shared()); }

    /* Put the state into the address when controls rest, since a browser permits few changes per second. Do not replace
       an address that was given in the meantime and is about to be announced. */
    save() {
      if (!this.unsaved || location.hash !== this.heard) return;
      const now = JSON.stringify(this.state);
      if (this.unsaved === "step" && this.saved && this.saved !== now) this.past = [...this.past, this.saved].slice(-PAST);
      this.saved = now;
      history.replaceState(null, "", `#${this.link()}`);
      this.heard = location.hash;
      this.unsaved = null;
    }

    undo() {
      if (this.unsaved) this.save();
      const before = this.past.pop();
      if (!before) return this.say("There is nothing to undo.");
      this.saved = before;
      this.state = JSON.parse(before);
      this.change({}, "found");
    }

    build() {
      const own = (update) => this.change({ own: { ...this.state.own, ...update } });
      const ownValue = (label, key, low, high, log, help) =>
        slider({ label, help, low, high, log, get: () => this.state.own[key], set: (value) => own({ [key]: value }) });
      const value = (label, key, low, high, help) =>
        slider({ label, help, low, high, log: true, get: () => this.design[key], set: (x) => this.byHand({ [key]: x }) });
      const ownChoice = (row) => ({ ...row, get: () => this.design[row.key], set: (x) => this.edit({ [row.key]: x }) });

      this.ownRows = element("div", {},
        ownValue("gain", "gain", 0.1, 10, true), ownValue("lag T1", "t1", 0.01, 100, true),
        ownValue("lag T2", "t2", 0, 10, false), ownValue("lag T3", "t3", 0, 10, false),
        ownValue("damping", "damping", 0.05, 1, false, "if it is below 1, the lags T1 and T2 become an oscillating pair with time T1"),
        ownValue("zero", "zero", -3, 3, false, "time constant of a zero, 1 + zero·s; a negative value gives an inverse response"),
        ownValue("dead time", "delay", 0, 10, false),
        tick({ label: "integrating", get: () => this.state.own.integrating, set: (x) => own({ integrating: x }) }));

      // a browser labels its own file button in its own language
      const file = element("input", { type: "file", class: "lab-file", accept: ".csv,.txt,.json,text/csv,text/plain,application/json", id: "lab-file", onchange: () => this.take(file.files[0]) });
      this.host.addEventListener("lab-refused", ({ detail }) => this.say(detail));
      const drop = element("div", { class: "lab-drop" },
        file, element("label", { for: "lab-file", class: "lab-button" }, "Open a record or designs"),
        element("span", { class: "lab-facts" }, " or drop the file here. A record is a CSV file with time, input and output, or with time and output. Designs saved by the lab are JSON files."));
      drop.addEventListener("dragover", (event) => event.preventDefault());
      drop.addEventListener("drop", (event) => { event.preventDefault(); this.take(event.dataTransfer.files[0]); });

      this.columns = element("div", { class: "lab-columns", hidden: true, onchange: () => this.otherColumns() });

      const plantRow = choice({
        label: "plant", options: [...Object.entries(PLANTS).map(([key, plant]) => [key, plant.name]), ["given", "the plant of the link"], ["own", "my own"]],
        get: () => this.state.plant, set: (plant) => this.choosePlant(plant),
      });
      this.givenOption = plantRow.querySelector("option[value=given]");
      this.nameBox = element("input", { type: "text", id: "lab-name", maxlength: 40, onchange: () => this.edit({ name: this.nameBox.value }) });
      const nameRow = element("div", { class: "lab-row lab-choice" }, element("label", { for: "lab-name" }, "name"), this.nameBox);
      nameRow.refresh = () => { if (document.activeElement !== this.nameBox) this.nameBox.value = this.design.name; };
      const design = [
        nameRow,
        choice({ label: "controller", options: Object.keys(ORDER).map((kind) => [kind, kind]), get: () => this.design.kind, set: (kind) => this.edit({ kind, filterOrder: ORDER[kind] + 1, pending: RULES[this.design.rule]?.slow || undefined }) }),
        choice(ownChoice({ label: "rule", key: "rule", options: Object.entries(RULES).map(([key, rule]) => [key, rule.name]) })),
        this.msRow = slider({ label: "Ms", help: "largest sensitivity allowed", low: 1.1, high: 2.5, step: 0.01, get: () => this.knob("ms"), set: (ms) => this.setKnob("ms", ms) }),
        this.limitRow = slider({ label: "noise limit", help: "largest relative noise gain allowed", low: 0.05, high: 5, log: true, get: () => this.knob("noiseGain"), set: (x) => this.setKnob("noiseGain", x) }),
        this.tcRow = slider({ label: "closed-loop time", low: 0.05, high: 20, log: true, get: () => this.knob("tc"), set: (tc) => this.setKnob("tc", tc) }),
        value("kp", "kp", 0.01, 100), value("ti", "ti", 0.05, 100),
        this.tdRow = value("td", "td", 0.005, 20), this.taRow = value("ta", "ta", 0.0005, 50, "of the acceleration, a time squared"),
        slider({ label: "filter time", low: 0.001, high: 10, log: true, get: () => this.design.filterTime, set: (x) => this.filter({ filterTime: x }) }),
        slider({ label: "filter order", low: 1, high: 6, step: 1, get: () => this.design.filterOrder, set: (x) => this.filter({ filterOrder: Math.round(x) }) }),
        tick({ label: "limits of the actuator", get: () => this.design.limited, set: (limited) => this.edit({ limited }) }),
        this.lowRow = slider({ label: "lowest u", low: -10, high: 0, get: () => this.design.low, set: (low) => this.edit({ low: Math.min(low, 0) }) }),
        this.highRow = slider({ label: "highest u", low: 0.1, high: 20, get: () => this.design.high, set: (high) => this.edit({ high: Math.max(high, 0.01) }) }),
        this.windupRow = choice(ownChoice({ label: "anti-windup", key: "antiWindup", options: [["none", "none"], ["clamping", "clamping"], ["conditioning", "conditioning"], ["reset", "automatic reset"]] })),
      ];
      const world = [
        tick({ label: "digital controller", get: () => this.state.sampled, set: (sampled) => this.change({ sampled }) }),
        this.sampleRow = slider({ label: "sample time", low: 0.005, high: 2, log: true, get: () => this.state.sampleTime, set: (sampleTime) => this.change({ sampleTime }) }),
        tick({ label: "measurement noise", get: () => this.state.noisy, set: (noisy) => this.change({ noisy }) }),
        this.noiseRow = slider({ label: "noise, ±", low: 0.001, high: 0.5, log: true, get: () => this.state.noise, set: (noise) => this.change({ noise }) }),
      ];
      const fairRow = tick({ label: "fair: equal Ms, equal relative noise gain", get: () => this.state.fair, set: (fair) => this.change({ fair }) });
      const marginsRow = tick({ label: "gain, phase and delay margin", get: () => this.state.margins, set: (margins) => this.change({ margins }) });
      this.rows = [plantRow, ...this.ownRows.children, fairRow, ...design, ...world, marginsRow];
      this.cards = element("div", { class: "lab-cards", onclick: (event) => this.pressed(event.target) });
      const part = (title, ...rows) => element("fieldset", {}, element("legend", {}, title), ...rows);
      const controls = element("div", { class: "lab-controls" },
        part("Plant", plantRow, this.ownRows, drop, this.columns),
        part("Designs", fairRow, this.cards, element("div", { class: "lab-actions" },
          button("PI, PID and PIDA by this rule", () => this.threeKinds()), button("Add a copy", () => this.copyOf()), button("Undo", () => this.undo()))),
        part("The chosen design", ...design), part("Sampling, noise", ...world));
      addEventListener("keydown", (event) => {
        if ((event.ctrlKey || event.metaKey) && event.key === "z" && event.target.type !== "text") { event.preventDefault(); this.undo(); }
      });

      this.plots = {};
      const place = (...keys) => keys.map((key) => (this.plots[key] = element("div", {})));
      const first = element("div", { class: "lab-plots lab-first" }, ...place("record", "setpoint", "load"));
      const plots = element("div", { class: "lab-plots" }, ...place("control", "nyquist", "bode", "noise"));
      this.table = element("div", { class: "lab-table", tabindex: 0, role: "region", "aria-label": "Numbers of the designs" });
      this.live = element("p", { class: "lab-live", role: "status" });
      this.about = element("div", { class: "lab-about", role: "status" });
      this.out = element("pre", { class: "lab-out", hidden: true });
      this.saving = button("Save as a file", () => this.download());
      this.saving.hidden = true;
      const actions = element("div", { class: "lab-actions" },
        button("Copy a link", () => { this.save(); this.copy(location.href, "The link"); }),
        button("As a library call", () => this.showCall()),
        button("As JSON", () => this.show(JSON.stringify(this.exported(), null, 1), "pida_designs.json")),
        button("Start anew", () => { this.state = structuredClone(START); this.change({}); }));
      const stage = element("div", { class: "lab-stage" }, first, this.about, controls);
      this.host.replaceChildren(element("div", { class: "lab-main" }, this.live, stage, element("div", { class: "lab-results" }, this.table, marginsRow, plots, actions, this.saving, this.out)));
      this.host.classList.add("lab-ready");
      document.body.classList.add("lab-page");
    }

    /* Change the filter. Rules that leave the filter to the user stay, and rules that compute it become designs by hand. The
       comparison is then no longer fair. */
    filter(update) {
      if ("filterTime" in update && this.onTerms(this.design)) {
        this.say("You set the filter time, so the comparison is no longer fair.");
        this.state.fair = false;
      }
      this.edit({ ...(RULES[this.design.rule]?.slow ? { rule: "hand" } : {}), ...update });
    }

    pick({ num, den, delay }) { return { num, den, delay }; }

    /* A press on a card chooses its design, and a press on its cross removes it. */
    pressed(target) {
      const card = target.closest("[data-k]"), k = Number(card?.dataset.k), { designs, chosen } = this.state;
      if (!card) return;
      if (!target.closest(".lab-gone")) return this.change({ chosen: k });
      this.change({ designs: designs.filter((_, other) => other !== k), chosen: Math.min(chosen - (k < chosen ? 1 : 0), designs.length - 2) });
    }

    copyOf() {
      const { designs } = this.state;
      if (designs.length >= MOST) return this.say(`The lab shows at most ${MOST} designs: remove one first.`);
      this.change({ designs: [...designs, { ...this.design }], chosen: designs.length });
    }

    threeKinds() {
      const made = [], missing = [], rule = this.state.fair && this.design.rule === "hand" ? "gain" : this.design.rule; // a shape by hand
      for (const kind of Object.keys(ORDER)) {
        const design = { ...this.design, rule, name: "", kind, filterOrder: ORDER[kind] + 1, pending: RULES[rule].slow && kind !== this.design.kind || undefined };
        try {
          if (!RULES[rule].slow) this.byRule(design);
          made.push(design);
        } catch (error) { missing.push(`${kind}: ${error.message}.`); }
      }
      if (missing.length) this.say(missing.join(" "));
      if (made.length) this.change({ designs: made, chosen: made.length - 1 });
    }

    async take(file) {
      if (!file) return;
      try {
        if (file.size > LARGEST_FILE) throw new RangeError(`it has ${Math.round(file.size / 1e6)} million characters; the lab reads at most ${LARGEST_FILE / 1e6} million`);
        plot.show(this.live, `Reading ${file.name} …`);
        const text = await file.text();
        if (file.name.endsWith(".json")) this.takeSaved(text); else this.takeRecord(text, file.name);
      } catch (error) { this.say(`${file.name}: ${error.message}.`); }
    }

    /* Fit a plant to a record by least squares, and make a design whose filter suits the noise: three standard deviations of the
       noise move u by a tenth of the record's step. Nothing is shown until the search is done. */
    takeRecord(text, name, columns) {
      const record = readRecord(text, columns), { own, name: structure, t, fitted, sigma, explained, span, h } = fit(record), four = (x) => Number(x.toPrecision(4));
      const rounded = Object.fromEntries(Object.entries(own).map(([key, x]) => [key, typeof x === "number" ? four(x) : x]));
      const each = Math.max(1, Math.ceil(t.length / 400)), thin = (values) => Array.from(values, Number).filter((_, k) => k % each === 0).map(four);
      const at = t.filter((_, k) => k % each === 0), y = at.map((x) => record.y[Math.max(record.t.findLastIndex((other) => other <= x + 1e-6 * h), 0)]);
      const noiseGain = four(Math.min(Math.max((0.1 * span) / (3 * sigma * noiseScale(ownPlant(rounded)).gain) || 1.5, 0.1), 5));
      const time = own.t1 + own.t2 + own.t3 + own.delay, slow = own.integrating ? { kp: 0.2 / (own.gain * time), ti: 10 * time } : { kp: 0.2 / own.gain, ti: time };
      const poor = explained < 0.9 ? " This fit is poor. Are the columns time, input and output, and does the input move?" : "";
      const about = `Record of ${record.t.length} samples read.${record.missing ? ` ${record.missing} rows with missing values were left out.` : ""} The least-squares model has ${structure}. It explains ${digits(100 * explained, 4)} % of the variance of the output.${poor} The residuals have a standard deviation of ${digits(sigma)}. The noise limit is therefore ${digits(noiseGain)}: with it, three standard deviations move u by a tenth of the record's step. (The lab keeps this limit between 0.1 and 5.)`;
      const { names, named, columns: used } = record, words = [name, ...used.map((j) => names[j])];
      const chosen = ["time", "u", "y"].map((option, j) => (used[j] === j ? "" : ` --${option}=${named ? quoted(names[used[j]]) : used[j]}`)).join("");
      if (this.dropped?.text !== text) {
        this.dropped = { text, name, id: (this.dropped?.id ?? 0) + 1 };
        this.columns.replaceChildren(...["time", "input", "output"].map((label) => element("label", {}, `${label} `, element("select", {}, ...names.map((word, k) => element("option", { value: k }, word))))));
      }
      const file = used.length > 2 && !words.some((word) => /\p{C}/u.test(word)) ? { called: quoted(name.startsWith("-") ? `./${name}` : name) + chosen, h, columns: used, dropped: this.dropped.id } : null;
      this.change({ plant: "own", own: rounded, record: { t: thin(t), y: y.map(four), fitted: thin(fitted), about, file }, ms: 1.4, noiseGain, fair: true, designs: [{ ...DESIGN, ...slow, td: 0, ta: 0, rule: "optimum", pending: true }], chosen: 0 });
    }

    otherColumns() {
      const { text, name } = this.dropped, chosen = Array.from(this.columns.querySelectorAll("select"), (box) => Number(box.value));
      try { this.takeRecord(text, name, chosen); } catch (error) { this.say(`${name}: ${error.message}.`); }
    }

    takeSaved(text) {
      const saved = JSON.parse(text).lab;
      if (!saved?.designs) throw new RangeError("this JSON file was not saved by the lab: it has no designs under “lab”");
      const state = checked(saved);
      this.state = structuredClone(START);
      this.takeOver(state);
      this.change({});
      this.say(`${this.state.designs.length} designs read.`);
    }

    /* Return all designs for other programs, and the state for the lab. */
    exported() {
      const names = this.names();
      const designs = this.state.designs.map(({ kind, ...design }, k) => ({ name: names[k], kind, ...controller({ kind, ...design }) }));
      return { process: this.pick(this.process), designs, lab: this.shared() };
    }

    /* Return unique names. A second design of the same name gets a number. */
    names() {
      const plain = this.state.designs.map(({ name, kind }) => name || kind);
      return plain.map((name, k) => { const before = plain.slice(0, k).filter((other) => other === name).length; return before ? `${name} ${before + 1}` : name; });
    }

    showCall() {
      if (this.refused.length) return this.say(`There is no script while a design is refused: ${this.refused.join(", ")}.`);
      this.show(this.call(), "pida_designs.py");
    }

    /* Return all designs with their limits, sampling and noise as Python, with remarks on omissions. Only numbers and quoted names
       from the state enter the script. */
    call() {
      const { num, den, delay, end } = this.process, { designs, sampled, noisy } = this.state, names = this.names(), h = Number(this.state.sampleTime);
      const list = (x) => `[${x.map((v) => Number(v.toPrecision(8))).join(", ")}]`, left = noisy ? [`Left out: the measurement noise of the lab, ±${Number(this.state.noise)}.`] : [];
      if (designs.some(({ limited, antiWindup }) => limited && antiWindup === "reset")) left.push("Left out: the automatic reset of the lab, see pidalab.rules.automatic_reset; clamping is used instead.");
      const lines = designs.map((design, k) => {
        const { gains, filterTime, filterOrder } = controller(design);
        const way = { none: "None", conditioning: sampled ? '"reset"' : '"conditioning"' }[design.antiWindup] ?? '"clamping"';
        const tracking = sampled && design.trackingTime && design.antiWindup === "conditioning" ? ['"back-calculation"', `, "tracking_time": ${Number(design.trackingTime)}`] : [way, ""];
        const limits = design.limited ? `{"limits": (${Number(design.low)}, ${Number(design.high)}), "anti_windup": ${tracking.join("")}}` : "{}";
        return `    ${JSON.stringify(names[k])}: (pidalab.HighOrderPID(${list(gains.slice(0, ORDER[design.kind] + 2))}, filter_time=${Number(filterTime)}, filter_order=${Number(filterOrder)}), ${limits}),\n`;
      });
      const filters = designs.map(controller).filter(({ filterOrder, filterTime }) => filterOrder && filterTime).map(({ filterTime }) => filterTime);
      const samples = Math.ceil(Math.max(4000, (4 * end) / Math.min(...filters, Infinity))); // with limits the library samples the controller, so the step must be short
      const time = sampled ? `${h} * np.arange(${Math.round(end / h) + 1})` : `np.linspace(0, ${digits(end)}, ${designs.some(({ limited }) => limited) ? samples + 1 : 2001})`;
      const loops = sampled
        ? `    loop = pidalab.Loop(process, controller.discretise(${h}, **limits))\n    load = pidalab.simulate_sampled(loop, t, load=1.0)\n`
        : "    loop = pidalab.Loop(process, controller)\n    limited = limits and pidalab.simulate_sampled(loop, t, load=1.0, **limits)\n    load = limited or pidalab.load_response(loop, t)\n";
      return `import numpy as np\nimport pidalab\n\n${left.map((words) => `# ${words}\n`).join("")}process = pidalab.Process(${list(num)}, ${list(den)}, delay=${Number(delay)})\n` +
        `designs = {\n${lines.join("")}}\nt = ${time}\nfor name, (controller, limits) in designs.items():\n${loops}    print(name, pidalab.margins(loop))\n    print(f"IAE {load.iae():.4g}")\n`;
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
      if (done) done.then(() => this.say(`${what} is copied.`), () => this.say(`${what} could not be copied: select it on the page.`));
    }

    say(text) { this.message = text; if (this.live) this.announce(); }

    draw() {
      const { state, design } = this, rule = RULES[design.rule] ?? RULES.hand, order = ORDER[design.kind];
      const visible = (row, yes) => { if (row.hidden === Boolean(yes)) row.hidden = !yes; };
      visible(this.ownRows, state.plant === "own");
      visible(this.givenOption, state.given);
      const file = state.record?.file, here = file && file.dropped === this.dropped?.id;
      visible(this.columns, here);
      if (here) this.columns.querySelectorAll("select").forEach((box, j) => { box.value = file.columns[j]; });
      const terms = this.onTerms(design);
      visible(this.msRow, terms || rule.knob === "ms"); visible(this.tcRow, rule.knob === "tc"); visible(this.limitRow, terms || rule.noise);
      visible(this.tdRow, order > 0); visible(this.taRow, order > 1);
      for (const row of [this.lowRow, this.highRow, this.windupRow]) visible(row, design.limited);
      visible(this.sampleRow, state.sampled); visible(this.noiseRow, state.noisy);
      for (const row of this.rows) if (!row.hidden) row.refresh?.();

      const looks = looksOf(state.designs.map(({ kind }) => kind)), names = this.names(), shown = [];
      state.designs.forEach((each, k) => {
        if (each.pending) return;
        try { shown.push({ ...study(this.process, each, this.conditionsOf(each)), k, look: looks[k], name: names[k] }); } catch (error) { this.problems[k] = error.message; }
      });
      this.refused = names.filter((_, k) => !shown.some((s) => s.k === k));
      this.current = shown.find(({ k }) => k === state.chosen);
      // A rule that aims at Ms considers only the continuous loop.
      if (state.sampled) for (const { k, ms, design: { rule } } of shown) {
        const asked = this.knob("ms", state.designs[k]);
        if ((RULES[rule]?.knob === "ms") && ms > 1.02 * asked && !this.problems[k]) this.problems[k] = `the digital loop has Ms ${digits(ms)}, not ${digits(asked)}: use a shorter sample time or a smaller Ms`;
      }
      this.notes = Object.fromEntries(shown.map((s) => [s.k, this.notesOf(s)]));
      this.drawCards(looks, names);
      this.drawRecord();
      this.drawPlots(shown);
      const gains = ({ kind, filterTime, filterOrder, ...design }) => ["kp", "ti", "td", "ta"].slice(0, ORDER[kind] + 2)
        .map((key) => `${key} ${digits(design[key])}`).join(", ") + `; filter ${digits(filterTime)}, order ${filterOrder}`;
      drawTable(this.table, "design", this.process, shown, COLUMNS.filter((key) => state.margins || !MARGINS.includes(key)), 4, (s) => gains(s.design));
      this.announce();
    }

    notesOf({ design, bears, stable, ms, sigma }) {
      const { fair, sampled, noiseGain, designs, own, plant, record } = this.state, said = [];
      if (!bears) said.push("The error does not return to zero: a unit load needs u = −1, which is beyond these limits.");
      if (fair && stable && !sampled && design.rule === "hand" && designs.length > 1 && (ms > 1.02 * this.state.ms || sigma > 1.02 * noiseGain))
        said.push(`This design by hand has Ms ${digits(ms)} and a relative noise gain of ${digits(sigma)}. The other designs have at most ${digits(this.state.ms)} and ${digits(noiseGain)}.`);
      if (fair && stable && !sampled && design.rule !== "hand" && sigma < 0.98 * noiseGain) said.push(`Its relative noise gain is only ${digits(sigma)}; the limit is ${digits(noiseGain)}.`);
      const known = [own.t1, own.t2, own.t3].filter(Boolean).length + own.integrating;
      if (plant === "own" && record && known <= ORDER[design.kind]) said.push(`The model has ${known} pole${known === 1 ? "" : "s"}. A ${design.kind} acts on faster dynamics, which this record does not show.`);
      return said;
    }

    drawCards(looks, names) {
      const { designs, chosen } = this.state;
      plot.show(this.cards, ...designs.map((design, k) => {
        const rule = RULES[design.rule] ?? RULES.hand, { limited, low, high, antiWindup } = design;
        const facts = [rule.name, ...(limited ? [`u from ${digits(low)} to ${digits(high)}, ${antiWindup === "none" ? "no anti-windup" : antiWindup}`] : [])].join("; ");
        return ["div", { class: `lab-card${k === chosen ? " lab-chosen" : ""}`, "data-k": k },
          ["button", { type: "button", class: "lab-choose", "aria-pressed": String(k === chosen) }, ["span", { class: `lab-key lab-key-${looks[k]}` }], ` ${names[k]}`],
          ["span", { class: "lab-facts" }, facts], ...(this.problems[k] ? [["span", { class: "lab-problem" }, ...marked(this.problems[k])]] : []), ...(this.notes[k] ?? []).map((note) => ["span", { class: "lab-note" }, ...marked(note)]),
          ...(designs.length > 1 ? [["button", { type: "button", class: "lab-gone", "aria-label": `Remove ${names[k]}` }, "×"]] : [])];
      }));
    }

    /* Show what was read from a record, and the command that continues with the chosen design. */
    drawRecord() {
      const { about, file } = this.state.record ?? {}, ready = file && !this.refused.length;
      const noise = ready && noiseGainAt(this.process, this.design, file.h);
      const command = ready && Number.isFinite(noise) && `pidalab tune ${file.called} --kind ${this.design.kind} --ms ${digits(this.knob("ms"))} --noise-gain ${digits(noise)} --sample-time ${digits(file.h)} --out code`;
      plot.show(this.about, ...(about ? [["p", {}, about]] : []),
        ...(command ? [["p", {}, ...marked("This command designs a controller with the same Ms, and with the noise gain of this design at the record's sample time. It considers uncertainty and sampling, and writes code for the controller into the folder "), ["code", {}, "code"], ":"], ["pre", {}, command]] : []));
    }

    drawPlots(shown) {
      const { design, current } = this, rule = RULES[design.rule] ?? RULES.hand, terms = this.onTerms(design), byMs = terms || rule.knob === "ms", ms = byMs ? this.knob("ms") : current?.ms;
      const between = (low, x, high) => Number(Math.min(Math.max(x, low), high).toPrecision(3)), handles = {};
      if (byMs) handles.nyquist = [{ label: "drag: Ms", x: -1 + Math.SQRT1_2 / ms, y: Math.SQRT1_2 / ms, drag: (x, y) => this.setKnob("ms", between(1.1, 1 / Math.hypot(x + 1, y), 2.5)) }];
      const w = 1 / design.filterTime, at = current?.stable && !terms ? current.curve.w.findIndex((x) => x >= w) : -1;
      if (at >= 0) handles.noise = [{ label: "drag: filter time", x: w, y: current.curve.control[at] / Math.hypot(1 + current.curve.re[at], current.curve.im[at]), drag: (x) => this.filter({ filterTime: between(0.001, 1 / x, 10) }) }];
      drawPlots(this.plots, this.process, shown, { ms, record: this.state.record, handles });
    }

    /* Announce the result and save the state in the address when no control moves. */
    announce() {
      clearTimeout(this.speaking);
      const s = this.current, name = s?.name, problem = this.problems[this.state.chosen];
      const numbers = !s ? "" : s.stable
        ? `${name}: IAE ${digits(s.iae)} for load, ${digits(s.iaeSetpoint)} for set point, Ms ${digits(s.ms)}, relative noise gain ${digits(s.sigma)}.`
        : `${name}: the loop is ${verdict(s)}.`;
      this.speaking = setTimeout(() => {
        plot.show(this.live, ...marked([problem && `${RULES[this.design.rule]?.name ?? "by hand"}: ${problem}.`, this.message, numbers].filter(Boolean).join(" ")));
        this.message = "";
        this.save();
      }, 250);
    }
  }

  globalThis.pidalabLab = { looksOf, slider, digits, drawPlots, drawTable, NUMBERS, known, verdict };
  const begin = () => { for (const host of document.querySelectorAll(".pidalab-lab")) host.lab = new Lab(host); };
  if (document.readyState === "loading") addEventListener("DOMContentLoaded", begin); else begin();
})();
