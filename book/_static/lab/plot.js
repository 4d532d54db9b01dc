/* Line plots as plain SVG. Lines differ in dash as well as in colour.

   pidalabPlot(host, {title, x: {label, log, range}, y: {…}, lines: [{x, y, kind, name}], equal}) draws into the element `host`.
   A second call moves the lines, and draws the axes again if they changed. An axis has a `range`, or shows what its lines need;
   `around` selects the part of the lines. A line with `stairs` holds each value until the next. `kind` 0, 1, 2 … has the colour
   and dash of that design, "mark" is a thin grey line, and "dots" is a record. `notes` are {x, y, words, anchor, below} at a
   place. `handles` are dots {x, y, label, drag}; dragging a dot calls drag(x, y). A pointer over the plot calls `follow` with the
   place on the horizontal axis. pidalabPlot.point(host, place) shows the values of all lines there, along `by` where this is not
   x. Drawing a box with a mouse zooms, and a double click undoes it. The style sheet defines all colours for both themes. */
(function () {
  "use strict";
  const WIDTH = 440, HEIGHT = 270, LEFT = 56, RIGHT = 10, TOP = 26, BOTTOM = 40;

  /* Create a part of the page from its description, a text or [name, attributes, ...descriptions of its children]. */
  function create(parent, wanted) {
    if (typeof wanted === "string") return document.createTextNode(wanted);
    const made = document.createElementNS(parent.namespaceURI, wanted[0]);
    alter(made, wanted);
    return made;
  }

  /* Change a part of the page from one description to another. Only differences are touched, since the browser lays out each
     touched element again. */
  function alter(part, [, attributes, ...wanted], [, known, ...before] = ["", {}]) {
    for (const key in attributes) if (attributes[key] !== known[key]) part.setAttribute(key, attributes[key]);
    for (const key in known) if (!(key in attributes)) part.removeAttribute(key);
    wanted.forEach((child, k) => {
      const was = before[k], text = typeof child === "string", one = part.childNodes[k];
      if (was === undefined) part.append(create(part, child));
      else if (text !== (typeof was === "string") || (!text && child[0] !== was[0])) one.replaceWith(create(part, child));
      else if (!text) alter(one, child, was);
      else if (child !== was) one.data = child;
    });
    for (let k = wanted.length; k < before.length; k++) part.lastChild.remove();
  }

  const shown = new WeakMap(); // the description of each place

  /* Show descriptions in a place, whose children nothing else may change. */
  function show(place, ...inside) {
    const wanted = ["", {}, ...inside];
    alter(place, wanted, shown.get(place));
    shown.set(place, wanted);
  }

  /* Create an element. Attributes that begin with "on" add listeners. */
  function element(name, attributes = {}, ...children) {
    const made = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) {
      if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
      else if (value === true) made.setAttribute(key, "");
      else if (value !== false && value != null) made.setAttribute(key, value);
    }
    made.append(...children.map((child) => (Array.isArray(child) ? create(made, child) : child)));
    return made;
  }

  /* Split a text into parts, with its symbols set as in Notation. For example, Ms becomes M with the index s. */
  const SYMBOL = /\b(M(?:ks|s|t)|[kt][pida]|T[fst123])\b/;
  function marked(text, index = ["sub", {}]) {
    return text.split(SYMBOL).flatMap((part, k) => (k % 2 ? [part[0], [...index, part.slice(1)]] : part ? [part] : []));
  }

  /* Return the smallest and the largest finite value of all lines, with a margin. */
  function extent(lines, key, log) {
    let low = Infinity, high = -Infinity;
    for (const line of lines) {
      for (const value of line[key]) {
        if (!Number.isFinite(value) || (log && value <= 0)) continue;
        if (value < low) low = value;
        if (value > high) high = value;
      }
    }
    if (low > high) return log ? [0.1, 10] : [0, 1];
    if (log) return low === high ? [low / 2, high * 2] : [low, high];
    const air = 0.05 * (high - low || Math.abs(high) || 1);
    return [low - air, high + air];
  }

  function ticks([low, high], log) {
    if (log) {
      const first = Math.ceil(Math.log10(low) - 1e-9), last = Math.floor(Math.log10(high) + 1e-9);
      const each = Math.max(1, Math.ceil((last - first + 1) / 6)), found = [];
      for (let power = first; power <= last; power += each) found.push(Math.pow(10, power));
      // A short axis needs ticks between the powers of ten.
      if (found.length < 3) for (let power = first - 1; power <= last; power++) for (const m of [2, 5]) found.push(m * Math.pow(10, power));
      return found.filter((x) => x >= low * (1 - 1e-9) && x <= high * (1 + 1e-9)).sort((a, b) => a - b);
    }
    const rough = (high - low) / 5, size = Math.pow(10, Math.floor(Math.log10(rough)));
    const step = size * [1, 2, 5, 10].find((m) => m * size >= rough);
    const found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
    return found;
  }

  const named = (value, log) => {
    if (log) {
      const power = Math.floor(Math.log10(value) + 1e-9);
      return power >= -2 && power <= 3 ? String(Number(value.toPrecision(1))) : `${Math.round(value / Math.pow(10, power))}e${power}`;
    }
    const text = Number(value.toPrecision(6));
    return (Math.abs(text) >= 1e5 ? text.toExponential(0) : String(text)).replace("-", "−");
  };

  /* Round a range outwards to a fifth of a tick or a tenth of a decade, so that the axis rests while a curve moves
     slightly. */
  function rounded([low, high], log) {
    if (log) return [Math.pow(10, Math.floor(10 * Math.log10(low)) / 10), Math.pow(10, Math.ceil(10 * Math.log10(high)) / 10)];
    const [first, second] = ticks([low, high]), step = (second - first) / 5;
    return [Math.floor(low / step) * step, Math.ceil(high / step) * step];
  }

  /* Return the visible points of a line. Of many points within a unit of width, these are the first, the lowest, the
     highest and the last. */
  function visible(across, up) {
    const kept = [];
    for (let from = 0, to; from < across.length; from = to) {
      const column = Math.floor(across[from]);
      let low = from, high = from;
      for (to = from + 1; to < across.length && Math.floor(across[to]) === column; to++) {
        if (up[to] < up[low]) low = to;
        if (up[to] > up[high]) high = to;
      }
      for (const k of [from, Math.min(low, high), Math.max(low, high), to - 1]) if (k !== kept[kept.length - 1]) kept.push(k);
    }
    return kept;
  }

  const word = (value) => String(Math.round(10 * value) / 10);

  const place = ({ log, start, each }, value) => start + each * (log ? Math.log10(value) : value);

  /* Return the path of a line. With `stairs` it first goes along, then up. */
  function path({ x, y, stairs }, px, py) {
    const limit = (value) => Math.max(-9999, Math.min(9999, value));
    let drawn = "", across = [], up = [];
    const finish = () => {
      const shown = visible(across, up), last = shown[shown.length - 1];
      let height = "";
      for (const k of shown) {
        const before = height;
        height = word(up[k]);
        if (!before) drawn += `M${word(across[k])} ${height}`;
        else if (!stairs) drawn += `L${word(across[k])} ${height}`;
        else if (height !== before || k === last) drawn += `H${word(across[k])}V${height}`;
      }
      [across, up] = [[], []];
    };
    for (let k = 0; k < x.length; k++) {
      const h = place(px, x[k]), v = place(py, y[k]);
      if (Number.isFinite(h + v)) { across.push(limit(h)); up.push(limit(v)); } else finish();
    }
    finish();
    return drawn;
  }

  const places = new WeakMap(); // the plot in each place

  let count = 0;

  function draw(host, picture) {
    const { title, x, y, lines, equal } = picture, found = places.get(host) ?? frame(host, title);
    places.set(host, found);
    found.picture = picture;
    let xRange = found.zoom?.x ?? x.range ?? extent(lines, "x", x.log), yRange = found.zoom?.y ?? y.range ?? rounded(y.around ?? extent(lines, "y", y.log), y.log);
    if (equal) { // use the same scale on both axes, as a Nyquist plot requires
      const perX = (xRange[1] - xRange[0]) / (WIDTH - LEFT - RIGHT), perY = (yRange[1] - yRange[0]) / (HEIGHT - TOP - BOTTOM);
      const grow = (range, factor) => {
        const middle = (range[0] + range[1]) / 2, half = ((range[1] - range[0]) / 2) * factor;
        return [middle - half, middle + half];
      };
      if (perX > perY) yRange = grow(yRange, perX / perY); else xRange = grow(xRange, perY / perX);
    }
    const along = (range, log, from, to) => {
      const f = log ? Math.log10 : (v) => v, a = f(range[0]), b = f(range[1]);
      return { log, each: (to - from) / (b - a), start: from - (a * (to - from)) / (b - a) };
    };
    const px = along(xRange, x.log, LEFT, WIDTH - RIGHT), py = along(yRange, y.log, HEIGHT - BOTTOM, TOP);

    const key = JSON.stringify([title, x.label, x.log, xRange, y.log, yRange]);
    Object.assign(found, { px, py });
    if (found.key !== key) show(found.axes, ...grid({ title, x, y, xRange, yRange, px, py }));
    found.key = key;
    found.desc.textContent = lines.filter(({ name, by }) => name && !by).map(said).join(" ");
    show(found.inside, ...lines.map((line) => ["path", { class: `lab-line lab-${line.kind}`, d: path(line, px, py) }]));
    showFront(found);
  }

  /* Describe a line in words for screen readers. */
  function said({ name, x, y }) {
    const finite = y.filter(Number.isFinite);
    if (!finite.length) return "";
    const top = finite.reduce((a, b) => Math.max(a, b)), low = finite.reduce((a, b) => Math.min(a, b));
    const three = (v) => named(Math.abs(v) < 1e-3 * (top - low) ? 0 : Number(v.toPrecision(3)), false);
    return `${name}: from ${three(low)} to ${three(top)}, the most at ${three(x[y.indexOf(top)])}; ${three(finite[finite.length - 1])} at the end.`;
  }

  const value = ({ log, start, each }, at) => (log ? Math.pow(10, (at - start) / each) : (at - start) / each);

  /* Return the first index at which a rising list reaches a value. */
  function passed(list, at) {
    let low = 0, high = list.length;
    while (low < high) { const middle = (low + high) >> 1; if (list[middle] < at) low = middle + 1; else high = middle; }
    return low;
  }

  /* Draw in front of the lines: handles, the box of a zoom, and the values at a place. */
  function showFront(found) {
    const { px, py, at, box, picture: { lines, notes = [], handles = [] } } = found, parts = [], words = [];
    for (const { x, y, words, anchor = "middle", below } of notes) parts.push(["text", { x: word(place(px, x)), y: word(place(py, y) + (below ? 24 : -9)), "text-anchor": anchor }, words]);
    if (box) parts.push(["rect", { class: "lab-box", x: Math.min(box[0], box[2]), y: Math.min(box[1], box[3]), width: Math.abs(box[2] - box[0]), height: Math.abs(box[3] - box[1]) }]);
    if (at != null) {
      const straight = lines.every(({ by }) => !by), across = place(px, at);
      if (straight && across >= LEFT && across <= WIDTH - RIGHT) parts.push(["path", { class: "lab-cursor", d: `M${word(across)} ${TOP}V${HEIGHT - BOTTOM}` }]);
      for (const { x, y, by = x, kind, stairs } of lines) {
        const k = passed(by, at);
        if (kind === "mark" || !k || k >= by.length) continue;
        const share = stairs ? 0 : (at - by[k - 1]) / (by[k] - by[k - 1]), h = x[k - 1] + share * (x[k] - x[k - 1]), v = y[k - 1] + share * (y[k] - y[k - 1]);
        const [cx, cy] = [place(px, h), place(py, v)];
        if (straight) words.push(["tspan", { class: `lab-word-${kind}`, dx: 8 }, named(Number(v.toPrecision(3)), false)]);
        if (cx >= LEFT && cx <= WIDTH - RIGHT && cy >= TOP && cy <= HEIGHT - BOTTOM) parts.push(["circle", { class: `lab-point lab-${kind}`, cx: word(cx), cy: word(cy), r: 4 }]);
      }
      if (words.length) parts.push(["text", { class: "lab-values", x: WIDTH - RIGHT - 4, y: 16, "text-anchor": "end" }, ["tspan", {}, named(Number(at.toPrecision(3)), false) + ":"], ...words]);
    }
    handles.forEach((handle, k) => parts.push(["circle", { class: "lab-handle", "data-handle": k, cx: word(place(px, handle.x)), cy: word(place(py, handle.y)), r: 8 }, ["title", {}, handle.label]]));
    show(found.front, ...parts);
  }

  /* Show the values at a place of a plot, or hide them. */
  function point(host, at) {
    const found = places.get(host);
    if (!found || found.at === at) return;
    found.at = at;
    showFront(found);
  }

  /* Handle the pointer over a plot: drag a handle, draw a box to zoom, or show values. */
  function hear(host, svg, found) {
    let held = null;
    const spot = (event) => { const { left, top, width } = svg.getBoundingClientRect(); return [((event.clientX - left) * WIDTH) / width, ((event.clientY - top) * WIDTH) / width]; };
    const read = (event) => {
      const [x, y] = spot(event), { px, py, picture: { lines, follow } } = found, curve = lines.find(({ by }) => by);
      if (!curve) return follow?.(x >= LEFT ? value(px, x) : null);
      let near = 0, least = Infinity;
      for (let k = 0; k < curve.x.length; k++) {
        const far = Math.hypot(place(px, curve.x[k]) - x, place(py, curve.y[k]) - y);
        if (far < least) [least, near] = [far, k];
      }
      follow?.(curve.by[near]);
    };
    svg.addEventListener("pointerdown", (event) => {
      const handle = event.target.dataset?.handle;
      if (handle === undefined && event.pointerType !== "mouse") return read(event); // a finger scrolls
      held = { handle, from: spot(event) };
      svg.setPointerCapture(event.pointerId);
      event.preventDefault();
    });
    svg.addEventListener("pointermove", (event) => {
      const [x, y] = spot(event), { px, py, picture: { handles } } = found;
      if (held?.handle !== undefined) return handles[held.handle]?.drag(value(px, x), value(py, y));
      if (!held) return read(event);
      found.box = [...held.from, x, y];
      showFront(found);
    });
    svg.addEventListener("pointerup", () => {
      const { box, px, py } = found, sorted = (a, b) => (a < b ? [a, b] : [b, a]);
      if (box && Math.abs(box[2] - box[0]) > 12 && Math.abs(box[3] - box[1]) > 12) found.zoom = { x: sorted(value(px, box[0]), value(px, box[2])), y: sorted(value(py, box[1]), value(py, box[3])) };
      held = found.box = null;
      draw(host, found.picture);
    });
    svg.addEventListener("pointerleave", ({ pointerType }) => { if (!held && pointerType === "mouse") found.picture.follow?.(null); });
    svg.addEventListener("dblclick", () => { found.zoom = null; draw(host, found.picture); });
  }

  /* Create an empty plot with a group for its axes and a group for its lines. */
  function frame(host, title) {
    const clip = `pidalab-clip-${++count}`, box = { x: LEFT, y: TOP, width: WIDTH - LEFT - RIGHT, height: HEIGHT - TOP - BOTTOM };
    const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    alter(svg, ["svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": title, class: "lab-plot" },
      ["defs", {}, ["clipPath", { id: clip }, ["rect", box]]], ["g", {}], ["g", { "clip-path": `url(#${clip})` }], ["g", {}], ["desc", {}]]);
    host.replaceChildren(svg);
    const [, axes, inside, front, desc] = svg.children, found = { axes, inside, front, desc };
    hear(host, svg, found);
    return found;
  }

  /* Return title, grid (a single path) and tick labels of a plot. */
  function grid({ title, x, y, xRange, yRange, px, py }) {
    const below = ["tspan", { "baseline-shift": "sub", "font-size": "75%" }];
    const text = (x, y, name, anchor, words) => ["text", { x, y, class: name, "text-anchor": anchor }, ...marked(words, below)];
    const across = ticks(xRange, x.log).map((value) => [word(place(px, value)), named(value, x.log)]);
    const up = ticks(yRange, y.log).map((value) => [word(place(py, value)), named(value, y.log)]);
    const lines = [...across.map(([at]) => `M${at} ${TOP}V${HEIGHT - BOTTOM}`), ...up.map(([at]) => `M${LEFT} ${at}H${WIDTH - RIGHT}`)];
    return [
      ["path", { class: "lab-grid", d: lines.join("") }],
      text(LEFT, 16, "lab-title", "start", title),
      text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 6, "lab-label", "middle", x.label),
      ...across.map(([at, words]) => text(at, HEIGHT - BOTTOM + 16, "lab-tick", "middle", words)),
      ...up.map(([at, words]) => text(LEFT - 6, Number(at) + 4, "lab-tick", "end", words)),
    ];
  }

  globalThis.pidalabPlot = Object.assign(draw, { show, point, element, marked });
})();
