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

/* On paper nothing can be unfolded: notes and outputs are open while the page is printed, folded code is left out. */
const folds = () => document.querySelectorAll("article details:not(.above-input)");
addEventListener("beforeprint", () => {
  for (const fold of folds()) { fold.dataset.was = fold.open; fold.open = true; }
});
addEventListener("afterprint", () => {
  for (const fold of folds()) fold.open = fold.dataset.was === "true";
});
