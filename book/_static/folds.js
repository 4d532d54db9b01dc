/* Folds say what they hide, for those who hear the page: answers, and pages under a page in the table of contents. */
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

/* The id that an address ends with; an address may hold a % that encodes nothing. */
function place() {
  try { return decodeURIComponent(location.hash.slice(1)); } catch { return ""; }
}

/* An address that leads into a fold opens it: the row of a ledger, for one. */
function reveal() {
  const target = document.getElementById(place());
  if (!target?.closest("details:not([open])")) return;
  for (let fold = target.closest("details"); fold; fold = fold.parentElement.closest("details")) fold.open = true;
  target.scrollIntoView({ block: "center" });
}
for (const when of ["load", "hashchange"]) addEventListener(when, reveal);

/* On paper nothing can be unfolded: notes and outputs are open while the page is printed, folded code is left out. */
const folds = () => document.querySelectorAll("article details:not(.above-input)");
addEventListener("beforeprint", () => {
  for (const fold of folds()) { fold.dataset.was = fold.open; fold.open = true; }
});
addEventListener("afterprint", () => {
  for (const fold of folds()) fold.open = fold.dataset.was === "true";
});
