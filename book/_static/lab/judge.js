/* Judge answers to the book's tasks by their loops.

   judge(task, given) -> {right, say} or {refused, say}. `task` contains the data of the task's directive, and `given`
   the entries, as text or numbers. The script does not touch the page, so tests can call it.

   kind    number (which the page also computes), design (numbers that define a loop or a plant within limits),
           choice (one of several options, with a reason), order (a sequence of items)
   plant   key of a plant of the lab, or {gain, lags, integrating, delay, end}; the values are numbers, names of fields, or
           [products]. With plants, two plants by name, A.ms is the Ms of A
   loop    some of kp, ti, td, ta, Tf, n, for kp (1 + 1/(ti s) + td s + ta s²)/(1 + Tf s)^n. By default n is
           the number of derivatives plus 1. rule: a rule of the lab computes the gains. u0 limits u, with backward
           differences every h and the tracking time Tt. sampled: the loop of a digital controller with this sample time h
   fields  names of the values that the reader enters
   of, within   name of the requested fact, and relative tolerance of an answer. `value` is a closed form. `first` is a hint
           where to begin, for a wrong answer that no slip explains
   record  the model of a supplied record: the fields that describe it, and the sum of its times
   limits, least   largest and least values of facts; near: numbers that fields must be close to
   slips   reasons for wrong answers: {of or value or given or when, word} */
(globalThis.pidalabScripts ??= []).push(function () {
  "use strict";
  const { simulate, simulateSampled, margins } = globalThis.pidalabEngine;
  const { PLANTS, RULES, controller, iae, relativeNoiseGain, readNumber, sampledMargins } = globalThis.pidalabModel;

  const SLACK = 1.003; // answers are shown with three digits
  const POINTS = 2001;
  const LARGEST = 1e6, SMALLEST = 1e-6, FAR = 20;

  const digits = (x, count = 3) => (Number.isFinite(x) ? String(Number(x.toPrecision(count))) : "without bound");

  // --- facts of a loop ----------------------------------------------------------------------------------------------

  /* Return the plant of a task. A word in it is the name of a field, and a list is a product. */
  function plantOf(plant, given) {
    if (typeof plant === "string") return PLANTS[plant];
    const value = (x) => (Array.isArray(x) ? x.map(value).reduce((a, b) => a * b) : typeof x === "string" ? given[x] : x);
    let den = [1];
    for (const lag of (plant.lags ?? []).map(value)) if (lag) den = [...den, 0].map((c, i) => lag * c + (den[i - 1] ?? 0));
    if (plant.integrating) den.push(0);
    const delay = value(plant.delay ?? 0), sum = (plant.lags ?? []).map(value).reduce((a, b) => a + b, 0);
    return { num: [value(plant.gain ?? 1)], den, delay, end: plant.end ?? 8 * sum + 18 * delay + 1 };
  }

  function designOf({ kp = 1, ti = Infinity, td = 0, ta = 0, Tf = 0, n }) {
    const order = ta ? 2 : td ? 1 : 0;
    return { kind: ["PI", "PID", "PIDA"][order], kp, ti, td, ta, filterTime: Tf, filterOrder: Tf ? n ?? order + 1 : 0 };
  }

  const area = (t, y) => t.reduce((sum, time, k) => (k ? sum + 0.5 * (time - t[k - 1]) * (y[k] + y[k - 1]) : 0), 0);

  /* Return a function that computes facts of a loop by name. Each fact is computed once. */
  function loopFacts(plant, task, given) {
    const asked = { ...task.loop, ...given }, process = plantOf(plant, given), { end } = process, kept = new Map();
    const once = (name, make) => { if (!kept.has(name)) kept.set(name, make()); return kept.get(name); };
    const design = () => once("design", () => (asked.rule ? RULES[asked.rule].apply(process, { ...designOf(asked), kind: asked.kind }, asked.knob) : designOf(asked)));
    const own = () => once("own", () => controller(design()));
    const loop = () => once("loop", () => {
      try { design(); } catch (error) { if (asked.rule) return { stable: false }; throw error; } // the rule finds no design
      return asked.sampled ? sampledMargins({ process, controller: own(), sampleTime: asked.h, end }) : margins({ process, controller: own() });
    });
    const run = (step) => once(JSON.stringify(step), () => {
      const ask = { process, controller: own(), end, points: POINTS, ...step };
      return asked.u0 ? simulateSampled({ ...ask, controller: controller(design(), [-asked.u0, asked.u0]), sampleTime: asked.h, method: "backward", antiWindup: asked.way ?? "conditioning", trackingTime: asked.Tt }) : simulate(ask);
    });
    const load = () => run({ load: 1 }), step = () => run({ setpoint: 1 });
    const found = {
      noise: () => relativeNoiseGain(process, design()),
      // A response that ends early lacks a part of the area. The integral gain determines the whole area.
      iae: () => iae(load().t, load().y, 0) + Math.abs(Math.abs(1 / own().gains[0]) - Math.abs(found.ie())),
      ie: () => area(load().t, load().y),
      iaeSetpoint: () => iae(step().t, step().y, 1),
      ieSetpoint: () => area(step().t, step().y.map((y) => 1 - y)),
      overshoot: () => 100 * (Math.max(...step().y) - 1),
      kick: () => step().u[0],
      fall: () => { const { t, y } = load(), [from, to] = task.between.map((time) => t.findIndex((x) => x >= time - 1e-9)); return y[to] / y[from]; },
      saving: () => 1 - best(process, "PIDA", { ...task, ...given }) / best(process, "PID", { ...task, ...given }),
      // The IAE is divided by the least IAE of a PIDA with Ms 1.4 and a relative noise gain of 1.5.
      loss: () => found.iae() / best(process, "PIDA", { ms: 1.4, noise: 1.5 }),
      gmLeast: () => loop().ms / (loop().ms - 1),
    };
    return (name) => (name in found ? once(name, found[name]) : loop()[name]);
  }

  /* Return the least IAE of a kind of controller, by a search that takes a second. */
  const best = (process, kind, { ms, noise }) => globalThis.pidalabOptimum.find(process, kind, { ms, noise }).iae;

  function factsOf(task, given) {
    const loops = Object.entries(task.plants ?? { "": task.plant }).map(([name, plant]) => [name, loopFacts(plant, task, given)]), all = Object.fromEntries(loops);
    const [, first] = loops[0];
    return {
      names: task.plants ? Object.keys(task.plants) : [],
      of: (name) => { const [plant, fact] = name.split("."); return fact ? all[plant](fact) : first(plant); },
      stable: () => loops.filter(([, fact]) => !fact("stable")).map(([name]) => name),
    };
  }

  // --- words --------------------------------------------------------------------------------------------------------

  /* For each fact: its name, and what to say if it is too large or too small. */
  const WORDS = {
    ms: ["Ms", "too bold", "more robust than asked"],
    noise: ["relative noise gain", "too much noise: use a longer filter", "quieter than asked: use a shorter filter"],
    iae: ["IAE", "too slow", "less than is possible"],
    iaeSetpoint: ["IAE", "too slow", "less than is possible"],
    overshoot: ["overshoot", "the integral decreases too late", ""],
    dm: ["delay margin", "the loop tolerates more dead time than asked", "the loop tolerates too little dead time"],
    loss: ["IAE divided by the least IAE at Ms 1.4", "too slow", ""],
    saving: ["saving by acceleration", "acceleration still saves too much", "it saves less than required"],
  };
  const NO_SAVING = "A negative saving is possible. A PIDA needs a filter of third order, a PID a filter of second order. Here the longer filter costs more than acceleration saves.";
  const plantWords = (name) => (name.includes(".") ? `on ${name.split(".")[0]}, ` : "");
  const factWords = (name) => (WORDS[name.split(".").pop()] ?? [name, "too large", "too small"]);
  const shown = (name, x) => (name.endsWith("saving") ? `${Number((100 * x).toFixed(1)) || 0} %` : name.endsWith("overshoot") ? `${digits(x, 2)} %` : digits(x));

  const tells = (facts, name) => `${plantWords(name)}${factWords(name)[0]} ${shown(name, facts.of(name))}`;

  const CALMER = { kp: "less gain", ti: "a longer integral time", Tf: "another filter time", sensor: "a faster sensor", h: "a shorter sample time" };

  const upper = (text) => text.charAt(0).toUpperCase() + text.slice(1);

  /* Return a sentence for each violated limit. */
  function missed(task, facts) {
    const judged = (limits, side, keeps) => Object.entries(limits ?? {}).filter(([name, limit]) => !keeps(facts.of(name), limit)).map(([name, limit]) => {
      const own = side === 1 && task.words?.[name], margin = name.endsWith("ms") && side === 1 && facts.of(name.replace(/ms$/, "pm"));
      const why = factWords(name)[side];
      return upper(`${tells(facts, name)}, but at ${side === 1 ? "most" : "least"} ${shown(name, limit)} is ${side === 1 ? "allowed" : "required"}${why ? `: ${why}` : ""}${margin > 0 ? `; the phase margin is ${digits(margin, 2)}°` : ""}.${own ? ` ${own}` : ""}`);
    });
    const slack = (limit) => Math.abs(limit) * (SLACK - 1);
    return [...judged(task.limits, 1, (x, limit) => x <= limit + slack(limit)), ...judged(task.least, 2, (x, limit) => x >= limit - slack(limit))];
  }

  const close = (x, to, within) => Math.abs(x - to) <= within * Math.abs(to) + 1e-12;

  /* Return the hint for a wrong answer that the task foresees. */
  function slipOf(task, given, facts) {
    const fits = ({ of, value, given: entered, when }) => {
      if (when) return Object.entries(when).every(([name, [low, high]]) => facts.of(name) >= (low ?? -Infinity) && facts.of(name) <= (high ?? Infinity));
      if (entered) return Object.entries(entered).every(([name, x]) => (Array.isArray(x) ? JSON.stringify(given[name]) === JSON.stringify(x) : close(given[name], x, 0.03)));
      return close(given.answer, value ?? facts.of(of), task.within ?? 0.01);
    };
    return (task.slips ?? []).find(fits)?.word;
  }

  // --- the four kinds -----------------------------------------------------------------------------------------------

  function number(task, given) {
    const facts = task.plant ? factsOf(task, given) : null, key = task.value ?? facts.of(task.of), { answer } = given;
    const right = task.error === undefined ? close(answer, key, task.within) : Math.abs(answer - key) <= task.error;
    if (right) return { right, say: `Right: ${digits(task.error === undefined ? key : Number(key.toFixed(3)))}.` };
    const none = Math.abs(key) <= (task.error ?? 0); // the answer is 0
    const far = !none && (Math.abs(answer) > FAR * Math.abs(key) || Math.abs(answer) < Math.abs(key) / FAR) ? "Far too" : "Too";
    const off = !none && answer * key <= 0 ? `The answer is ${key > 0 ? "above" : "below"} 0.` : `${far} ${answer < key ? "small" : "large"}.`;
    return { right, say: slipOf(task, given, facts) ?? `${off}${task.first ? ` ${task.first}` : ""}` };
  }

  function design(task, given) {
    const facts = factsOf(task, given), shaky = task.edge ? [] : facts.stable();
    if (task.near) {
      const off = Object.entries(task.near).filter(([name, x]) => !close(given[name], x, task.within)).map(([name, x]) => `${name} is too ${given[name] < x ? "small" : "large"}`);
      if (off.length) return { right: false, say: [slipOf(task, given, facts) ?? `Not yet: ${off.join(", ")}.`, ...(shaky.length ? ["With these values the loop is unstable."] : [])].join(" ") };
      return { right: true, say: "Right." };
    }
    if (task.edge) {
      const at = (share) => { // a loop that cannot be simulated counts as unstable
        try { return factsOf(task, { ...given, [task.edge]: share * given[task.edge] }).stable().length === 0; } catch { return false; }
      };
      if (!at(1.03) && [0.5, 0.2, 0.05].some(at)) return { right: false, say: slipOf(task, given, facts) ?? "Unstable: the value is too large. With a smaller one the loop is stable." };
      if (!at(1.03)) return { right: false, say: slipOf(task, given, facts) ?? "Unstable: the value is too small." };
      if (at(0.97)) return { right: false, say: slipOf(task, given, facts) ?? "The loop is stable, but it is also stable with less." };
      if (!at(1)) return { right: false, say: "The value is within 3 per cent, but the loop is unstable: use a slightly larger value." };
      return { right: true, say: "Right: with 3 per cent less the loop is unstable." };
    }
    if (shaky.length && (task.loop || task.fields.includes("kp"))) {
      const where = facts.names.length ? ` on ${shaky.join(" and ")}` : "";
      return { right: false, say: slipOf({ ...task, slips: (task.slips ?? []).filter(({ given: entered }) => entered) }, given, facts) ?? `Unstable${where}: begin with ${task.fields.map((name) => CALMER[name]).filter(Boolean).join(", or ") || "another value"}.` };
    }
    if (task.record) { // compare with the model of the supplied record
      const { like, sum, is, within } = task.record, total = sum.reduce((all, name) => all + given[name], 0);
      const meant = Object.entries(like).every(([name, x]) => close(given[name], x, 0.2)) && close(total, is, 0.4);
      if (meant && !close(total, is, within)) return { right: false, say: `On the supplied record lags and dead time add up to about ${digits(is, 2)}; yours add up to ${digits(total)}. Fit the model again.` };
    }
    const over = missed(task, facts), names = [...new Set([...Object.keys(task.limits ?? {}), ...Object.keys(task.least ?? {})])];
    if (!over.length) return { right: true, say: `Right. ${upper(names.map((name) => tells(facts, name)).join(", "))}.${names.some((name) => name.endsWith("saving") && facts.of(name) < 0) ? ` ${NO_SAVING}` : ""}` };
    const slip = slipOf(task, given, facts);
    return { right: false, say: [...over, ...(slip ? [slip] : [])].join(" ") };
  }

  /* Return a fact for each option or item. Each has its own loop or plant. */
  const along = (task, items, fact) => items.map((item) => loopFacts(item.plant ?? task.plant, { ...task, loop: { ...task.loop, ...item.loop } }, {})(fact));

  function choice(task, given) {
    const { options, reasons, best: { fact, is } } = task, found = along(task, options, fact);
    const right = is === "last" ? found.lastIndexOf(true) : found.indexOf((is === "most" ? Math.max : Math.min)(...found));
    if (given.choice !== right) return { right: false, say: options[given.choice].word ?? "No." };
    if (reasons && !reasons[given.reason].right) return { right: false, say: `${upper(options[right].name)} is right, but not for this reason. ${reasons[given.reason].word ?? ""}`.trim() };
    const numbers = is === "last" ? "" : ` ${options.map(({ name }, k) => `${name} ${digits(found[k])}`).join(", ")}.`;
    return { right: true, say: `Right.${numbers}` };
  }

  function order(task, given) {
    const found = along(task, task.items, task.by), sorted = found.map((_, k) => k).sort((a, b) => (task.descending ? found[b] - found[a] : found[a] - found[b]));
    const names = (list) => list.map((k) => task.items[k].name).join(", ");
    const reason = task.reasons && !task.reasons[given.reason].right;
    if (given.order.every((k, place) => k === sorted[place])) {
      if (reason) return { right: false, say: `The order is right, but not for this reason. ${task.reasons[given.reason].word ?? ""}`.trim() };
      return { right: true, say: `Right: ${names(sorted)}, with ${sorted.map((k) => digits(found[k])).join(", ")}.` };
    }
    const place = given.order.findIndex((k, at) => k !== sorted[at]);
    return { right: false, say: slipOf(task, given, null) ?? `Not yet. ${place ? `${names(given.order.slice(0, place))} is right so far; c` : "C"}ompare ${task.items[given.order[place]].name} again with the others.` };
  }

  // --- entries ------------------------------------------------------------------------------------------------------

  const ZERO_TOO = new Set(["td", "ta", "t2", "t3", "L", "sensor"]);

  /* Return the entered values as numbers, or a sentence that says what is wrong with them. */
  function entered(task, given) {
    const numbers = {};
    for (const name of task.kind === "number" ? ["answer"] : task.kind === "design" ? task.fields : []) {
      const x = readNumber(given[name]), label = name === "answer" ? "The answer" : name;
      if (!Number.isFinite(x)) return `${label} must be a number, such as 1.5, 1,5, 3/2 or exp(−1). Found “${String(given[name] ?? "").trim().slice(0, 40)}”.`;
      if (name !== "answer" && !(x >= SMALLEST && x <= LARGEST) && !(x === 0 && ZERO_TOO.has(name))) return `${label} must be above 0 and at most a million. Found ${x}.`;
      numbers[name] = x;
    }
    if (task.kind === "choice" && !task.options[given.choice]) return "Choose one option.";
    if (task.kind === "order" && new Set(given.order.filter((k) => task.items[k])).size < task.items.length) return "Give each item one place.";
    if (task.reasons && !task.reasons[given.reason]) return "Choose a reason.";
    return numbers;
  }

  const KINDS = { number, design, choice, order };

  function judge(task, given) {
    const numbers = entered(task, given);
    if (typeof numbers === "string") return { right: false, refused: true, say: numbers };
    try { return KINDS[task.kind](task, { ...given, ...numbers }); } catch (error) { return { right: false, refused: true, say: `The page cannot judge this: ${error.message}.` }; }
  }

  globalThis.pidalabJudge = { judge, facts: (task, given) => factsOf(task, given).of, alongItems: along };
});
globalThis.pidalabScripts.at(-1)();
