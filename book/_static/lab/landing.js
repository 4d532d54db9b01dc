/* The figure of the first page. The reader drags a dot along the curve of the IAE that acceleration saves, and so chooses a
   limit of noise. The figure shows the best PI, PID and PIDA loops at that limit. The page contains their gains in JSON. This
   script simulates the loops. */
(function () {
  "use strict";
  const { simulate, simulateSampled } = globalThis.pidalabEngine, { uniform } = globalThis.pidalabModel;
  const draw = globalThis.pidalabPlot, { element, marked } = draw, KINDS = { PI: 4, PID: 1, PIDA: 0 }; // kinds, and the numbers of their colours and dashes
  const PROCESS = { num: [1], den: [1, 3, 3, 1], delay: 1 }, FINE = 10; // steps of a loop while a value of the noise is held

  class Landing {
    constructor(host) {
      Object.assign(this, JSON.parse(host.querySelector("script").textContent));
      this.k = this.limits.indexOf(1.5);
      this.saved = this.limits.map((_, k) => 100 * (1 - this.PIDA[k][0] / this.PID[k][0]));
      this.runs = this.limits.map(() => null);
      const h = this.sample / FINE, rough = uniform(this.noise, Math.ceil(this.end / this.sample) + 1);
      this.dice = Float64Array.from({ length: Math.round(this.end / h) + 1 }, (_, k) => rough[Math.floor(k / FINE)]);
      this.plots = ["saved", "y", "u"].map(() => element("div"));
      this.bar = element("input", { type: "range", id: "landing-noise", min: 0, max: this.limits.length - 1, oninput: () => this.turn(Number(this.bar.value)) });
      this.words = element("p", { class: "lab-live", role: "status" });
      const label = element("label", { for: this.bar.id }, "Noise allowed in u: drag this, or the dot");
      const [saved, y, u] = this.plots, side = element("div", { class: "landing-side" }, element("div", { class: "landing-knob" }, label, this.bar), this.words);
      host.replaceChildren(element("div", { class: "lab-plots" }, saved, y, side, u));
      this.turn(this.k);
    }

    /* Return output without noise and control signal with noise, for the three loops at one limit. */
    run(k) {
      return Object.entries(KINDS).map(([kind, look]) => {
        const gains = this[kind][k].slice(1, -1), controller = { gains, filterTime: this[kind][k].at(-1), filterOrder: gains.length - 1 };
        const asked = { process: PROCESS, controller, end: this.end, load: 1 };
        const calm = simulate({ ...asked, points: 401 });
        const loud = simulateSampled({ ...asked, sampleTime: this.sample / FINE, noise: this.dice });
        return { look, kind, y: { x: calm.t, y: calm.y }, u: { x: loud.t, y: loud.u } };
      });
    }

    turn(k) {
      this.k = k;
      const runs = (this.runs[k] ??= this.run(k)), [saved, y, u] = this.plots, time = { label: "time after a step of the load", range: [0, this.end] };
      const drag = (x) => this.turn(this.limits.reduce((best, limit, i) => (Math.abs(Math.log(limit / x)) < Math.abs(Math.log(this.limits[best] / x)) ? i : best), 0));
      const [[quiet, few], [loud, many]] = this.median;
      draw(saved, {
        title: "IAE saved by acceleration, %", x: { label: "relative noise gain that is allowed", log: true, range: [0.09, 5.6] }, y: { range: [0, 35] },
        lines: [
          { x: this.limits, y: this.saved, kind: 0 },
          ...[[quiet, few], [loud, many]].map(([at, value]) => ({ x: [at / 1.12, at * 1.12], y: [value, value], kind: "median" })),
        ],
        notes: [
          { x: quiet, y: few, words: `134 plants: ${Math.round(few)} %` },
          { x: loud, y: many, anchor: "end", words: `median of 134 plants: ${Math.round(many)} %` },
          { x: this.limits[k], y: this.saved[k], anchor: k > 8 ? "end" : "start", below: true, words: `this plant: ${Math.round(this.saved[k])} %` },
        ],
        handles: [{ x: this.limits[k], y: this.saved[k], label: "Drag: the noise allowed", drag }],
      });
      const lines = (key) => runs.map((run) => ({ ...run[key], kind: run.look, name: run.kind }));
      draw(y, { title: "Output y", x: time, y: { range: [-0.1, 0.85] }, lines: lines("y") });
      draw(u, { title: "Control signal u, with noise", x: time, y: { range: [-1.6, 0.4] }, lines: lines("u") });
      this.bar.value = k;
      this.bar.setAttribute("aria-valuetext", `relative noise gain ${this.limits[k]}`);
      // The controller does not use a limit if a lower limit gives the same controller.
      const idle = ["PI", "PID"].filter((kind) => k && this[kind][k][0] === this[kind][k - 1][0]);
      const key = (kind) => element("span", { class: "landing-key" }, element("span", { class: `lab-key lab-key-${KINDS[kind]}` }), ` ${kind} ${this[kind][k][0].toFixed(2)}`);
      this.words.replaceChildren(`Relative noise gain ${this.limits[k]}. IAE:`,
        ...Object.keys(KINDS).flatMap((kind) => [" ", key(kind)]), element("span", {}, ...marked(`. At the same Ms of ${this.ms}, acceleration saves ${Math.round(this.saved[k])} % of the IAE of PID.${idle.length ? ` ${idle.join(" and ")} cannot use this much noise.` : ""}`)));
    }
  }

  const begin = () => { for (const host of document.querySelectorAll(".pidalab-landing")) host.figure = new Landing(host); };
  if (document.readyState === "loading") addEventListener("DOMContentLoaded", begin); else begin();
})();
