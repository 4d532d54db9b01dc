/* Show a lecture as slides if its address ends in #slides. A slide has a heading with its figures, formulas, lists, results
   and tasks. Running text and code are notes. Arrow and page keys move, N shows the notes, D changes between light and dark,
   Escape returns to the page. */
(function () {
  "use strict";
  if (!location.hash.startsWith("#slides")) return;
  const PICTURE = ".pidalab-live, .cell:has(figure)", OWN = ".pidalab-task, .exercise";
  const SHOWN = `${PICTURE}, ${OWN}, .solution, .math, ul, ol, .pst-scrollable-table-container, .cell:has(.cell_output)`;
  const root = document.documentElement, stage = document.createElement("div");
  const slides = [], nav = document.createElement("nav"), place = document.createElement("output");
  let heading = null, now = 0;

  /* Return headings and blocks in the order of the page, without the sections that contain them. */
  const blocksOf = (section) => [...section.children].flatMap((one) => (one.matches("section") ? blocksOf(one) : one));

  function begin() {
    const slide = document.createElement("section");
    slide.className = "slide bd-content";
    if (heading) slide.append(heading.cloneNode(true));
    stage.append(slide);
    slides.push(slide);
  }

  const has = (what) => slides.at(-1).querySelector(`:scope > :is(${what})`);
  for (const block of blocksOf(document.querySelector("article.bd-article > section"))) {
    if (block.matches("h1, h2, h3")) {
      heading = block;
      begin();
      continue;
    }
    // A figure and a task have separate slides.
    if (block.matches(SHOWN) && (has(PICTURE) || (has(".shown") && block.matches(`${PICTURE}, ${OWN}`)))) begin();
    block.classList.add(block.matches(SHOWN) ? "shown" : "notes");
    slides.at(-1).append(block); // a copy of a live figure would not work
  }
  for (const slide of slides) { // text without anything else is the slide itself, not a note
    if (!slide.querySelector(":scope > .shown")) slide.querySelectorAll(":scope > p").forEach((one) => one.classList.remove("notes"));
  }

  function go(to) {
    now = Math.max(0, Math.min(slides.length - 1, to));
    slides.forEach((slide, k) => { slide.classList.toggle("now", k === now); slide.inert = k !== now; });
    place.textContent = `${now + 1} of ${slides.length}`;
    history.replaceState(null, "", `#slides-${now + 1}`);
    fit();
  }

  /* Reduce the font until the slide fits. At the smallest legible font it scrolls. */
  function fit() {
    const slide = slides[now];
    slide.style.fontSize = "";
    const normal = parseFloat(getComputedStyle(slide).fontSize);
    for (let size = normal; slide.scrollHeight > slide.clientHeight + 1 && size > Math.max(15, 0.55 * normal); size *= 0.95) {
      slide.style.fontSize = `${size}px`;
    }
  }

  function leave() { location.hash = ""; location.reload(); }
  function notes() { stage.classList.toggle("with-notes"); fit(); }
  function theme() { root.dataset.theme = root.dataset.theme === "dark" ? "light" : "dark"; }
  const on = () => go(now + 1), back = () => go(now - 1);
  const buttons = [["N", "Notes", notes], ["D", "Dark or light", theme], ["‹", "Back", back], ["›", "On", on], ["×", "Leave the slides", leave]];
  for (const [text, label, act] of buttons) {
    const made = document.createElement("button");
    made.type = "button";
    made.textContent = text;
    made.setAttribute("aria-label", label);
    made.addEventListener("click", act);
    nav.append(made);
  }
  nav.setAttribute("aria-label", "Slides");
  nav.insertBefore(place, nav.children[3]);
  stage.className = "pidalab-slides bd-article";
  stage.setAttribute("role", "main");
  stage.append(nav);
  document.body.prepend(stage);
  document.body.classList.add("shows-slides");

  const KEYS = { ArrowRight: on, " ": on, PageDown: on, ArrowLeft: back, PageUp: back, Home: () => go(0),
    End: () => go(slides.length - 1), n: notes, d: theme, Escape: leave };
  addEventListener("keydown", (event) => {
    // A key that moves a slider, opens an answer or presses a button does not change the slide.
    const own = (event.key !== "Escape" && event.target.closest?.("input, select, textarea")) || (event.key === " " && event.target.closest?.("summary, button"));
    if (own || event.ctrlKey || event.altKey || event.metaKey || !KEYS[event.key]) return;
    event.preventDefault();
    event.stopPropagation();
    KEYS[event.key]();
  }, true);
  addEventListener("resize", fit);
  addEventListener("load", fit);
  stage.addEventListener("toggle", fit, true);
  globalThis.MathJax?.startup?.promise?.then(fit);
  go(parseInt(location.hash.split("-")[1], 10) - 1 || 0);
})();
