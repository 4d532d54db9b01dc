/* The engine of the lab: responses and margins of a PI, PID or PIDA loop with exact dead time.

   It is a classic script, so that it also runs in a page that is opened from disk. It sets globalThis.pidalabEngine to

     simulate({process: {num, den, delay}, controller: {gains: [ki, kp, kd, ka], filterTime, filterOrder, limits},
               end, points, setpoint, load})  ->  {t, y, u, fine: {t, u}}
     margins({process, controller})           ->  {ms, mks, gm, pm, dm, stable}

   The controller is (ki/s + kp + kd s + ka s^2) / (1 + filterTime s)^filterOrder, from control error to control signal.
   Polynomials have descending powers of s. `fine` is u at the same times and at additional times, which are dense
   where derivatives kick. The dead time is not approximated (see `march`). */
(globalThis.pidalabScripts ??= []).push(function () {
  "use strict";

  // --- arguments ----------------------------------------------------------------------------------------------------

  const fail = (message) => { throw new RangeError(message); };

  function real(name, value, least = -Infinity) {
    if (typeof value !== "number" || !Number.isFinite(value) || value < least) {
      fail(`${name} must be a finite number${least > -Infinity ? ` of at least ${least}` : ""}, found ${value}`);
    }
    return value;
  }

  function polynomial(name, values) {
    if (!Array.isArray(values) || !values.length) fail(`${name} must be a list of coefficients, found ${values}`);
    const first = values.findIndex((value) => real(name, value) !== 0);
    return first < 0 ? [0] : values.slice(first);
  }

  /* Check and complete a loop: remove leading zeros of polynomials, and add missing gains. */
  function readLoop({ process, controller }) {
    const num = polynomial("process.num", process.num), den = polynomial("process.den", process.den);
    if (den.length === 1 && den[0] === 0) fail("process.den must not be 0");
    if (num.length > den.length) fail(`process must be proper, found degree ${num.length - 1} over ${den.length - 1}`);
    const delay = real("process.delay", process.delay ?? 0, 0);
    const [ki = 0, kp = 0, kd = 0, ka = 0] = controller.gains.map((gain) => real("controller.gains", gain));
    let order = real("controller.filterOrder", controller.filterOrder ?? 0, 0);
    const time = real("controller.filterTime", controller.filterTime ?? 0, 0);
    if (!Number.isInteger(order)) fail(`controller.filterOrder must be an integer, found ${order}`);
    if (time === 0) order = 0;
    const least = ka ? 2 : kd ? 1 : 0;
    if (order < least) fail(`controller needs a filter of order ${least} or more with a time above 0, found order ${order}`);
    const limits = controller.limits ?? null;
    if (limits && !(limits.length === 2 && limits[0] < limits[1])) fail(`controller.limits must be [low, high], found ${limits}`);
    return { num, den, delay, ki, kp, kd, ka, time, order, limits };
  }

  /* Cache the last results of a function whose arguments JSON can store. */
  function remembering(size, make) {
    const kept = new Map();
    return (...values) => {
      const key = JSON.stringify(values), found = kept.get(key) ?? make(...values);
      kept.delete(key); // remove the result that was unused for the longest time
      kept.set(key, found);
      if (kept.size > size) kept.delete(kept.keys().next().value);
      return found;
    };
  }

  // --- polynomials and complex numbers ------------------------------------------------------------------------------

  const times = (a, b) => [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]];
  const over = (a, b) => {
    const size = b[0] * b[0] + b[1] * b[1];
    return [(a[0] * b[0] + a[1] * b[1]) / size, (a[1] * b[0] - a[0] * b[1]) / size];
  };
  const modulus = (a) => Math.hypot(a[0], a[1]);
  const angle = (a) => Math.atan2(a[1], a[0]);
  const wrapped = (turn) => turn - 2 * Math.PI * Math.round(turn / (2 * Math.PI));

  /* Evaluate a polynomial by Horner's scheme, in real numbers for speed. */
  function value(coefficients, s) {
    const x = s[0], y = s[1];
    let re = 0, im = 0;
    for (let k = 0; k < coefficients.length; k++) {
      const next = re * x - im * y + coefficients[k];
      im = re * y + im * x;
      re = next;
    }
    return [re, im];
  }

  /* Return all roots of a polynomial, by Aberth's iteration in a scaled variable. */
  const roots = remembering(40, (coefficients) => {
    let c = polynomial("polynomial", coefficients);
    const found = [];
    while (c.length > 1 && c[c.length - 1] === 0) { found.push([0, 0]); c = c.slice(0, -1); }
    const n = c.length - 1;
    if (n < 1) return found;
    const scale = Math.pow(Math.abs(c[n] / c[0]), 1 / n);
    const p = c.map((x, i) => (x / c[0]) * Math.pow(scale, -i));
    const dp = p.slice(0, -1).map((x, i) => x * (n - i)), sizes = p.map(Math.abs);
    const z = Array.from({ length: n }, (_, k) => {
      const phase = (2 * Math.PI * k) / n + 0.4;
      return [Math.cos(phase), Math.sin(phase)];
    });
    for (let turn = 0; turn < 200; turn++) {
      let change = 0;
      for (let k = 0; k < n; k++) {
        const at = value(p, z[k]);
        if (modulus(at) <= 1e-16 * value(sizes, [modulus(z[k]), 0])[0]) continue; // the rest is rounding
        const newton = over(value(dp, z[k]), at);
        const repelled = z.reduce((sum, other, j) => {
          if (j === k) return sum;
          const gap = [z[k][0] - other[0], z[k][1] - other[1]];
          if (modulus(gap) === 0) return sum;
          const share = over([1, 0], gap);
          return [sum[0] + share[0], sum[1] + share[1]];
        }, [0, 0]);
        const step = over([1, 0], [newton[0] - repelled[0], newton[1] - repelled[1]]);
        if (!Number.isFinite(step[0] + step[1])) continue;
        z[k] = [z[k][0] - step[0], z[k][1] - step[1]];
        change = Math.max(change, modulus(step) / (modulus(z[k]) + 1e-300));
      }
      if (change < 1e-15) break;
    }
    return found.concat(z.map((root) => [root[0] * scale, root[1] * scale]));
  });

  // --- the loop along the imaginary axis ----------------------------------------------------------------------------

  /* Return poles, zeros and numerator of the loop without its dead time. */
  function factors(loop) {
    const gains = loop.ki ? [loop.ka, loop.kd, loop.kp, loop.ki] : [loop.ka, loop.kd, loop.kp];
    const poles = roots(loop.den).concat(Array.from({ length: loop.order }, () => [-1 / loop.time, 0]));
    if (loop.ki) poles.push([0, 0]);
    const zeros = loop.num.some(Boolean) && gains.some(Boolean) ? roots(loop.num).concat(roots(gains)) : [];
    const lead = loop.den[0] * Math.pow(loop.time || 1, loop.order);
    const top = loop.num[0] * (gains.find(Boolean) ?? 0);
    return {
      poles, zeros, lead,
      top: (s) => times(value(loop.num, s), value(gains, s)),
      atInfinity: top && poles.length === zeros.length ? top / lead : 0,
    };
  }

  /* Return values of a loop, each computed on first use. */
  const unlimited = remembering(12, (loop) => {
    const once = (make) => { let made; return () => (made ??= make()); };
    const parts = once(() => factors(loop)), grid = once(() => baseGrid(loop, parts())), space = once(() => stateSpace(loop));
    const open = once(() => along(loop, grid()));
    const own = { loop, parts, grid, open, space, motion: once(() => motion(loop, parts(), grid(), open().size, space())) };
    const runs = remembering(4, (...values) => linear(own, ...values));
    const samples = remembering(2, (h) => held(space(), loop.delay, h));
    return { ...own, margins: once(() => marginsOf(own)), response: once(() => responseOf(own)), linear: runs, held: samples };
  });

  function prepared(asked) {
    const loop = readLoop(asked);
    return { ...unlimited({ ...loop, limits: null }), loop };
  }

  const PER_DECADE = 60, TURN = 0.25, MOST = 400000;
  const TOO_MANY = "the dead time turns the phase too often to follow while |L| is large";

  /* Write L and C at the frequency w to `seen`: re L, im L, re C, im C. It uses real numbers for speed. */
  const seen = new Float64Array(4);
  function look({ num, den, delay, ki, kp, kd, ka, time, order }, w) {
    let a = 1, b = 0; // (1 + j time w)^order
    for (let k = 0; k < order; k++) { const next = a - b * time * w; b += a * time * w; a = next; }
    const real = kp - ka * w * w, imag = kd * w - (ki && ki / w), filter = a * a + b * b;
    const c = (real * a + imag * b) / filter, d = (imag * a - real * b) / filter;
    let x = 0, y = 0, u = 0, v = 0; // num and den by Horner's scheme
    for (let k = 0; k < num.length; k++) { const next = num[k] - y * w; y = x * w; x = next; }
    for (let k = 0; k < den.length; k++) { const next = den[k] - v * w; v = u * w; u = next; }
    const size = u * u + v * v, p = (x * u + y * v) / size, q = (y * u - x * v) / size;
    const re = p * c - q * d, im = p * d + q * c, cos = Math.cos(w * delay), sin = Math.sin(w * delay);
    seen[0] = re * cos + im * sin;
    seen[1] = im * cos - re * sin;
    seen[2] = c;
    seen[3] = d;
  }

  function openLoop(loop, w) {
    look(loop, w);
    return [seen[0], seen[1]];
  }

  /* Return L, |L|, |C| and the phase of C in degrees at the frequencies w. */
  function along(loop, w) {
    const column = () => new Float64Array(w.length), re = column(), im = column(), size = column(), control = column(), lead = column();
    for (let k = 0; k < w.length; k++) {
      look(loop, w[k]);
      re[k] = seen[0];
      im[k] = seen[1];
      size[k] = Math.sqrt(seen[0] * seen[0] + seen[1] * seen[1]);
      control[k] = Math.sqrt(seen[2] * seen[2] + seen[3] * seen[3]);
      lead[k] = (Math.atan2(seen[3], seen[2]) * 180) / Math.PI;
    }
    return { w, re, im, size, control, lead };
  }

  /* Return frequencies that resolve the rational part of L, with additional points for lightly damped roots. */
  function baseGrid(loop, parts) {
    const all = parts.poles.concat(parts.zeros);
    const sizes = all.map(modulus).filter((size) => size > 0);
    if (loop.delay) sizes.push(1 / loop.delay);
    if (!sizes.length) sizes.push(1);
    const low = Math.log10(Math.min(...sizes)) - 4, high = Math.log10(Math.max(...sizes)) + 4;
    const count = Math.ceil(PER_DECADE * (high - low));
    const w = Array.from({ length: count + 1 }, (_, k) => Math.pow(10, low + ((high - low) * k) / count));
    for (const [re, im] of all) {
      if (im <= 0 || Math.abs(re) > 0.2 * Math.hypot(re, im)) continue;
      const width = Math.max(Math.abs(re), 1e-9 * im);
      for (let k = 0; k < 40; k++) {
        const away = width * Math.pow(10, -2 + (5 * k) / 39);
        w.push(im + away);
        if (im > away) w.push(im - away);
      }
    }
    if (w.length > count + 1) w.sort((a, b) => a - b);
    const first = Math.pow(10, low), last = Math.pow(10, high);
    return w.filter((x) => x > first && x < last);
  }

  const NOTHING = [];

  /* Return points within a grid interval in which the dead time turns quickly, up to a total number of points. */
  function within(grid, delay) {
    let count = 0;
    return (i) => {
      const width = grid[i + 1] - grid[i], pieces = Math.ceil((width * delay) / TURN);
      if (!(pieces > 1)) return NOTHING;
      if ((count += pieces) > MOST) fail(TOO_MANY);
      return Array.from({ length: pieces - 1 }, (_, k) => grid[i] + (width * (k + 1)) / pieces);
    };
  }

  /* Return a grid with these points in each interval for which `matters(i)` is true. */
  function divided(grid, delay, matters) {
    const inside = within(grid, delay);
    return delay ? grid.flatMap((w, i) => (i + 1 < grid.length && matters(i) ? [w, ...inside(i)] : [w])) : grid;
  }

  /* Return the zero of a function between two points of different sign, by the Illinois method: false position in
     which the function value at an end that is kept is halved. */
  function zero(f, a, b) {
    let fa = f(a), fb = f(b), last = Infinity, kept = 0;
    for (let k = 0; k < 100; k++) {
      const c = (a * fb - b * fa) / (fb - fa);
      if (!(Math.abs(c - last) > 1e-14 * c)) return c;
      const fc = f(last = c);
      if (fc === 0) return c;
      if (fc < 0 === fa < 0) { a = c; fa = fc; if (kept === 1) fb /= 2; kept = 1; } else { b = c; fb = fc; if (kept === -1) fa /= 2; kept = -1; }
    }
    return last;
  }

  /* Return the largest value of a smooth function between two points near a local maximum, by golden-section search. */
  function summit(f, a, b) {
    const share = (Math.sqrt(5) - 1) / 2;
    let c = b - share * (b - a), d = a + share * (b - a), fc = f(c), fd = f(d);
    for (let k = 0; k < 28; k++) { // the error is 1e-6 of the place, and the square of that of the value
      if (fc > fd) { b = d; d = c; fd = fc; c = b - share * (b - a); fc = f(c); }
      else { a = c; c = d; fc = fd; d = a + share * (b - a); fd = f(d); }
    }
    return Math.max(fc, fd);
  }

  const ENOUGH = 2e-5; // values that exceed the best value by less than this share are not sought

  /* Return the suprema of |S| and |C S| over all frequencies. `ends` are their limits at the ends of the axis. Where the dead
     time is not resolved, |L| gives upper bounds. If the bound of an interval exceeds the best value, the interval is resolved. */
  function peaks(loop, { w: grid, re, im, size, control }, ends) {
    const found = ends.slice(), inner = [], inside = within(grid, loop.delay);
    const closeness = (x, y) => 1 / Math.sqrt((1 + x) * (1 + x) + y * y);
    const heighten = (s, c) => { if (s > found[0]) found[0] = s; if (c * s > found[1]) found[1] = c * s; };
    const resolve = (i) => {
      const between = inside(i);
      if (!between.length) return;
      inner[i] = along(loop, between);
      for (let k = 0; k < between.length; k++) heighten(closeness(inner[i].re[k], inner[i].im[k]), inner[i].control[k]);
    };
      look(loop, 1e-9 * grid[0]); // the limit at rest, which no grid point reaches
    heighten(closeness(seen[0], seen[1]), Math.hypot(seen[2], seen[3]));
    for (let i = 0; i < grid.length; i++) heighten(closeness(re[i], im[i]), control[i]);
    for (let i = 0; i + 1 < grid.length; i++) if (Math.max(size[i], size[i + 1]) >= 0.5) resolve(i);
    const level = found.map((x) => x * (1 + ENOUGH));
    const exceeds = (i) => { const most = 1 / Math.max(1 - size[i], 1e-3); return most >= level[0] || control[i] * most >= level[1]; };
    for (let i = 0; i + 1 < grid.length; i++) if (!inner[i] && (exceeds(i) || exceeds(i + 1))) resolve(i);

    const fine = [];
    for (let i = 0; i < grid.length; i++) {
      fine.push([grid[i], closeness(re[i], im[i]), control[i]]);
      inner[i]?.w.forEach((w, k) => fine.push([w, closeness(inner[i].re[k], inner[i].im[k]), inner[i].control[k]]));
    }
    const one = (w) => { look(loop, w); return closeness(seen[0], seen[1]); };
    return [one, (w) => one(w) * Math.sqrt(seen[2] * seen[2] + seen[3] * seen[3])].map((f, which) => {
      const values = fine.map(([, s, c]) => (which ? c * s : s));
      let best = found[which];
      for (let i = 1; i + 1 < fine.length; i++) {
        if (values[i] >= values[i - 1] && values[i] >= values[i + 1] && values[i] > 0.8 * best) best = Math.max(best, summit(f, fine[i - 1][0], fine[i + 1][0]));
      }
      return best;
    });
  }

  // --- stability ----------------------------------------------------------------------------------------------------

  /* Count the closed-loop poles right of the line s = jw - lean (w + w0) by the argument principle. Return null if a pole is on
     the line. */
  function encirclements(loop, parts, w, lean) {
    const nonzero = parts.poles.map(modulus).filter((size) => size > 0);
    const least = nonzero.length ? Math.min(...nonzero) : 1;
    const reference = parts.poles.map((pole) => modulus(pole) || least);
    /* Return the phase of 1 + L without its poles, divided by a factor that does not turn, or NaN where 1 + L is 0. */
    const phase = (x) => {
      const s = [-lean * (x + w[1]), x];
      let re = parts.lead, im = 0, a = parts.lead, b = 0, next; // real numbers, for speed
      for (let k = 0; k < reference.length; k++) {
        const [p, q] = parts.poles[k], far = s[0] + reference[k];
        next = re * (s[0] - p) - im * (x - q);
        im = re * (x - q) + im * (s[0] - p);
        re = next;
        next = a * far - b * x;
        b = a * x + b * far;
        a = next;
      }
      const top = parts.top(s), fading = Math.exp(-s[0] * loop.delay), cos = fading * Math.cos(x * loop.delay), sin = fading * Math.sin(x * loop.delay);
      const c = top[0] * cos + top[1] * sin, d = top[1] * cos - top[0] * sin;
      const f = re + c, g = im + d;
      if (Math.hypot(f, g) <= 1e-9 * (Math.hypot(re, im) + Math.hypot(c, d))) return NaN;
      return Math.atan2(g * a - f * b, f * a + g * b);
    };
    /* Follow the argument. Halve intervals in which it turns quickly. */
    let total = 0, from = phase(w[0]);
    if (Number.isNaN(from)) return null;
    for (let i = 1; i < w.length; i++) {
      const ahead = [w[i]];
      let left = w[i - 1];
      while (ahead.length) {
        const to = phase(ahead[ahead.length - 1]);
        if (Number.isNaN(to)) return null;
        const turn = wrapped(to - from);
        if (Math.abs(turn) > 0.8) {
          if (ahead.length > 60) return null;
          ahead.push((left + ahead[ahead.length - 1]) / 2);
        } else {
          total += turn;
          from = to;
          left = ahead.pop();
        }
      }
    }
    const limit = loop.delay || 1 + parts.atInfinity > 0 ? 0 : Math.PI;
    const count = -(total - wrapped(from - limit)) / Math.PI;
    return Math.abs(count - Math.round(count)) < 0.2 ? Math.round(count) : null;
  }

  function isStable(loop, parts, grid, size) {
    if (!loop.delay && Math.abs(1 + parts.atInfinity) < 1e-12) fail("the loop is ill-posed: its direct feedthrough is exactly -1");
    // A neutral loop whose gain does not fall below 1 has an unstable chain of poles.
    if (loop.delay && Math.abs(parts.atInfinity) >= 1 - 1e-12) return false;
    const w = [0, ...divided(grid, loop.delay, (i) => Math.max(size[i], size[i + 1]) >= 0.5)];
    for (const lean of [0, 1e-9, 1e-7]) {
      const count = encirclements(loop, parts, w, lean);
      if (count !== null) return count === 0;
    }
    return false; // a pole too close to the axis counts as unstable
  }

  // --- margins ------------------------------------------------------------------------------------------------------

  const margins = (asked) => ({ ...prepared(asked).margins() });

  function marginsOf(found) {
    const { loop } = found, parts = found.parts(), grid = found.grid(), open = found.open(), { re, im, size } = open;
    const none = { ms: NaN, mks: NaN, gm: NaN, pm: NaN, dm: NaN, stable: false };
    if (!isStable(loop, parts, grid, size)) return none;

    const farOut = loop.delay ? -Math.abs(parts.atInfinity) : parts.atInfinity; // with dead time every phase occurs
    const least = 1 / Math.abs(1 + farOut), last = open.control[grid.length - 1];
    const [ms, mks] = peaks(loop, open, [least, last * least]);

    /* Return the gain crossovers, which do not depend on the dead time. A gain that only touches 1 needs more points. */
    let pm = Infinity, dm = Math.abs(parts.atInfinity) >= 1 ? 0 : Infinity;
    const excess = (w) => { look(loop, w); return 0.5 * Math.log(seen[0] * seen[0] + seen[1] * seen[1]); };
    let marks = grid, levels = size.map(Math.log);
    const touching = grid.flatMap((w, i) => {
      if (!(Math.abs(levels[i]) < 0.1) || i === 0 || i + 1 === grid.length) return NOTHING;
      const sign = levels[i] < 0 ? 1 : -1, [a, b, c] = [levels[i - 1], levels[i], levels[i + 1]].map((x) => sign * x), from = grid[i - 1], to = grid[i + 1];
      const crosses = b < 0 && b >= a && b > c && summit((x) => sign * excess(x), from, to) > 0;
      return crosses ? Array.from({ length: 49 }, (_, k) => from + ((to - from) * (k + 1)) / 50) : NOTHING;
    });
    if (touching.length) {
      marks = [...grid, ...touching].sort((a, b) => a - b);
      levels = marks.map(excess);
    }
    for (let i = 0; i + 1 < marks.length; i++) {
      if (levels[i] * levels[i + 1] >= 0) continue;
      const w = zero(excess, marks[i], marks[i + 1]);
      const lag = (angle(openLoop(loop, w)) + Math.PI + 4 * Math.PI) % (2 * Math.PI); // phase lag of the extra dead time
      pm = Math.min(pm, (Math.min(lag, 2 * Math.PI - lag) * 180) / Math.PI);
      dm = Math.min(dm, lag / w);
    }

    /* Phase crossovers: the largest |L| below 1 determines the margin. Smaller |L| are sought only if there is none. If the
       gain does not tend to 0, there are infinitely many. Those within a hundredth of its limit count as equal to the limit. */
    const far = farOut < 0 && farOut > -1 ? -farOut : 0;
    let loudest = Math.max(far, atZero(loop));
    const imaginary = (w) => { look(loop, w); return seen[1] / Math.sqrt(seen[0] * seen[0] + seen[1] * seen[1]); };
    const between = (left, before, right, after) => {
      if (!(before * after < 0 && Math.min(Math.abs(before), Math.abs(after)) > 1e-12)) return;
      const l = openLoop(loop, zero(imaginary, left, right));
      if (l[0] < 0 && modulus(l) < 1) loudest = Math.max(loudest, modulus(l));
    };
    for (let level = 0.1; level > 1e-9; level /= 100) {
      const inside = within(grid, loop.delay), quietest = Math.max(level, loudest, 1.01 * far);
      for (let i = 0; i + 1 < grid.length; i++) {
        if (loop.delay && Math.max(size[i], size[i + 1]) < quietest) continue;
        let left = grid[i], before = im[i] / size[i], loud = size[i];
        for (const right of inside(i)) {
          const after = imaginary(right), next = Math.sqrt(seen[0] * seen[0] + seen[1] * seen[1]);
          if (Math.max(loud, next) > 0.5 * loudest) between(left, before, right, after);
          [left, before, loud] = [right, after, next];
        }
        if (Math.max(loud, size[i + 1]) > 0.5 * loudest) between(left, before, grid[i + 1], im[i + 1] / size[i + 1]);
      }
      if (!loop.delay || loudest >= level) break;
    }
    return { ms, mks, gm: loudest ? 1 / loudest : Infinity, pm, dm, stable: true };
  }

  /* Return |L(0)| if L(0) is between -1 and 0, a phase crossover at zero frequency. */
  function atZero({ num, den, ki, kp }) {
    const bottom = ki ? 0 : den[den.length - 1], limit = bottom ? (num[num.length - 1] * kp) / bottom : 0;
    return limit < 0 && limit > -1 ? -limit : 0;
  }

  /* Return L(jw) = re + j im, |C(jw)| and the phase of C in degrees at given frequencies. The default frequencies resolve every
     turn while |L| is above 0.02. */
  const frequencyResponse = (asked) => (asked.w ? responseOf(prepared(asked), asked.w) : prepared(asked).response());

  function responseOf(found, asked) {
    const { loop } = found;
    if (asked) return along(loop, asked);
    const { w, size } = found.open(), fine = divided(w, loop.delay, (i) => Math.max(size[i], size[i + 1]) >= 0.02);
    return fine.length > w.length ? along(loop, fine) : found.open();
  }

  // --- matrices, as arrays of rows ----------------------------------------------------------------------------------

  /* Solve a small linear system by elimination with pivoting. */
  function solve(matrix, right) {
    const rows = matrix.map((row, i) => [...row, right[i]]), n = rows.length;
    for (let p = 0; p < n; p++) {
      const best = rows.reduce((top, row, i) => (i >= p && Math.abs(row[p]) > Math.abs(rows[top][p]) ? i : top), p);
      [rows[p], rows[best]] = [rows[best], rows[p]];
      for (let i = 0; i < n; i++) {
        const share = i === p ? 0 : rows[i][p] / rows[p][p];
        if (share) for (let j = p; j <= n; j++) rows[i][j] -= share * rows[p][j];
      }
    }
    return rows.map((row, i) => row[n] / row[i]);
  }

  function inverted(matrix) {
    const columns = matrix.map((_, j) => solve(matrix, matrix.map((_, i) => (i === j ? 1 : 0))));
    return matrix.map((_, i) => columns.map((column) => column[i]));
  }

  const zeros = (rows, columns) => Array.from({ length: rows }, () => new Float64Array(columns));

  function product(a, b) {
    const result = zeros(a.length, b[0].length);
    for (let i = 0; i < a.length; i++) {
      for (let k = 0; k < b.length; k++) {
        const x = a[i][k];
        if (x) for (let j = 0; j < b[0].length; j++) result[i][j] += x * b[k][j];
      }
    }
    return result;
  }

  /* Return the matrix exponential by a Taylor series of the scaled matrix and squaring. Square `more` additional times. */
  function exponential(matrix, time, more = 0) {
    const n = matrix.length;
    const norm = Math.max(...matrix.map((row) => row.reduce((sum, x) => sum + Math.abs(x), 0))) * time;
    const halvings = Math.max(0, Math.ceil(Math.log2(norm + 1e-300)) + 2 + more);
    const step = time / Math.pow(2, halvings);
    let sum = zeros(n, n), term = zeros(n, n);
    for (let i = 0; i < n; i++) sum[i][i] = term[i][i] = 1;
    for (let k = 1; k <= 12; k++) {
      term = product(term, matrix);
      for (let i = 0; i < n; i++) for (let j = 0; j < n; j++) sum[i][j] += term[i][j] *= step / k;
    }
    for (let k = 0; k < halvings; k++) sum = product(sum, sum);
    return sum;
  }

  // --- the loop, opened at its dead time ----------------------------------------------------------------------------

  /* Realise the loop, with the states process (in its own time unit), lags of the filter, integral of the error, set point.
     x' = A x + b w with w(t) = v(t - delay); y = cy x + dy w, u = cu x + du w, v = u + load. */
  function stateSpace(loop) {
    const np = loop.den.length - 1, n = loop.order, size = np + n + 2, step = size - 1, integral = size - 2;
    const speeds = roots(loop.den).map(modulus).filter((speed) => speed > 0);
    const unit = speeds.length ? Math.exp(speeds.reduce((sum, speed) => sum + Math.log(speed), 0) / speeds.length) : 1 / (loop.delay || 1);
    const A = zeros(size, size), b = new Float64Array(size), cy = new Float64Array(size), cu = new Float64Array(size);

    // Process in controllable form, with powers of s measured in `unit`.
    const scale = (coefficients) => coefficients.map((c, i) => c * Math.pow(unit, coefficients.length - 1 - i));
    const den = scale(loop.den), lead = den[0];
    const num = [...Array(np + 1 - loop.num.length).fill(0), ...scale(loop.num)];
    const dy = num[0] / lead;
    for (let k = 0; k < np; k++) {
      if (k > 0) A[k][k - 1] = unit;
      A[0][k] = (-unit * den[k + 1]) / lead;
      cy[k] = num[k + 1] / lead - (dy * den[k + 1]) / lead;
    }
    if (np) b[0] = unit;

    // The error r - y, as a row, drives the lags of the filter and the integral.
    const { A: chain, b: first, row } = controllerBlock(loop), error = cy.map((c) => -c);
    error[step] = 1;
    for (let k = 0; k < n; k++) {
      for (let j = 0; j < size; j++) A[np + k][j] = first[k] * error[j];
      for (let j = 0; j < n; j++) A[np + k][np + j] += chain[k][j];
      b[np + k] = -dy * first[k];
      cu[np + k] = row[k + 1];
    }
    A[integral].set(error);
    b[integral] = -dy;
    for (let j = 0; j < size; j++) cu[j] += row[0] * error[j];
    cu[integral] += loop.ki;
    const du = -row[0] * dy;
    return { A, b, cy, dy, cu, du, size, step, np, unit };
  }

  const dot = (row, x) => { let sum = 0; for (let j = 0; j < row.length; j++) sum += row[j] * x[j]; return sum; };
  const flat = (rows) => {
    const result = new Float64Array(rows.length * (rows[0]?.length ?? 0)); // a plant or filter without states has no rows
    rows.forEach((row, i) => result.set(row, i * row.length));
    return result;
  };

  /* Compute result = matrix x for a flat matrix. */
  function apply(matrix, x, result) {
    for (let i = 0, k = 0; i < result.length; i++) {
      let sum = 0;
      for (let j = 0; j < x.length; j++, k++) sum += matrix[k] * x[j];
      result[i] = sum;
    }
  }

  // --- linear responses ---------------------------------------------------------------------------------------------

  const NODES = 6; // evenly spaced nodes of a piece, including its ends; w is a polynomial of degree 5 on each piece
  const INVERSE = inverted( // of the Vandermonde matrix of the nodes 0, 1/5, …, 1; it converts values to coefficients
    Array.from({ length: NODES }, (_, i) => Array.from({ length: NODES }, (_, q) => Math.pow(i / (NODES - 1), q))));
  const EACH = 8; // pieces of each size; the error of the polynomials in a kick has the same gain to the output as the kick
  const MOST_PIECES = 300000; // largest number of pieces of a response

  /* Return the sizes of the pieces of one dead time. The response is not smooth at multiples of the dead time, so the pieces
     are short at its beginning, and double until they are as long as the slower motion of the loop permits. */
  function pieces(delay, shortest, longest) {
    const many = Math.max(4, Math.ceil(delay / longest));
    const levels = Math.max(0, Math.min(50, Math.ceil(Math.log2(delay / (many * shortest)))));
    const exponents = [];
    if (!(EACH * levels + many <= MOST_PIECES)) fail(`the loop moves within ${longest}, too fast to follow through a dead time of ${delay}; take a longer controller.filterTime`);
    for (let level = 0; level < levels; level++) for (let k = 0; k < EACH; k++) exponents.push(level);
    while (exponents.length < EACH * levels + many) exponents.push(levels);
    const units = exponents.reduce((sum, level) => sum + Math.pow(2, level), 0);
    return { exponents, levels, unit: delay / units };
  }

  /* Return one flat matrix for pieces of one size. Given the state at the beginning and w at the nodes, it computes the state at
     the end, then y and u at all nodes except the first. Between the nodes, w is the polynomial through the nodes. For this
     input the exponential of a larger matrix is exact. `matrix` advances to the next node, `whole` to the end. */
  function transitions({ size, cy, dy, cu, du }, matrix, whole, length) {
    // Convert derivatives of w at the beginning, q! a_q / length^q, to its values at the nodes.
    const nodal = (row) => {
      const result = new Float64Array(size + NODES);
      for (let j = 0; j < size; j++) result[j] = row[j];
      for (let q = 0, factor = 1; q < NODES; factor *= ++q / length) {
        for (let j = 0; j < NODES; j++) result[size + j] += row[size + q] * factor * INVERSE[q][j];
      }
      return result;
    };
    const outputs = [[cy, dy], [cu, du]].flatMap(([c, direct]) => {
      let row = [Float64Array.from({ length: size + NODES }, (_, j) => c[j] ?? 0)];
      return Array.from({ length: NODES - 1 }, (_, i) => {
        row = product(row, matrix);
        const seen = nodal(row[0]);
        seen[size + i + 1] += direct;
        return seen;
      });
    });
    return flat([...whole.slice(0, size).map(nodal), ...outputs]);
  }

  /* Return the pieces of one dead time, and a matrix for each size. A `share` below 1 makes the pieces shorter. */
  function motion(loop, parts, grid, loudness, space, share = 1) {
    const { A, b, size } = space, { shortest, longest } = speeds(loop, parts, grid, loudness);
    const { exponents, levels, unit } = pieces(loop.delay, share * shortest, share * longest);
    // Compute one exponential from node to node, for a fifth of the shortest piece, and square it for each doubling.
    const wide = zeros(size + NODES, size + NODES), ready = [];
    for (let i = 0; i < size; i++) { wide[i].set(A[i]); wide[i][size] = b[i]; }
    for (let q = 0; q + 1 < NODES; q++) wide[size + q][size + q + 1] = 1;
    let matrix = exponential(wide, unit / (NODES - 1));
    for (let level = 0; level <= levels; level++) {
      const twice = product(matrix, matrix), whole = product(product(twice, twice), matrix); // five steps from node to node
      ready.push(transitions(space, matrix, whole, unit * Math.pow(2, level)));
      matrix = twice;
    }
    return { exponents, unit, ready };
  }

  /* Simulate dead time by dead time and piece by piece. On each piece, w equals v on the same piece one dead time earlier. */
  function march({ delay }, { cy, dy, cu, du, size, step }, { exponents, unit, ready }, setpoint, load, times) {
    const end = times[times.length - 1], intervals = Math.floor(end / delay + 1e-9) + 1;
    if (intervals * exponents.length > MOST_PIECES) fail(`${intervals} dead times are too many to follow; shorten end`);

    const y = new Float64Array(times.length), u = new Float64Array(times.length);
    const delayed = exponents.map(() => new Float64Array(NODES)); // w on each piece of the present interval
    const input = new Float64Array(size + NODES), after = new Float64Array(size + 2 * (NODES - 1));
    const x = new Float64Array(size), yNodes = new Float64Array(NODES), uNodes = new Float64Array(NODES);
    const yPowers = new Float64Array(NODES), uPowers = new Float64Array(NODES);
    let next = 0;
    x[step] = setpoint;
    for (let k = 0; k < intervals && next < times.length; k++) {
      let from = k * delay;
      for (let p = 0; p < exponents.length; p++) {
        const length = unit * Math.pow(2, exponents[p]), w = delayed[p];
        input.set(x);
        input.set(w, size);
        apply(ready[exponents[p]], input, after);
        yNodes[0] = dot(cy, x) + dy * w[0];
        uNodes[0] = dot(cu, x) + du * w[0];
        for (let i = 1; i < NODES; i++) { yNodes[i] = after[size + i - 1]; uNodes[i] = after[size + NODES + i - 2]; }
        const to = p + 1 < exponents.length ? from + length : (k + 1) * delay;
        const begin = next;
        // A time within rounding of the next piece belongs to this next piece, since it comes after a jump.
        for (; next < times.length && times[next] < to - 1e-12 * end - (next + 1 === times.length ? -2e-12 * end : 0); next++) {
          if (next === begin) { powers(yNodes, yPowers); powers(uNodes, uPowers); }
          const share = (times[next] - from) / (to - from);
          y[next] = horner(yPowers, share);
          u[next] = horner(uPowers, share);
        }
        for (let i = 0; i < NODES; i++) w[i] = uNodes[i] + load;
        for (let i = 0; i < size; i++) x[i] = after[i];
        from = to;
      }
    }
    return { y, u };
  }

  /* Return the coefficients of the polynomial through the nodes, in ascending powers, and its value. */
  function powers(values, coefficients) {
    for (let q = 0; q < NODES; q++) coefficients[q] = dot(INVERSE[q], values);
  }
  function horner(coefficients, share) {
    let sum = 0;
    for (let q = NODES - 1; q >= 0; q--) sum = sum * share + coefficients[q];
    return sum;
  }

  /* Return the lengths of the shortest and the longest piece, given the fastest pole and the fastest lasting motion. */
  function speeds(loop, parts, grid, loudness) {
    const fastest = Math.max(1 / loop.delay, ...parts.poles.map(modulus));
    let lasting = 1 / loop.delay;
    for (const [re, im] of parts.poles) {
      if (Math.abs(re) < 0.7 * Math.hypot(re, im) || re > 0) lasting = Math.max(lasting, Math.hypot(re, im));
    }
    // The loop still reacts at these frequencies. If its gain does not decrease, use the fastest pole.
    const loudest = grid.findLast((_, i) => loudness[i] > 0.03) ?? 0;
    lasting = Math.max(lasting, Math.min(loudest, 2 * fastest));
    return { shortest: 0.25 / fastest, longest: 1.0 / lasting };
  }

  /* Simulate without dead time. With w = v, one exponential advances the loop from time to time. The load is an
     additional state. */
  function closed({ A, b, cy, dy, cu, du, size, step }, setpoint, load, times, more = 0) {
    if (Math.abs(1 - du) < 1e-12) fail("the loop is ill-posed: its direct feedthrough is exactly -1");
    const v = Float64Array.from({ length: size + 1 }, (_, j) => (j < size ? cu[j] : 1) / (1 - du));
    const matrix = zeros(size + 1, size + 1);
    for (let i = 0; i < size; i++) for (let j = 0; j <= size; j++) matrix[i][j] = (j < size ? A[i][j] : 0) + b[i] * v[j];
    const y = new Float64Array(times.length), u = new Float64Array(times.length);
    let x = new Float64Array(size + 1), other = new Float64Array(size + 1), length = 0, ahead;
    x[step] = setpoint;
    x[size] = load;
    for (let k = 0; k < times.length; k++) {
      const time = k && times[k] - times[k - 1];
      if (Math.abs(time - length) > 1e-10 * time) ahead = flat(exponential(matrix, length = time, more));
      if (k) { apply(ahead, x, other); [x, other] = [other, x]; }
      const now = dot(v, x);
      y[k] = dot(cy, x) + dy * now;
      u[k] = dot(cu, x) + du * now;
    }
    return { y, u };
  }

  function simulate(asked) {
    const found = prepared(asked), { loop } = found, end = real("end", asked.end), points = real("points", asked.points, 2);
    if (end <= 0) fail(`end must be above 0, found ${end}`);
    if (!Number.isInteger(points)) fail(`points must be an integer, found ${points}`);
    const setpoint = real("setpoint", asked.setpoint ?? 0), load = real("load", asked.load ?? 0), free = found.linear(end, points, setpoint, load);
    const [low, high] = loop.limits ?? [-Infinity, Infinity];
    return free.least < low || free.most > high ? limited(asked, loop, free.t) : { t: free.t, y: free.y, u: free.u, fine: free.fine };
  }

  const ORDINARY = 1e-3; // with filters as fast as this share of the plant's time constants the error is below 1e-6
  const TRUST = 2e-6; // largest uncertainty with a faster filter, relative to the largest value
  const FINER = 0.4; // ratio of the piece sizes of the second run; they always differ, since sizes are powers of 2 apart
  const ROUNDING = 10 * 2 ** -52; // relative to the largest gain of the filter's lags, which are stored as one number with kp

  /* Return the relative difference of y and u of two runs with different pieces and different rounding. How many digits a fast
     filter loses depends on the loop, since a second derivative amplifies the rounding of y by ka / filterTime^2. This does
     not detect the rounding of the gains, which is equal in both runs. */
  function uncertain(found, asked, { y, u }) {
    const { loop } = found, space = found.space();
    const again = loop.delay
      ? march(loop, space, motion(loop, found.parts(), found.grid(), found.open().size, space, FINER), ...asked)
      : closed(space, ...asked, 1);
    const { ki, kp, kd, ka, time } = loop, { unit } = space, kick = Math.abs(kd) / time + Math.abs(ka) / time ** 2;
    const slow = Math.max(Math.abs(ki) / unit, Math.abs(kp), Math.abs(kd) * unit, Math.abs(ka) * unit ** 2);
    return Math.max(slow && (ROUNDING * kick) / slow, ...[[y, again.y], [u, again.u]].map(([one, other]) => {
      let apart = 0, size = 0;
      for (let k = 0; k < one.length; k++) {
        apart = Math.max(apart, Math.abs(one[k] - other[k]));
        size = Math.max(size, Math.abs(one[k]));
      }
      return size ? apart / size : apart;
    }));
  }

  /* Refuse a filter that is so much faster than the plant that rounding becomes visible. Name the shortest allowed filter. */
  function requireDigits(found, asked, run) {
    const { loop } = found, fast = ({ order, time }, { unit }) => order && time * unit < ORDINARY;
    if (!fast(loop, found.space()) || uncertain(found, asked, run) <= TRUST) return;
    for (let time = 2 * loop.time; ; time *= 2) {
      const slower = unlimited({ ...loop, time, limits: null }), space = slower.space();
      const serves = () => uncertain(slower, asked, loop.delay ? march(slower.loop, space, slower.motion(), ...asked) : closed(space, ...asked)) <= TRUST;
      if (!fast(slower.loop, space) || serves()) {
        fail(`controller.filterTime ${loop.time} is too short for this plant, since rounding would show; the shortest allowed one is about ${time.toPrecision(2)}`);
      }
    }
  }

  /* Return the response of a loop without limits, and the range of u. */
  function linear(found, end, points, setpoint, load) {
    const { loop } = found, t = new Float64Array(points).map((_, k) => (end * k) / (points - 1)), all = finer(loop, t);
    const { y, u } = loop.delay ? march(loop, found.space(), found.motion(), setpoint, load, all) : closed(found.space(), setpoint, load, all);
    requireDigits(found, [setpoint, load, all], { y, u });
    let at = -1, least = Infinity, most = -Infinity;
    for (let k = 0; k < u.length; k++) {
      if (u[k] < least) least = u[k];
      if (u[k] > most) most = u[k];
    }
    const even = t.map((time) => { do at++; while (all[at] !== time); return at; }), pick = (signal) => even.map((k) => signal[k]);
    return { t, y: pick(y), u: pick(u), fine: { t: all, u }, least, most };
  }

  /* Return the intervals in which derivatives kick, as pairs of times. They last some filter times, from the step and from the
     first dead times, when the kick has passed through the loop. */
  const kicks = ({ order, time, delay }) => (order ? Array.from({ length: delay ? 4 : 1 }, (_, k) => [k * delay, k * delay + (order + 4) * time]) : []);

  /* Return evenly spaced times and, during kicks, times at most a sixteenth of the filter time apart. */
  function finer(loop, times) {
    const end = times[times.length - 1], even = times[1], parts = Math.ceil((16 * even) / loop.time), more = [];
    if (!(parts > 1 && parts < Infinity)) return times;
    const other = (time) => Math.abs(time / even - Math.round(time / even)) > 1e-6 && time < end;
    for (const [from, to] of kicks(loop)) {
      for (let k = 0, time = from; time < to; time = from + (++k * even) / parts) if (other(time)) more.push(time);
    }
    const all = new Float64Array(times.length + more.length);
    all.set(times);
    all.set(more, times.length);
    return all.sort();
  }

  // --- a digital controller, its limits, noise ----------------------------------------------------------------------

  /* Return the transition of x' = A x + b w over a time with a held input, as a flat matrix for [x, w]. */
  function drift(A, b, time) {
    const n = b.length, wide = zeros(n + 1, n + 1);
    for (let i = 0; i < n; i++) { wide[i].set(A[i]); wide[i][n] = b[i]; }
    const exact = exponential(wide, time);
    return flat(exact.slice(0, n));
  }

  /* Return the sampled process, y = out x + dy w. It has a transition for each piece of a sample in which the delayed input is
     constant. The input of a piece was set `ago` samples earlier. */
  function held({ A, b, cy, dy, np }, delay, h) {
    if (dy && delay < h * 1e-9) fail("the process answers within the sample");
    const own = A.slice(0, np).map((row) => row.slice(0, np)), whole = Math.floor(delay / h + 1e-9), part = delay - whole * h;
    const ways = part < h * 1e-9 ? [[h, whole]] : [[part, whole + 1], [h - part, whole]];
    const piece = (time, ago) => ({ matrix: drift(own, b.slice(0, np), time), ago }), steps = ways.map((way) => piece(...way));
    const until = (time) => (ways.length < 2 || time <= part ? [piece(time, ways[0][1])] : [steps[0], piece(time - part, whole)]);
    const inside = remembering(2, (count) => Array.from({ length: count - 1 }, (_, j) => until(((j + 1) * h) / count)));
    return { np, dy, out: cy.slice(0, np), steps, inside };
  }

  /* Return the lags of the filter with the error as input, and the control signal minus its integral as a row. The row is
     (C(s) - ki/s) error, with ki/s (p^n - 1) = -ki T (p + ... + p^n) for the lag p = 1/(1 + T s). */
  function controllerBlock(loop) {
    const n = loop.order, A = zeros(n, n), b = new Float64Array(n), row = new Float64Array(n + 1); // row[0]: the error
    for (let k = 0; k < n; k++) {
      A[k][k] = -1 / loop.time;
      if (k) A[k][k - 1] = 1 / loop.time; else b[0] = 1 / loop.time;
      row[k + 1] = -loop.ki * loop.time;
    }
    row[n] += loop.kp;
    if (loop.kd) { row[n - 1] += loop.kd / loop.time; row[n] -= loop.kd / loop.time; }
    if (loop.ka) {
      const gain = loop.ka / (loop.time * loop.time);
      row[n - 2] += gain; row[n - 1] -= 2 * gain; row[n] += gain;
    }
    return { A, b, row };
  }

  /* Return the stabilising controller and the reset time of the series form (kp + kd s + ka s^2)(1 + time s)/(time s) with the
     gains of the loop. The fastest real zero becomes the reset, as in huba2024. It may be one of a pair due to rounding. */
  function series(loop) {
    const gains = [loop.ka, loop.kd, loop.kp, loop.ki];
    const real = loop.ki ? roots(gains).filter(([re, im]) => re < 0 && Math.abs(im) < 0.1 * Math.hypot(re, im)) : [];
    if (!real.length) fail("an automatic reset needs gains with a real zero left of the axis");
    const time = -1 / Math.min(...real.map(([re]) => re));
    // ki (1 + c1 s + c2 s^2)(1 + time s) has these gains. Divide, beginning with the lowest power.
    const kp = loop.ki * time, kd = (loop.kp - kp) * time, ka = loop.ka;
    return { time, block: { ...loop, ki: 0, kp, kd, ka } };
  }

  /* Replace x by matrix [x, w]. `next` is memory for the result. */
  function advance(matrix, x, w, next) {
    const n = x.length;
    for (let i = 0, k = 0; i < n; i++) {
      let sum = 0;
      for (let j = 0; j < n; j++, k++) sum += matrix[k] * x[j];
      next[i] = sum + matrix[k++] * w;
    }
    for (let i = 0; i < n; i++) x[i] = next[i];
  }

  const WAYS = ["none", "clamping", "conditioning", "reset"], METHODS = ["held", "backward"], MOST_SAMPLES = 2e6;

  /* Return the coefficients of the integral of a sampled controller. It grows by `error` times the error and by `signal` times
     the output of the other actions. It is reduced by `tracking` times the part that a limit cut off. */
  function integralOf(loop, way, h, backward, trackingTime) {
    if (way === "reset") {
      const { time, block } = series(loop), share = -Math.expm1(-h / time);
      return backward
        ? { block, error: 0, signal: h / time, tracking: h / (time + h) }
        : { block, error: 0, signal: share, tracking: share };
    }
    const own = { block: loop, error: loop.ki * h, signal: 0, tracking: 0 };
    if (way !== "conditioning") return own;
    const time = trackingTime ?? (backward ? loop.kp : loop.kp - loop.ki * loop.time * loop.order) / loop.ki;
    own.tracking = backward ? h / (time + h) : h / time;
    if (!(own.tracking > 0 && own.tracking < 1)) fail("conditioning needs a tracking time, by default kp/ki, above the sample time");
    return own;
  }

  /* Simulate the loop with a sampled controller whose output is held. The process is exact. antiWindup is one of four words.
     "none" has no effect. With "clamping" the integral stops while it would drive u further beyond a limit, and with differences
     it grows up to the limit. With "conditioning" it integrates the error that would have given the limited signal, or with a
     trackingTime it removes the part that the limit cut off. With "reset" it is the limited signal, filtered by a lag (automatic
     reset). method is "held", for filters that are exact for a held input, or "backward", for differences as in most PLCs. */
  function simulateSampled(asked) {
    const loop = readLoop(asked), h = real("sampleTime", asked.sampleTime, 0), end = real("end", asked.end, 0);
    const way = asked.antiWindup ?? "none", method = asked.method ?? "held", setpoint = asked.setpoint ?? 0, load = asked.load ?? 0;
    if (!(h > 0 && h <= end)) fail(`sampleTime must be above 0 and at most end, found ${h}`);
    if (!WAYS.includes(way)) fail(`antiWindup must be none, clamping, conditioning or reset, found ${way}`);
    if (!METHODS.includes(method)) fail(`method must be held or backward, found ${method}`);
    const backward = method === "backward";
    if (!backward && loop.order && loop.time < h * (1 - 1e-9)) fail(`the filter (${loop.time}) is faster than the sample time ${h}: sample faster or filter longer`);
    const count = Math.round(end / h) + 1;
    if (count > MOST_SAMPLES) fail(`sampleTime ${h} makes ${count} samples; take a longer one`);
    const [low, high] = loop.limits ?? [-Infinity, Infinity];
    const { np, dy, out, steps, inside: parts } = prepared(asked).held(h), between = asked.between ?? 1, rule = integralOf(loop, way, h, backward, asked.trackingTime);
    const block = controllerBlock(rule.block), inside = backward ? null : drift(block.A, block.b, h), newest = h / (loop.time + h);

    const t = new Float64Array(count), y = new Float64Array(count), u = new Float64Array(count);
    const before = steps[0].ago, v = new Float64Array(count + before);
    const x = new Float64Array(np), z = new Float64Array(loop.order), next = new Float64Array(Math.max(np, loop.order));
    const fine = between > 1 ? { t: new Float64Array((count - 1) * between + 1), y: new Float64Array((count - 1) * between + 1) } : null, copy = new Float64Array(np);
    let integral = 0;
    const limit = (value) => Math.min(Math.max(value, low), high);
    for (let k = 0; k < count; k++) {
      t[k] = k * h;
      y[k] = dot(out, x) + dy * v[k + before - steps[0].ago];
      const error = setpoint - y[k] - (asked.noise ? asked.noise[k] : 0);
      // Differences use the present error. Filters for a held input use the previous error.
      if (backward) for (let j = 0; j < z.length; j++) z[j] += newest * ((j ? z[j - 1] : error) - z[j]);
      let signal = block.row[0] * error;
      for (let j = 0; j < z.length; j++) signal += block.row[j + 1] * z[j];
      const growth = rule.error * error + rule.signal * signal;
      const wanted = signal + integral + (backward ? growth : 0), excess = limit(wanted) - wanted;
      const rests = way === "clamping" && excess * growth < 0, room = wanted + excess - signal - integral;
      // With differences the integral grows only up to the limit, since one increment may exceed the whole range.
      const up = rests && backward && room * growth > 0;
      u[k] = limit(rests && !up ? signal + integral : wanted);
      if (up) integral += room; else if (!rests) integral += growth + rule.tracking * excess;
      v[k + before] = u[k] + load;
      if (!backward) advance(inside, z, error, next);
      if (fine) {
        fine.t[k * between] = k * h;
        fine.y[k * between] = y[k];
        if (k + 1 < count) parts(between).forEach((pieces, j) => {
          copy.set(x);
          for (const { matrix, ago } of pieces) advance(matrix, copy, v[k + before - ago], next);
          fine.t[k * between + j + 1] = (k + (j + 1) / between) * h;
          fine.y[k * between + j + 1] = dot(out, copy) + dy * v[k + before - pieces[pieces.length - 1].ago];
        });
      }
      for (let j = 0; j < steps.length; j++) advance(steps[j].matrix, x, v[k + before - steps[j].ago], next);
    }
    return fine ? { t, y, u, between: fine } : { t, y, u };
  }

  /* Return the output of a plant from rest for an input that is held from sample to sample. */
  function respond(process, u, h) {
    const { np, dy, out, steps } = prepared({ process, controller: { gains: [] } }).held(h), x = new Float64Array(np), next = new Float64Array(np);
    return Float64Array.from(u, (_, k) => {
      const y = dot(out, x) + dy * (u[k - steps[0].ago] ?? 0);
      for (const { matrix, ago } of steps) advance(matrix, x, u[k - ago] ?? 0, next);
      return y;
    });
  }

  /* Return the frequency response of the sampled plant with a hold, up to half the sampling frequency. */
  function sampledPlant({ process, controller = { gains: [] } }, h, w) {
    const { np, dy, out, steps } = prepared({ process, controller }).held(h);
    const rows = ({ matrix }) => Array.from({ length: np }, (_, i) => Array.from(matrix.subarray(i * (np + 1), (i + 1) * (np + 1))));
    const [first, second] = steps.map(rows), last = second ?? first;
    // Compute A and b over a whole sample, in which the second of two pieces continues the first.
    const whole = second ? product(last.map((one) => one.slice(0, np)), first) : first, re = new Float64Array(w.length), im = new Float64Array(w.length);
    w.forEach((x, k) => {
      const cos = Math.cos(x * h), sin = Math.sin(x * h), turned = (ago) => [Math.cos(x * h * ago), -Math.sin(x * h * ago)];
      const early = turned(steps[0].ago), late = second ? turned(steps[1].ago) : [0, 0];
      const input = (part) => whole.map((one, i) => (one[np] ?? 0) * early[part] + last[i][np] * late[part]);
      // Solve (z - A) state = b. The real parts come first, then the imaginary parts.
      const unit = (i, j, value) => (i === j ? value : 0), less = (one, i) => Array.from({ length: np }, (_, j) => unit(i, j, cos) - one[j]);
      const skew = (i, value) => Array.from({ length: np }, (_, j) => unit(i, j, value));
      const state = solve([...whole.map((one, i) => [...less(one, i), ...skew(i, -sin)]), ...whole.map((one, i) => [...skew(i, sin), ...less(one, i)])], [...input(0), ...input(1)]);
      [re[k], im[k]] = [0, 1].map((part) => out.reduce((sum, c, i) => sum + c * state[part * np + i], dy * early[part]));
    });
    return { re, im };
  }

  /* As frequencyResponse, for a sampled controller with backward differences. By default the frequencies go up to
     half the sampling frequency. */
  function sampledResponse(asked) {
    const loop = readLoop(asked), h = asked.sampleTime, { row } = controllerBlock(loop), newest = h / (loop.time + h);
    const grid = asked.w ?? [...frequencyResponse(asked).w.filter((x) => x < Math.PI / h), Math.PI / h], plant = sampledPlant(asked, h, grid);
    const found = Array.from(grid, (x, k) => {
      const back = [Math.cos(x * h), -Math.sin(x * h)], lag = over([newest, 0], [1 - (1 - newest) * back[0], -(1 - newest) * back[1]]);
      let control = over([loop.ki * h, 0], [1 - back[0], -back[1]]), power = [1, 0];
      for (const gain of row) { control = [control[0] + gain * power[0], control[1] + gain * power[1]]; power = times(power, lag); }
      return { control, open: times([plant.re[k], plant.im[k]], control) };
    });
    const column = (f) => Float64Array.from(found, f);
    return {
      w: Float64Array.from(grid), re: column(({ open }) => open[0]), im: column(({ open }) => open[1]), size: column(({ open }) => modulus(open)),
      control: column(({ control }) => modulus(control)), lead: column(({ control }) => (angle(control) * 180) / Math.PI),
    };
  }

  /* Simulate a limited continuous controller by fast sampling. */
  function limited(asked, loop, times) {
    const end = asked.end, finest = loop.order ? loop.time / 4 : Infinity;
    const share = Math.ceil(Math.max(end / finest, 4000) / (times.length - 1));
    const steps = share * (times.length - 1), sampleTime = end / steps;
    if (steps >= MOST_SAMPLES) fail(`between limits a filter of ${loop.time} takes ${steps} steps to ${end}; take a longer one`);
    const run = simulateSampled({ antiWindup: "clamping", ...asked, sampleTime });
    const places = kicks(loop), close = [];
    for (let k = 0; k < run.t.length; k++) {
      const time = run.t[k];
      if (k % share === 0 || places.some(([from, to]) => from <= time && time <= to)) close.push(k);
    }
    const pick = (signal) => times.map((_, k) => signal[k * share]), fine = (signal) => new Float64Array(close.length).map((_, k) => signal[close[k]]);
    return { t: times, y: pick(run.y), u: pick(run.u), fine: { t: fine(run.t), u: fine(run.u) } };
  }

  globalThis.pidalabEngine = { margins, simulate, simulateSampled, frequencyResponse, sampledPlant, sampledResponse, roots, remembering, respond, solve, inverted, zero, summit, dot };
});
globalThis.pidalabScripts.at(-1)();
