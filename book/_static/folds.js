/* Label folds for screen readers: answers, and subpages in the table of contents. */
addEventListener("load", () => {
  for (const button of document.querySelectorAll(".toggle-button")) {
    const title = document.getElementById(button.dataset.target)?.querySelector(".admonition-title");
    if (title) button.setAttribute("aria-label", `Show or hide: ${title.textContent.trim()}`);
  }
  for (const summary of document.querySelectorAll("nav details > summary")) {
    const page = summary.closest("li")?.querySelector("a");
    if (page && !summary.textContent.trim()) summary.setAttribute("aria-label", `Pages under ${page.textContent.trim()}`);
  }
});

/* Return the id at the end of an address. It may contain a % that encodes nothing. */
function place() {
  try { return decodeURIComponent(location.hash.slice(1)); } catch { return ""; }
}

/* Open the fold that contains the target of the address, such as a row of a ledger. */
function reveal() {
  const target = document.getElementById(place());
  if (!target?.closest("details:not([open])")) return;
  for (let fold = target.closest("details"); fold; fold = fold.parentElement.closest("details")) fold.open = true;
  target.scrollIntoView({ block: "center" });
}
for (const when of ["load", "hashchange"]) addEventListener(when, reveal);

/* Open notes and outputs while the page is printed. Folded code is not printed. */
const folds = () => document.querySelectorAll("article details:not(.above-input)");
addEventListener("beforeprint", () => {
  for (const fold of folds()) { fold.dataset.was = fold.open; fold.open = true; }
});
addEventListener("afterprint", () => {
  for (const fold of folds()) fold.open = fold.dataset.was === "true";
});
