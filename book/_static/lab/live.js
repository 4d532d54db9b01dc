/* Live figures: a <div class="pidalab-live"> of a page becomes a figure with controls. Readers without JavaScript see the
   content of the div. If this is a figure with a caption, controls and plots replace its image. The figure keeps its number,
   and its caption unless the live figure has one. The options are JSON, in the attribute data-live or in a
   script inside the div (`pidalab.plots.live` writes such a script):

     plant     key of a plant, or {num, den, delay, end}
     designs   list of designs: {kind, kp, ti, td, ta, filterTime, filterOrder}
     names     names of the designs, in the same order; by default their kinds
     rule, ms, tc   a rule of the lab that computes each design, and its parameter; a design may have its own `ms` or `tc`
     conditions     {limits, antiWindup, trackingTime, sampleTime, noise, end}; a design may have its own `conditions`
     knobs     list of {key, label, low, high, log, step}; key is a field of the designs ("kp", "filterTime", …), or "ms", "tc",
               "plant.delay", "limits.high", "sampleTime" or "noise"; a field is set in all designs, or in design number `design`
     plots     names out of setpoint, load, control, effort, nyquist, bode, closed, lead, noise
     numbers   names out of iae, iaeSetpoint, overshoot, ms, mks, gm, gmLeast, pm, pmLeast, dm, peak, sigma, first, hump (the
               last two come last because they also exist for unstable loops)
     caption   the caption of the live figure; `lab: true` adds a link to the lab, which loads these designs */
(function () {
  "use strict";
  const { PLANTS, RULES, study, write } = globalThis.pidalabModel;
  const { slider, digits, drawPlots, drawTable, looksOf, known, verdict } = globalThis.pidalabLab;
  const { element, marked } = globalThis.pidalabPlot;

  class Live {
    constructor(host) {
      this.host = host;
      this.state = JSON.parse(host.dataset.live ?? host.querySelector("script[type='application/json']").textContent);
      const { plant } = this.state;
      this.process = { ...(typeof plant === "string" ? PLANTS[plant] : plant) };
      this.state.conditions ??= {};
      this.build();
      this.draw();
    }

    /* Return the object and the field that a knob changes. */
    places({ key, design }) {
      const { state } = this, [first, second] = key.split(".");
      if (first === "plant") return [[this.process, second]];
      if (first === "limits") { // a knob for both limits sets the lower limit to the negative value
        const limits = (state.conditions.limits ??= [-1e9, 1e9]), low = { get 0() { return limits[0]; }, set 0(x) { limits[0] = -x; } };
        return second ? [[limits, second === "low" ? 0 : 1]] : [[limits, 1], [low, 0]];
      }
      if ((key === "ms" || key === "tc") && design === undefined) return [[state, key]];
      if (["trackingTime", "sampleTime", "noise", "end"].includes(key)) return [[state.conditions, key]];
      const designs = design === undefined ? state.designs : [state.designs[design]];
      return designs.map((each) => [each, key]);
    }

    build() {
      const { state } = this;
      this.knobs = (state.knobs ?? []).map((knob) => {
        const places = this.places(knob);
        return slider({
          ...knob, get: () => places[0][0][places[0][1]],
          set: (value) => { for (const [object, key] of places) object[key] = value; this.later(); },
        });
      });
      this.plots = Object.fromEntries(state.plots.map((key) => [key, element("div")]));
      this.table = element("div", { class: "lab-table", tabindex: 0, role: "region", "aria-label": "Numbers of the figure" });
      this.trouble = element("span", { class: "lab-trouble" });
      this.heard = element("span", { class: "lab-heard" }); // screen readers announce a change of text, but not of a label
      this.live = element("p", { class: "lab-live", role: "status" }, this.trouble, " ", this.heard);
      this.host.addEventListener("lab-refused", ({ detail }) => { this.trouble.textContent = detail; });
      const caption = element("p", { class: "lab-caption" }, ...marked(state.caption ?? ""));
      if (state.lab) caption.append(" ", (this.link = element("a", {}, "Open in the lab.")));
      const plots = Object.values(this.plots), odd = plots.length > 1 && plots.length % 2; // after an odd number of plots, the table fills the last place
      const grid = element("div", { class: "lab-plots" }, ...plots, ...(odd ? [this.table] : []));
      const parts = [element("div", { class: "lab-knobs" }, ...this.knobs), this.live, grid, ...(odd ? [] : [this.table])];
      const figure = this.host.querySelector("figure");
      if (!figure) return this.host.replaceChildren(...parts, caption);
      for (const picture of figure.querySelectorAll("img")) picture.remove();
      figure.prepend(...parts);
      for (const fold of this.host.querySelectorAll("details.above-input")) fold.remove(); // the code of the replaced image
      const words = figure.querySelector(".caption-text") ?? figure.querySelector("figcaption");
      if (state.caption && words) words.replaceChildren(element("span", {}, ...marked(state.caption)));
      if (words && this.link) words.append(" ", this.link);
    }

    later() { if (!this.waiting) this.waiting = requestAnimationFrame(() => { this.waiting = 0; this.draw(); }); }

    draw() {
      const { state } = this, rule = RULES[state.rule ?? "hand"];
      const end = state.conditions.end ?? this.process.end, made = [], shown = [], trouble = [], looks = looksOf(state.designs.map((design) => design.kind));
      this.process.end = end;
      state.designs.forEach((design, kind) => {
        try { made.push({ kind, design: rule.apply(this.process, design, design[rule.knob] ?? state[rule.knob]) }); } catch (error) { trouble.push(`${state.names?.[kind] ?? design.kind}: ${error.message}.`); }
      });
      made.forEach(({ kind, design }) => {
        try {
          shown.push({ ...study(this.process, design, { ...state.conditions, end, ...design.conditions }), kind, look: looks[kind], name: state.names?.[kind] ?? design.kind });
        } catch (error) { trouble.push(`${state.names?.[kind] ?? design.kind}: ${error.message}.`); }
      });
      for (const knob of this.knobs) knob.refresh();
      drawPlots(this.plots, this.process, shown, { ms: shown.map((s) => s.design.ms ?? (rule.knob === "ms" ? state.ms : s.ms)) });
      const keys = state.numbers ?? ["iae", "ms", "sigma"];
      if (shown.length) drawTable(this.table, "loop", this.process, shown, keys);
      else this.table.replaceChildren();
      if (this.link && shown[0]) this.link.href = `${this.root()}book/lab.html#${write(this.forLab(shown))}`;
      clearTimeout(this.speaking);
      const words = shown.map((s) => `${s.name}: ${s.stable ? "" : `${verdict(s)}, `}${known(s, keys).map(([name, get]) => `${name} ${digits(get(s))}`).join(", ")}.`);
      this.speaking = setTimeout(() => { this.trouble.textContent = trouble.join(" "); this.heard.textContent = words.join(" "); }, 250);
    }

    /* Return the same state for the lab: all designs by name with their limits, for the present plant. */
    forLab(shown) {
      const { sampleTime, noise } = { ...this.state.conditions, ...shown[0].design.conditions };
      const designs = shown.map(({ name, design: { conditions, ...design } }) => {
        const { limits, antiWindup, trackingTime } = { ...this.state.conditions, ...conditions };
        return {
          ...design, ...(name === design.kind ? {} : { name }), ...(limits ? { limited: true, low: limits[0], high: limits[1] } : {}),
          ...(antiWindup ? { antiWindup } : {}), ...(trackingTime ? { trackingTime } : {}),
        };
      });
      const { num, den, delay, end } = this.process, untouched = PLANTS[this.state.plant]?.delay === delay && PLANTS[this.state.plant].end === end;
      return {
        ...(untouched ? { plant: this.state.plant } : { plant: "given", given: { num, den, delay, end } }), designs,
        ...(sampleTime ? { sampled: true, sampleTime } : {}), ...(noise ? { noisy: true, noise } : {}),
      };
    }

    root() { return document.documentElement.dataset.content_root || "./"; }
  }

  const begin = () => { for (const host of document.querySelectorAll(".pidalab-live")) host.figure = new Live(host); };
  if (document.readyState === "loading") addEventListener("DOMContentLoaded", begin); else begin();
})();
