/* A folded answer is named after what it answers, for those who hear the page. */
addEventListener("load", () => {
  for (const button of document.querySelectorAll(".toggle-button")) {
    const title = document.getElementById(button.dataset.target)?.querySelector(".admonition-title");
    if (title) button.setAttribute("aria-label", `Show or hide: ${title.textContent.trim()}`);
  }
});
