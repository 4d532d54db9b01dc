/* The search page: it lists sections of the book, best first, from the index of the build. */
(function () {
  "use strict";
  const IDLE = new Set("a an and do does for from how i in is it of on the to what with".split(" "));
  const index = new MiniSearch({
    fields: ["title", "page", "text", "also"], // also: search words that the section does not contain
    storeFields: ["title", "page", "text", "url", "weight"],
    // "anti-windup" is indexed as one word and by its parts, "setpoint" as "set point". Case and accents are ignored.
    tokenize: (text) => {
      const words = text.replace(/\b(set|dead)-?(points?|times?)\b/gi, "$1 $2").split(/[\s.,;:!?()[\]{}"“”„'’/=<>|…–—]+/).filter(Boolean);
      return words.concat(words.filter((word) => word.includes("-")).flatMap((word) => word.split("-"))).filter(Boolean);
    },
    processTerm: (term) => {
      const word = term.toLowerCase().normalize("NFD").replace(/[\u0300-\u036f]/g, "");
      return IDLE.has(word) ? null : word;
    },
    searchOptions: {
      boost: { title: 4, also: 6, page: 1.5 },
      prefix: (term) => term.length > 3,
      fuzzy: (term) => (term.length > 5 ? 0.15 : false),
      combineWith: "AND",
      boostDocument: (id, term, stored) => stored.weight,
    },
  });
  index.addAll(window.bookSections);

  const element = (name, text, attributes) => {
    const made = document.createElement(name);
    made.textContent = text;
    Object.assign(made, attributes);
    return made;
  };

  /* Return the text around the first match. */
  const excerpt = (text, terms) => {
    const lower = text.toLowerCase();
    const places = terms.map((term) => lower.indexOf(term)).filter((place) => place >= 0);
    const start = places.length ? Math.max(0, Math.min(...places) - 80) : 0; // otherwise the match is in the title
    return (start ? "… " : "") + text.slice(start, start + 240).trim() + (start + 240 < text.length ? " …" : "");
  };

  const show = (query) => {
    const results = document.getElementById("search-results");
    results.replaceChildren();
    let hits = index.search(query);
    if (!hits.length) hits = index.search(query, { combineWith: "OR" });
    const root = document.documentElement.dataset.content_root || "";
    const summary = hits.length
      ? `${hits.length} section${hits.length > 1 ? "s" : ""} found for “${query}”.`
      : `No section mentions “${query}”.`;
    results.append(element("p", summary, { className: "search-summary", role: "status" }));
    const list = element("ul", "", { className: "search" });
    for (const hit of hits.slice(0, 60)) {
      const entry = document.createElement("li");
      entry.append(element("a", hit.title, { href: root + hit.url }));
      if (hit.page !== hit.title) entry.append(element("span", ` in ${hit.page}`, { className: "where" }));
      entry.append(element("p", excerpt(hit.text, hit.terms), { className: "context" }));
      list.append(entry);
    }
    results.append(list);
  };

  /* Replace the search for whole pages, with the same box and address. Sphinx's script comes later on the page. */
  document.addEventListener("DOMContentLoaded", () => { Search.performSearch = show; });
})();
