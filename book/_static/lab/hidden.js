/* Hidden plants: each <div class="pidalab-hidden"> becomes ten plants whose models the page does not show. The learner makes
   a noisy step test and sets the gains within a time limit. The gains are judged with the true plant. The browser stores the
   score. */
(globalThis.pidalabScripts ??= []).push(function () {
  "use strict";
  const { simulate, margins, respond } = globalThis.pidalabEngine;
  const { controller, iae, noiseScale, relativeNoiseGain } = globalThis.pidalabModel;
  const MS = 1.6, NOISE = 1, SLACK = 1.003, KEY = "step first, then look"; // limits, with a tolerance for answers of three digits
  const SAMPLES = 300, SHARE = 0.02; // number of samples of a step test, and its noise relative to the change

  function plantOf(name) {
    const bytes = globalThis.pidalabHiddenData[name].match(/../g).map((pair) => parseInt(pair, 16));
    return JSON.parse(bytes.map((byte, k) => String.fromCharCode(byte ^ KEY.charCodeAt(k % KEY.length))).join(""));
  }

  /* Return a record {t, u, y} from an arbitrary level, with a unit step of u after a twentieth of the time. */
  function stepTest(name, random) {
    const plant = plantOf(name), h = plant.end / SAMPLES, u = Array.from({ length: SAMPLES + 1 }, (_, k) => (k >= SAMPLES / 20 ? 1 : 0));
    const clean = respond(plant, u, h), size = Math.max(...clean.map(Math.abs)), level = 3 * size * random();
    return { t: u.map((_, k) => k * h), u, y: Array.from(clean, (y) => level + y + SHARE * size * (random() + random() + random() - 1.5)) };
  }

  /* Judge a controller {kp, ti, td, ta, Tf} on the true plant. The least IAE of a PIDA gives 100 points. */
  function judged(name, { kp, ti, td, ta, Tf }) {
    const plant = plantOf(name), { num, den, delay } = plant, process = { num, den, delay }, kind = ta ? "PIDA" : td ? "PID" : "PI";
    const design = { kind, kp, ti, td, ta, filterTime: Tf, filterOrder: { PI: 1, PID: 2, PIDA: 3 }[kind] };
    if (!(ti > 0) || !(Tf >= 0) || td < 0 || ta < 0) return { points: 0, say: "ti must be above 0; td, ta and Tf must be at least 0." };
    if (!Tf && kind !== "PI") return { points: 0, say: "A derivative needs a filter: give a filter time above 0." };
    const found = margins({ process, controller: controller(design) });
    if (!found.stable) return { points: 0, say: kp * gainSign(plant) < 0 ? "Unstable: the gain of the plant has the other sign." : "Unstable on the true plant: use less gain." };
    const noise = relativeNoiseGain(process, design), t = respondTo(process, design, plant), points = Math.round(100 * Math.min(1, plant.iae / t));
    const facts = `Ms ${found.ms.toPrecision(3)}, relative noise gain ${noise.toPrecision(3)}, IAE ${t.toPrecision(3)}, ${(t / plant.iae).toPrecision(3)} times the least possible.`;
    if (!(found.ms <= MS * SLACK)) return { points: 0, say: `${facts} No points: Ms must be at most ${MS}: use less gain.` };
    if (!(noise <= NOISE * SLACK)) return { points: 0, say: `${facts} No points: the relative noise gain must be at most ${NOISE}: use a longer filter or less derivative action.` };
    return { points, say: `${facts} ${points} points.` };
  }

  const gainSign = ({ num, den }) => Math.sign(num[num.length - 1] * den[den.findLastIndex((c) => c !== 0)]);

  /* Return the IAE after a unit load step: until the loop is at rest, and the remainder from the integral of the error. */
  function respondTo(process, design, { end }) {
    const own = controller(design), run = simulate({ process, controller: own, end: 4 * end, points: 4001, load: 1 });
    const area = run.y.reduce((sum, y, k) => (k ? sum + 0.5 * (run.t[k] - run.t[k - 1]) * (y + run.y[k - 1]) : 0), 0);
    return iae(run.t, run.y, 0) + Math.abs(Math.abs(1 / own.gains[0]) - Math.abs(area));
  }

  globalThis.pidalabHidden = { plantOf, stepTest, judged, names: () => Object.keys(globalThis.pidalabHiddenData), scale: (name) => noiseScale(plantOf(name)) };
});
globalThis.pidalabScripts.at(-1)();

if (typeof document !== "undefined") (function () {
  "use strict";
  const { names, stepTest, judged, plantOf } = globalThis.pidalabHidden, { readNumber } = globalThis.pidalabModel;
  const plot = globalThis.pidalabPlot, { element, marked } = plot, KEY = "pidalab-hidden";
  const FIELDS = [["kp", "gain"], ["ti", "integral time"], ["td", "derivative time, or 0"], ["ta", "acceleration, or 0"], ["Tf", "filter time"]];
  const LIMITS = [5, 10, 20], CLEAR = "Forget all scores";

  const recall = () => { try { return JSON.parse(localStorage.getItem(KEY)) ?? {}; } catch { return {}; } };
  const keep = (scores) => { try { localStorage.setItem(KEY, JSON.stringify(scores)); } catch { /* then the page keeps the score until it is left */ } };
  const button = (text, onclick) => element("button", { type: "button", class: "lab-button", onclick }, text);

  class Hidden {
    constructor(host) {
      this.host = host;
      this.scores = recall();
      this.name = names()[0];
      this.select = element("select", { id: "hidden-plant", onchange: () => this.choose(this.select.value) }, ...names().map((name) => element("option", { value: name }, name)));
      this.minutes = element("select", { id: "hidden-minutes" }, ...LIMITS.map((m) => element("option", { value: m }, `${m} minutes`)));
      this.clock = element("span", { class: "hidden-clock", role: "timer" });
      this.start = button("Take a step test", () => this.test());
      this.save = button("Save the record as CSV", () => this.download());
      this.plot = element("div");
      this.boxes = Object.fromEntries(FIELDS.map(([name]) => [name, element("input", { type: "text", inputmode: "decimal", autocomplete: "off", id: `hidden-${name}` })]));
      this.form = element("form", { class: "task-form", onsubmit: (event) => { event.preventDefault(); this.judge(); } },
        element("div", { class: "task-fields" }, ...FIELDS.map(([name, words]) => element("div", { class: "task-field" }, element("label", { for: `hidden-${name}` }, element("i", {}, name[0]), element("sub", {}, name.slice(1)), ` ${words}`), this.boxes[name]))),
        element("p", { class: "task-actions" }, element("button", { type: "submit", class: "lab-button" }, "Judge the controller")));
      this.said = element("p", { class: "task-verdict", role: "status" });
      this.table = element("div", { class: "lab-table", tabindex: 0, role: "region", "aria-label": "Your scores" });
      const row = (label, box) => element("div", { class: "lab-row lab-choice" }, element("label", { for: box.id }, label), box);
      host.replaceChildren(row("plant", this.select), row("time", this.minutes), element("p", { class: "task-actions" }, this.start, " ", this.save, " ", this.clock),
        this.plot, this.form, this.said, this.table, button(CLEAR, () => { this.scores = {}; keep(this.scores); this.show(); }));
      if (location.hash === "#teacher") this.sheet();
      this.choose(this.name);
    }

    choose(name) {
      this.name = name;
      this.record = null;
      clearInterval(this.ticking);
      this.clock.textContent = "";
      this.plot.hidden = this.form.hidden = this.save.hidden = true;
      plot.show(this.said);
      this.show();
    }

    /* Start the clock with the first test. A second test has different noise. */
    test() {
      const first = !this.record;
      this.record = stepTest(this.name, Math.random);
      this.plot.hidden = this.form.hidden = this.save.hidden = false;
      const { t, y } = this.record;
      plot(this.plot, { title: `Output of the ${this.name}, step of u by 1 at ${Number((t[t.length - 1] / 20).toPrecision(3))}`, x: { label: "time", range: [0, t[t.length - 1]] }, y: {}, lines: [{ x: t, y, kind: "dots", name: "y" }] });
      if (!first) return;
      this.until = Date.now() + 60000 * Number(this.minutes.value);
      clearInterval(this.ticking);
      const tick = () => {
        const left = Math.max(0, Math.round((this.until - Date.now()) / 1000));
        this.clock.textContent = left ? `${Math.floor(left / 60)}:${String(left % 60).padStart(2, "0")} left` : "The time is over.";
        if (!left) clearInterval(this.ticking);
      };
      tick();
      this.ticking = setInterval(tick, 1000);
    }

    judge() {
      if (Date.now() > this.until) return this.tell("The time is over: choose the plant again to start anew.", false);
      const given = {};
      for (const [name, words] of FIELDS) {
        const text = this.boxes[name].value.trim(), x = text ? readNumber(text) : name === "td" || name === "ta" ? 0 : NaN;
        if (!Number.isFinite(x) || Math.abs(x) > 1e9) return this.tell(`${name}, ${words}, must be a number, such as 2.5, 2,5 or 5/2.`, false);
        given[name] = x;
      }
      try {
        const { points, say } = judged(this.name, given), before = this.scores[this.name] ?? { points: 0, tries: 0 };
        this.scores[this.name] = { points: Math.max(points, before.points), tries: before.tries + 1 };
        keep(this.scores);
        this.tell(say, points > 0);
        this.show();
      } catch (error) { this.tell(`The page cannot judge this: ${error.message}.`, false); }
    }

    tell(words, right) {
      this.said.className = `task-verdict task-${right ? "right" : "wrong"}`;
      plot.show(this.said, ...marked(words));
    }

    download() {
      const { t, u, y } = this.record, rows = t.map((time, k) => [time, u[k], y[k]].map((x) => Number(x.toPrecision(5))).join(","));
      const link = element("a", { download: `${this.name.replace(/ /g, "_")}.csv`, href: URL.createObjectURL(new Blob([["time,u,y", ...rows].join("\n")], { type: "text/csv" })) });
      link.click();
      URL.revokeObjectURL(link.href);
    }

    show() {
      const rows = names().map((name) => [name, this.scores[name]]), sum = rows.reduce((all, [, score]) => all + (score?.points ?? 0), 0);
      plot.show(this.table, ["table", {}, ["thead", {}, ["tr", {}, ["th", { scope: "col" }, "plant"], ["th", { scope: "col" }, "points"], ["th", { scope: "col" }, "tries"]]],
        ["tbody", {}, ...rows.map(([name, score]) => ["tr", {}, ["th", { scope: "row" }, name], ["td", {}, score ? String(score.points) : "–"], ["td", {}, score ? String(score.tries) : "–"]]),
          ["tr", {}, ["th", { scope: "row" }, "sum, of 1000"], ["td", {}, String(sum)], ["td", {}, ""]]]]);
    }

    /* Show the plants and their best controllers, for teachers. */
    sheet() {
      const short = (x) => String(Number(x.toPrecision(3))), list = (values) => values.map(short).join(", ");
      const rows = names().map((name) => {
        const { num, den, delay, best: { gains: [ki, kp, kd, ka], filterTime }, iae } = plantOf(name);
        return ["tr", {}, ["th", { scope: "row" }, name], ...[`[${list(num)}] / [${list(den)}], dead time ${delay}`, `kp ${short(kp)}, ti ${short(kp / ki)}, td ${short(kd / kp)}, ta ${short(ka / kp)}, Tf ${short(filterTime)}`, short(iae)].map((words) => ["td", {}, ...marked(words)])];
      });
      const place = element("div", { class: "lab-table" });
      plot.show(place, ["table", {}, ["thead", {}, ["tr", {}, ...["plant", "model", "best PIDA", "its IAE"].map((words) => ["th", { scope: "col" }, words])]], ["tbody", {}, ...rows]]);
      this.host.append(place);
    }
  }

  const begin = () => { for (const host of document.querySelectorAll(".pidalab-hidden")) host.hiddenPlants = new Hidden(host); };
  if (document.readyState === "loading") addEventListener("DOMContentLoaded", begin); else begin();
})();
