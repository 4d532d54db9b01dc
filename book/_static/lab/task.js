/* Tasks: a <div class="pidalab-task"> with its data in a script gets fields, a button and a verdict. The hint unfolds after the
   second wrong try, and the answer after the third. The browser stores entries and solved tasks. A <div class="pidalab-steps">
   shows its tasks one at a time. */
(function () {
  "use strict";
  const { judge } = globalThis.pidalabJudge;
  const { write } = globalThis.pidalabModel;
  const { element, marked, show } = globalThis.pidalabPlot;
  const HINT_AFTER = 2, ANSWER_AFTER = 3;

  /* For each field: a letter, its index, and words. */
  const FIELDS = {
    answer: ["", "", "Your answer"], kp: ["k", "p", "gain"], ti: ["t", "i", "integral time"], td: ["t", "d", "derivative time"],
    ta: ["t", "a", "acceleration, a time squared"], Tf: ["T", "f", "filter time"], Tt: ["T", "t", "tracking time"], h: ["h", "", "sample time"],
    T: ["T", "", "lag"], L: ["L", "", "dead time"], sensor: ["T", "s", "lag of the sensor"], noise: ["", "", "largest relative noise gain"],
    K: ["K", "", "gain of the plant"], t1: ["T", "1", "first lag"], t2: ["T", "2", "second lag, or 0"], t3: ["T", "3", "third lag, or 0"],
  };

  // --- storage, which a browser may refuse --------------------------------------------------------------------------

  const keyOf = (label) => `pidalab-${label}`;
  function recall(label) {
    try { return JSON.parse(localStorage.getItem(keyOf(label))) ?? {}; } catch { return {}; }
  }
  function keep(label, state) {
    try { localStorage.setItem(keyOf(label), JSON.stringify(state)); } catch { /* then the page keeps entries until it is left */ }
  }

  // --- searches, in a worker, since they take a second-------------------------------------------------------------------

  const WORK = "onmessage = ({ data: { task, given } }) => postMessage(pidalabJudge.judge(task, given));";
  function judged(task, given) {
    if (!task.search) return Promise.resolve(judge(task, given));
    const optima = `globalThis.pidalabOptima = ${JSON.stringify(globalThis.pidalabOptima)};`;
    const source = [optima, ...globalThis.pidalabScripts.map((script) => `(${script})();`), WORK].join("\n");
    return new Promise((done) => {
      const worker = new Worker(URL.createObjectURL(new Blob([source], { type: "text/javascript" })));
      worker.onmessage = ({ data }) => { worker.terminate(); done(data); };
      worker.onerror = (error) => { worker.terminate(); done({ refused: true, say: `The search failed: ${error.message}` }); };
      worker.postMessage({ task, given });
    });
  }

  // --- fields: each kind makes them, reads them and fills them in ---------------------------------------------------

  const radios = (name, legend, words, id) => {
    const boxes = words.map((_, k) => element("input", { type: "radio", name: `${id}-${name}`, value: k }));
    const rows = words.map((word, k) => element("label", { class: "task-option" }, boxes[k], " ", ...marked(word)));
    return {
      parts: element("fieldset", { class: "task-choice" }, element("legend", {}, legend), ...rows),
      read: () => boxes.findIndex((box) => box.checked), fill: (k) => { if (boxes[k]) boxes[k].checked = true; },
    };
  };

  function numberField(name, task) {
    const id = `${task.label}-${name}`, [letter, index, words] = FIELDS[name], start = task.start?.[name];
    const box = element("input", { type: "text", inputmode: "decimal", autocomplete: "off", id, ...(start === undefined ? {} : { value: start }) });
    const label = element("label", { for: id });
    if (letter) label.append(element("i", {}, letter), ...(index ? [element("sub", {}, index)] : []), " ");
    label.append(name === "answer" && task.ask ? task.ask : words);
    return { name, parts: element("div", { class: "task-field" }, label, box), read: () => box.value, fill: (x) => { box.value = x; } };
  }

  function placesOf(task) {
    const selects = task.items.map((_, place) => {
      const id = `${task.label}-place-${place}`, none = element("option", { value: "" }, "–");
      const select = element("select", { id }, none, ...task.items.map(({ name }, k) => element("option", { value: k }, name)));
      return { select, parts: element("div", { class: "task-field" }, element("label", { for: id }, `${place + 1}.`), select) };
    });
    return {
      name: "order", parts: element("div", { class: "task-fields", role: "group", "aria-label": "The order" }, ...selects.map(({ parts }) => parts)),
      read: () => selects.map(({ select }) => (select.value === "" ? -1 : Number(select.value))),
      fill: (order) => selects.forEach(({ select }, place) => { select.value = order[place] >= 0 ? order[place] : ""; }),
    };
  }

  function fieldsOf(task) {
    const reasons = task.reasons ? [{ name: "reason", ...radios("reason", "Why?", task.reasons.map(({ text }) => text), task.label) }] : [];
    if (task.kind === "choice") return [{ name: "choice", ...radios("choice", task.ask ?? "Which?", task.options.map(({ name }) => name), task.label) }, ...reasons];
    if (task.kind === "order") return [placesOf(task), ...reasons];
    return (task.kind === "number" ? ["answer"] : task.fields).map((name) => numberField(name, task));
  }

  // --- one task -----------------------------------------------------------------------------------------------------

  class Task {
    constructor(host) {
      this.host = host;
      this.task = JSON.parse(host.querySelector("script[type='application/json']").textContent);
      this.state = { tries: 0, solved: false, ...recall(this.task.label) };
      this.fields = fieldsOf(this.task);
      this.build();
      for (const field of this.fields) if (this.state.given && field.name in this.state.given) field.fill(this.state.given[field.name]);
      if (this.state.solved) this.show({ right: true, say: "Solved." });
    }

    build() {
      this.verdict = element("p", { class: "task-verdict", role: "status" });
      this.badge = element("span", { class: "task-badge" });
      this.host.querySelector(".task-title").append(" ", this.badge);
      const numbers = this.fields.every(({ read }) => typeof read() === "string"), parts = this.fields.map(({ parts }) => parts);
      const actions = element("p", { class: "task-actions" }, element("button", { type: "submit", class: "lab-button" }, "Check"));
      if (this.task.lab) actions.append(" ", element("a", { href: this.labAddress() }, "Open in the lab"));
      this.form = element("form", { class: "task-form", onsubmit: (event) => { event.preventDefault(); this.check(); } },
        ...(numbers ? [element("div", { class: "task-fields" }, ...parts)] : parts), actions, this.verdict);
      this.form.noValidate = true;
      this.host.querySelector(".task-room").replaceChildren(this.form);
    }

    labAddress() { return `${document.documentElement.dataset.content_root || "./"}book/lab.html#${write(this.task.lab)}`; }

    async check() {
      if (this.busy) return;
      this.busy = true;
      const given = Object.fromEntries(this.fields.map(({ name, read }) => [name, read()]));
      if (this.task.search) this.show({ busy: true, say: "Searching for the best controllers takes a second or two." });
      const found = await judged(this.task, given);
      this.busy = false;
      if (!found.refused && !this.state.solved) this.state.tries++;
      this.state.given = given;
      this.state.solved ||= found.right;
      keep(this.task.label, this.state);
      this.show(found);
      if (found.right) this.host.dispatchEvent(new CustomEvent("solved", { bubbles: true }));
    }

    /* Show the verdict, and unfold hint and answer if they are due. */
    show({ right, refused, busy, say }) {
      const { tries, solved } = this.state, missed = !right && !refused && !busy;
      this.verdict.className = `task-verdict task-${busy ? "busy" : refused ? "refused" : right ? "right" : "wrong"}`;
      const next = !missed || solved ? "" : tries === HINT_AFTER ? " A hint is below." : tries === ANSWER_AFTER ? " The answer is below." : "";
      show(this.verdict, ...marked(`${say}${next}`));
      this.badge.textContent = solved ? "✓ solved" : "";
      if (missed && !solved && tries >= HINT_AFTER) this.host.querySelector(".task-hint").open = true;
      if (missed && !solved && tries >= ANSWER_AFTER) this.host.querySelector(".task-answer").open = true;
    }
  }

  // --- several, one at a time ---------------------------------------------------------------------------------------

  class Steps {
    constructor(host) {
      this.tasks = [...host.querySelectorAll(".pidalab-task")];
      this.buttons = this.tasks.map((task, k) => element("button", { type: "button", class: "lab-button task-step", onclick: () => this.go(k) }));
      this.next = element("button", { type: "button", class: "lab-button", onclick: () => { this.go(this.at + 1); this.tasks[this.at].querySelector("input, select")?.focus(); } }, "Next question");
      host.prepend(element("nav", { class: "task-steps", "aria-label": "Questions" }, ...this.buttons));
      host.append(element("p", { class: "task-actions" }, this.next));
      host.addEventListener("solved", () => this.go(this.at));
      const named = this.tasks.findIndex(({ id }) => `#${id}` === location.hash), open = this.tasks.findIndex(({ task }) => !task.state.solved);
      this.go(Math.max(named >= 0 ? named : open, 0));
      addEventListener("hashchange", () => { const k = this.tasks.findIndex(({ id }) => `#${id}` === location.hash); if (k >= 0) this.go(k); });
    }

    go(at) {
      this.at = at;
      this.tasks.forEach((task, k) => {
        const { solved } = task.task.state;
        task.classList.toggle("task-away", k !== at);
        this.buttons[k].textContent = `${k + 1}${solved ? " ✓" : ""}`;
        this.buttons[k].setAttribute("aria-label", `Question ${k + 1}${solved ? ", solved" : ""}`);
        if (k === at) this.buttons[k].setAttribute("aria-current", "step"); else this.buttons[k].removeAttribute("aria-current");
      });
      this.next.hidden = at + 1 >= this.tasks.length;
    }
  }

  const begin = () => {
    for (const host of document.querySelectorAll(".pidalab-task")) host.task = new Task(host);
    for (const host of document.querySelectorAll(".pidalab-steps")) host.steps = new Steps(host);
  };
  if (document.readyState === "loading") addEventListener("DOMContentLoaded", begin); else begin();
})();
