/* Turns the sections of a page into slides. The right arrow, space and the button show one step after another, page keys
   go to whole slides; N shows the notes, D changes between light and dark, an address may end in the number of a slide. */
(function () {
  "use strict";
  const slides = [...document.querySelectorAll(".slide")], root = document.documentElement, steps = slides.map(stepsOf);
  let now = 0, last = Infinity; // slide, and step of it, that are shown

  const button = (text, label, act) => {
    const made = document.createElement("button");
    made.type = "button";
    made.textContent = text;
    made.setAttribute("aria-label", label);
    made.addEventListener("click", act);
    return made;
  };
  const nav = document.createElement("nav"), place = document.createElement("output");
  nav.setAttribute("aria-label", "Slides");
  nav.append(button("N", "Notes", notes), button("D", "Dark or light", theme), button("‹", "Back", () => go(now - 1)), place, button("›", "On", on));
  document.body.append(nav);

  /* What appears together: an item or a piece, with the headings and the announcement before it. */
  function stepsOf(slide) {
    const found = [];
    let ahead = [];
    for (const part of slide.querySelectorAll(".inner > :not(.notes, ul, ol), .inner > :is(ul, ol) > li")) {
      ahead.push(part);
      if (part.matches("h1, h2, h3") || (part.matches("p") && part.textContent.trim().endsWith(":"))) continue;
      found.push(ahead);
      ahead = [];
    }
    return found;
  }

  function on() {
    if (last < steps[now].length - 1) reveal(last + 1);
    else if (now < slides.length - 1) go(now + 1, true, 0);
  }

  function reveal(step) {
    last = step;
    steps[now].forEach((parts, k) => parts.forEach((part) => part.classList.toggle("later", k > last)));
  }

  function go(to, store = true, step = Infinity) {
    now = Math.max(0, Math.min(slides.length - 1, to));
    slides.forEach((slide, k) => { slide.classList.toggle("now", k === now); slide.inert = k !== now; });
    place.textContent = `${now + 1} of ${slides.length}`;
    if (store) history.replaceState(null, "", `#${now + 1}`);
    reveal(step);
    fit(slides[now]);
  }

  /* Make the words of a slide smaller until it fits, but not too small to read: then it scrolls. */
  function fit(slide) {
    slide.style.fontSize = "";
    const normal = parseFloat(getComputedStyle(slide).fontSize);
    for (let size = normal; slide.scrollHeight > slide.clientHeight + 1 && size > Math.max(15, 0.55 * normal); size *= 0.95) {
      slide.style.fontSize = `${size}px`;
    }
  }

  function notes() { document.body.classList.toggle("with-notes"); fit(slides[now]); }
  function theme() { root.dataset.theme = root.dataset.theme === "dark" ? "light" : "dark"; }

  const KEYS = { ArrowRight: on, " ": on, PageDown: () => go(now + 1), ArrowLeft: () => go(now - 1), PageUp: () => go(now - 1),
    Home: () => go(0), End: () => go(slides.length - 1), n: notes, d: theme };
  addEventListener("keydown", (event) => {
    // a key that moves a slider, opens an answer or presses a button is not ours
    const own = event.target.closest?.("input, select, textarea") || (event.key === " " && event.target.closest?.("summary, button"));
    if (own || event.ctrlKey || event.altKey || event.metaKey || !KEYS[event.key]) return;
    event.preventDefault();
    KEYS[event.key]();
  });
  addEventListener("resize", () => fit(slides[now]));
  addEventListener("hashchange", () => go(parseInt(location.hash.slice(1), 10) - 1 || 0, false));
  for (const fold of document.querySelectorAll("details")) fold.addEventListener("toggle", () => fit(slides[now]));

  root.dataset.theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
  globalThis.MathJax = {
    options: { enableMenu: false, ignoreHtmlClass: "lab-.*|pidalab-live" }, svg: { fontCache: "local" },
    startup: { pageReady: () => MathJax.startup.defaultPageReady().then(() => { root.dataset.typeset = "yes"; fit(slides[now]); }) },
  };
  go(parseInt(location.hash.slice(1), 10) - 1 || 0, false);
})();
