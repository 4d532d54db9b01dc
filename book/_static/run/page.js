// "Run this page": fetch the engine on a click, let the reader edit and run the cells, and show their outputs.
"use strict";
(() => {
  const here = new URL(".", document.currentScript.src);
  const base = new URL("../../live/", here).href;
  const page = document.currentScript.dataset.page;
  const stages = { "python.wasm.gz": "interpreter", "packages.zip": "packages", "book.pack.gz": "library" };
  const el = (tag, attributes = {}, ...inside) => {
    const made = Object.assign(document.createElement(tag), attributes);
    made.append(...inside);
    return made;
  };
  let engine, worker, waiting, cells, busy = Promise.resolve(), session = 0;

  const status = el("span", { className: "pidalab-run-status", role: "status" });
  const progress = el("progress", { max: 1, value: 0, hidden: true });
  progress.setAttribute("aria-label", "Bytes fetched");
  const button = (text, action, hidden = false) =>
    el("button", { type: "button", className: "btn btn-sm btn-outline-primary", textContent: text, onclick: action, hidden });
  const begin = button("Run this page", () => open()), all = button("Run all", () => runUpTo(cells.length - 1), true);
  const stop = button("Stop", () => restart("Stopped. The next run starts with the first cell."), true);
  const reset = button("Reset", () => { cells.forEach(restore); restart("Reset. All cells show their stored code and output."); }, true);
  const bar = el("div", { className: "pidalab-run-bar" }, begin, all, stop, reset, progress, status);

  /** Return the bytes of a file, unpacked if its name ends with .gz. The browser caches it. */
  async function fetched(store, url, count) {
    const answered = async () => {
      const response = await fetch(url);
      if (!response.ok) throw new Error(`${url}: the server answers ${response.status}`);
      return response;
    };
    const counted = () => new TransformStream({ transform(part, out) { count(part.length); out.enqueue(part); } });
    let kept = await store?.match(url);
    if (!kept && store) {
      // Write the file to the cache and read it again, so that memory holds only one copy.
      await store.put(url, new Response((await answered()).body.pipeThrough(counted()))).catch(() => null);
      kept = await store.match(url);
    } else if (kept) count(Number(kept.headers.get("content-length")));
    const { body } = kept ?? (await answered());
    return new URL(url).pathname.endsWith(".gz") ? body.pipeThrough(new DecompressionStream("gzip")) : body;
  }

  async function load() {
    const about = await (await fetch(`${base}engine.json`, { cache: "no-cache" })).json();
    const sizes = Object.fromEntries(Object.entries(about).map(([name, [size]]) => [name, size]));
    const address = (name) => `${base}${name}?${about[name][1]}`;
    const store = await globalThis.caches?.open("pidalab-live").catch(() => null);
    const wanted = Object.keys(about).map(address);
    for (const old of (await store?.keys()) ?? []) if (!wanted.includes(old.url)) await store.delete(old);
    const total = Object.values(sizes).reduce((a, b) => a + b);
    const done = Object.fromEntries(Object.keys(sizes).map((name) => [name, 0]));
    const count = (name) => (length) => {
      done[name] += length;
      const sum = Object.values(done).reduce((a, b) => a + b);
      const stage = Object.keys(sizes).find((each) => done[each] < sizes[each]);
      progress.value = sum / total;
      status.textContent = `Fetching ${stages[stage] ?? "done"}: ${(sum / 1e6).toFixed(1)} of ${(total / 1e6).toFixed(1)} MB`;
    };
    const part = (name) => fetched(store, address(name), count(name));
    // Fetch files one after the other, which needs less memory.
    const module = engine?.module ?? await WebAssembly.compileStreaming(
      new Response(await part("python.wasm.gz"), { headers: { "Content-Type": "application/wasm" } }));
    const packages = await new Response(await part("packages.zip")).arrayBuffer();
    const pack = await new Response(await part("book.pack.gz")).arrayBuffer();
    return { module, packages, pack };
  }

  /** Start an interpreter with the fetched files, in the folder of the page. */
  async function start() {
    engine = await load();
    status.textContent = "Starting Python …";
    worker = new Worker(new URL("worker.js", here), { type: "module" });
    worker.onmessage = ({ data: [kind, value] }) => kind === "failed" ? waiting.fail(new Error(value)) : waiting.done(value);
    worker.onerror = (event) => waiting.fail(new Error(event.message || "the worker could not start"));
    await ask({ start: { ...engine, base } }, [engine.packages, engine.pack]);
    engine = { module: engine.module };  // the packed files were moved to the worker and come from the cache again
    return call("cells", page);
  }
  const ask = (message, moved = []) =>
    new Promise((done, fail) => { waiting = { done, fail }; worker.postMessage(message, moved); });
  async function call(...what) {
    const { text, memory } = await ask({ call: JSON.stringify(what) });
    bar.dataset.memory = memory;
    return JSON.parse(text.trim().split("\n").at(-1));
  }

  async function open() {
    begin.disabled = true;
    progress.hidden = false;
    try {
      prepare(await start());
      begin.hidden = progress.hidden = true;
      all.hidden = stop.hidden = reset.hidden = false;
      status.textContent = "Ready. Change a cell and run it (Shift+Enter).";
      bar.dataset.state = "ready";
    } catch (error) {
      begin.textContent = "Retry";
      begin.disabled = false;
      progress.hidden = true;
      status.textContent = `Python did not start: ${error.message}`;
      bar.dataset.state = "failed";
    }
  }

  /** Add a toolbar to each cell that shows its code. Hidden cells run just before the next such cell. */
  function prepare(sources) {
    const plain = (text) => text.replace(/\s+/g, "");
    const blocks = [...document.querySelectorAll("div.cell > .cell_input pre, div.cell > details .cell_input pre")];
    cells = sources.map((source, number) => {
      const block = blocks.length && plain(blocks[0].textContent) === plain(source) ? blocks.shift() : null;
      return { number, source, block, ran: false };
    });
    for (const cell of cells.filter((each) => each.block)) {
      const box = cell.block.closest("div.cell");
      box.classList.add("pidalab-run");
      cell.printed = cell.block.innerHTML;
      cell.block.contentEditable = "plaintext-only";
      cell.block.spellcheck = false;
      cell.block.setAttribute("role", "textbox");
      cell.block.setAttribute("aria-multiline", "true");
      cell.block.setAttribute("aria-label", `Code of cell ${cell.number + 1}`);
      cell.block.oninput = () => { cell.edited = true; for (const later of cells.slice(cell.number)) later.ran = false; };
      cell.block.onkeydown = (event) => {
        if (event.key === "Enter" && (event.shiftKey || event.ctrlKey)) { event.preventDefault(); runUpTo(cell.number); }
      };
      cell.output = el("div", { className: "pidalab-run-output", hidden: true });
      cell.output.setAttribute("aria-live", "polite");
      cell.output.dataset.cell = cell.number;
      const run = button("Run", () => runUpTo(cell.number, true));
      cell.slow = box.classList.contains("tag_slow") ? "takes minutes in a browser" : "";
      cell.note = el("span", { className: "pidalab-run-status", textContent: cell.slow });
      box.append(el("div", { className: "pidalab-run-tools" }, run, cell.note), cell.output);
    }
  }

  const text = (cell) => (cell.edited ? cell.block.innerText.replace(/\u00a0/g, " ") : cell.source);
  function restore(cell) {
    if (!cell.block) return;
    cell.edited = false;
    cell.block.innerHTML = cell.printed;
    cell.output.hidden = true;
    cell.output.replaceChildren();
  }

  /** Run a cell, after all earlier cells that have not run since they or cells before them changed. */
  function runUpTo(number, again = false) {
    if (again) cells[number].ran = false;
    const mine = session;
    busy = busy.then(async () => {
      for (const cell of cells.slice(0, number + 1)) {
        if (mine !== session) return;
        if (cell.ran) continue;
        status.textContent = `Running cell ${cell.number + 1} of ${cells.length} …`;
        if (cell.note) cell.note.textContent = `running … ${cell.slow}`;
        const from = performance.now();
        const outputs = await call("run", cell.number, text(cell));
        cell.ran = !outputs.some(([kind]) => kind === "error");
        if (cell.note) {
          cell.note.textContent = `${((performance.now() - from) / 1000).toFixed(1)} s`;
          cell.output.replaceChildren(...outputs.map(shown));
          cell.output.hidden = false;
        }
        if (!cell.ran) {
          status.textContent = `Cell ${cell.number + 1} stopped with an error.`;
          if (!cell.block) status.textContent += ` ${outputs.at(-1)[1].trim().split("\n").at(-1)}`;
          return;
        }
      }
      status.textContent = "Done.";
    }).catch((error) => { if (mine === session) restart(`The interpreter stopped: ${error.message}`); });
    return busy;
  }

  function shown([kind, content, dark]) {
    if (kind === "html") return el("div", { className: "pidalab-run-html cell_output", innerHTML: content });
    if (kind !== "svg") return el("pre", { className: kind === "error" ? "pidalab-run-error" : "", textContent: content });
    const image = (svg, theme) => el("img", {
      className: theme, alt: "Figure of this run", src: `data:image/svg+xml;charset=utf-8,${encodeURIComponent(svg)}`,
    });
    return el("div", {}, image(content, "only-light"), image(dark, "only-dark"));
  }

  /** Stop the interpreter, and start a new one. */
  async function restart(message) {
    session += 1;
    worker?.terminate();
    waiting?.fail(new Error("stopped"));
    for (const cell of cells) { cell.ran = false; if (cell.note) cell.note.textContent = cell.slow; }
    busy = start().then(() => { status.textContent = message; }, (error) => {
      begin.hidden = false;
      begin.disabled = false;
      status.textContent = `Python did not start: ${error.message}`;
    });
  }

  function place() {
    const able = globalThis.DecompressionStream && globalThis.WebAssembly?.Exception && location.protocol !== "file:";
    const phone = matchMedia("(pointer: coarse)").matches && Math.min(screen.width, screen.height) < 600;
    if (!able || phone) {
      const binder = document.querySelector('a[href*="mybinder.org"]');
      const why = location.protocol === "file:" ? "when the site comes from a web server" : "in a current browser on a computer";
      bar.replaceChildren(el("span", { className: "pidalab-run-status" }, `The cells of this page run ${why}. Elsewhere run them `,
        binder ? el("a", { href: binder.href, textContent: "on Binder" }) : "on Binder", "."));
    } else {
      status.textContent = "The first run loads Python into this browser (about 45 MB).";
    }
    document.querySelector(".bd-article h1")?.after(bar);
  }
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", place); else place();
})();
