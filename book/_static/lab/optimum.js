/* Search the controller with the least IAE after a load step, for any plant, order, Ms and relative noise gain.

   find(process, kind, {ms, noise}) -> {design, iae, ms, noise, ends, agree}. `ends` are the IAE of all descents, the least
   first, at which `agree` of them ended. The unknowns are the logarithms of the gains and of the
   filter time, in units of the plant. A fast Fourier transform computes the error from its Laplace transform right of the axis,
   with exact dead time. Another transform computes its slope. The peaks of |S| and the noise gain of the sampled loop are
   limited. Sequential quadratic programming minimises from several starts. A last step makes the limits hold exactly. The
   filter time is at least a sample of the noise. */
(globalThis.pidalabScripts ??= []).push(function () {
  "use strict";
  const { margins, simulate, sampledPlant, roots, remembering, inverted, dot } = globalThis.pidalabEngine;
  const { ORDER, controller, gainOf, noiseScale, relativeNoiseGain, uniform, iae: areaOf, PLANTS } = globalThis.pidalabModel;

  const SAMPLES = 2048, DAMPING = 3, HORIZON = 80; // samples, damping and horizon of a response, in units of the plant
  const LOW = -16, HIGH = 14, SLOWEST = 3; // bounds of the logarithms of gains and of the filter time
  const PRICE = 10, LONGEST = 1; // penalty of a violated limit in logarithms, and longest step

  const circleOf = remembering(2, (count) => [Math.cos, (x) => -Math.sin(x)].map((f) => Float64Array.from({ length: count / 2 }, (_, k) => f((2 * Math.PI * k) / count))));

  /* Compute a fast Fourier transform in place, radix 2. */
  function transform(re, im) {
    const count = re.length, [cos, sin] = circleOf(count);
    const swap = (x, i, j) => { const kept = x[i]; x[i] = x[j]; x[j] = kept; };
    for (let i = 1, j = 0; i < count; i++) { // bit-reversed order
      let bit = count >> 1;
      for (; j & bit; bit >>= 1) j ^= bit;
      j ^= bit;
      if (i < j) { swap(re, i, j); swap(im, i, j); }
    }
    for (let size = 2; size <= count; size *= 2) {
      const half = size / 2;
      for (let k = 0; k < half; k++) {
        const c = cos[(k * count) / size], d = sin[(k * count) / size];
        for (let i = k; i < count; i += size) {
          const j = i + half, a = re[j] * c - im[j] * d, b = re[j] * d + im[j] * c;
          re[j] = re[i] - a;
          im[j] = im[i] - b;
          re[i] += a;
          im[i] += b;
        }
      }
    }
  }

  /* Return points of the complex plane with the values of the plant, and functions for |C|, |S| and their slopes. */
  function places(process, re, im) {
    const count = re.length, pr = new Float64Array(count), pi = new Float64Array(count);
    const at = (values, x, y) => values.reduce(([a, b], c) => [a * x - b * y + c, b * x + a * y], [0, 0]);
    for (let k = 0; k < count; k++) {
      const [a, b] = at(process.num, re[k], im[k]), [c, d] = at(process.den, re[k], im[k]), size = c * c + d * d;
      const fading = Math.exp(-re[k] * process.delay), cos = fading * Math.cos(im[k] * process.delay), sin = -fading * Math.sin(im[k] * process.delay);
      const x = (a * c + b * d) / size, y = (b * c - a * d) / size;
      pr[k] = x * cos - y * sin;
      pi[k] = x * sin + y * cos;
    }
    return { count, re, im, pr, pi, cr: new Float64Array(count), ci: new Float64Array(count), sr: new Float64Array(count), si: new Float64Array(count) };
  }

  /* Compute C and S at all points, for gains [ki, kp, kd, ka] and a filter. */
  function close(here, [ki, kp, kd = 0, ka = 0], time, order) {
    const { count, re, im, pr, pi, cr, ci, sr, si } = here;
    for (let k = 0; k < count; k++) {
      const x = re[k], y = im[k], fx = 1 + time * x, fy = time * y;
      let a = x, b = y, t; // s (1 + T s)^order
      for (let n = 0; n < order; n++) { t = a * fx - b * fy; b = a * fy + b * fx; a = t; }
      let c = ka * x + kd, d = ka * y;
      t = c * x - d * y + kp; d = c * y + d * x; c = t;
      t = c * x - d * y + ki; d = c * y + d * x; c = t;
      const size = a * a + b * b, u = (c * a + d * b) / size, v = (d * a - c * b) / size;
      const lr = 1 + pr[k] * u - pi[k] * v, li = pr[k] * v + pi[k] * u, far = lr * lr + li * li;
      cr[k] = u;
      ci[k] = v;
      sr[k] = lr / far;
      si[k] = -li / far;
    }
  }

    /* Return the sum of re and im times the slopes of C by all unknowns, which are logarithms. */
  function slopes({ re, im, cr, ci }, gains, time, order, k, wr, wi, sum) {
    const x = re[k], y = im[k], fx = 1 + time * x, fy = time * y, size = fx * fx + fy * fy, tr = fx / size, ti = -fy / size;
    let a = 1, b = 0, t; // the filter over s
    for (let n = 0; n < order; n++) { t = a * tr - b * ti; b = a * ti + b * tr; a = t; }
    const far = x * x + y * y;
    t = (a * x + b * y) / far; b = (b * x - a * y) / far; a = t;
    for (let j = 0; j < gains.length; j++) {
      sum[j] += gains[j] * (wr * a - wi * b);
      t = a * x - b * y; b = a * y + b * x; a = t;
    }
    const lag = tr - 1;
    sum[gains.length] += order * (wr * (lag * cr[k] - ti * ci[k]) - wi * (lag * ci[k] + ti * cr[k]));
  }

  /* Return a unit of time in which the numbers of a loop are near 1, from the frequency at which the phase of the plant is
     -135 degrees, or from the frequency up to which the noise limit permits control. */
  function unitOf(process, loud) {
    const poles = roots(process.den), speeds = [...poles, ...roots(process.num)].map(([a, b]) => Math.hypot(a, b)).filter(Boolean);
    if (process.delay) speeds.push(1 / process.delay);
    if (!speeds.length) return Math.pow(gainOf(process) * 0.1 * loud, -1 / poles.length);
    const low = Math.min(...speeds), high = Math.max(...speeds), growing = Math.max(0, ...poles.map(([a]) => a));
    if (growing > 0) return 1 / Math.sqrt(growing * high);
    const w = Array.from({ length: 1500 }, (_, k) => 1e-3 * low * Math.pow((1e6 * high) / low, k / 1499));
    const { pr, pi } = places(process, w.map(() => 0), w), rest = -0.5 * Math.PI * poles.filter(([a, b]) => !a && !b).length;
    let phase = rest, fastest = high, loudest = 0, last = Math.atan2(pi[0], pr[0]);
    for (let k = 1; k < w.length; k++) {
      const next = Math.atan2(pi[k], pr[k]), turn = next - last;
      phase += turn - 2 * Math.PI * Math.round(turn / (2 * Math.PI));
      last = next;
      if (phase < Math.min(-0.75 * Math.PI, rest - 0.25 * Math.PI)) { fastest = w[k]; break; }
    }
    for (let k = 0; k < w.length; k++) if (1 / Math.hypot(pr[k], pi[k]) <= loud) loudest = w[k];
    return 1 / (loudest && fastest > 8 * loudest ? loudest : fastest);
  }

  const span = (from, to, count) => Array.from({ length: count }, (_, k) => from * Math.pow(to / from, k / (count - 1)));

  const PLAIN = 250, DECADES = 400; // number of points of the circle, evenly spaced and per decade

  /* Return the log variance of u for white noise that is held for h, and its slope, as pidalab's SampledNoise does. The controller
     after a hold is a sum of chains of lags X_i. With a = e^-r and r = h/T, their sampled responses satisfy
     (z - a) X_i = P(i, r) + a sum_{j<i} r^(i-j)/(i-j)! X_j, where P is the incomplete gamma function. A derivative is
     T s = (1 + T s) - 1. By Parseval's theorem the variance is the mean of |C S|^2 over the circle. */
  function sampledNoise(process, order, h) {
    const n = order + 1, top = Math.PI / h, turns = process.delay ? Array.from({ length: 200 }, (_, k) => (0.3 * (k + 1)) / process.delay).filter((w) => w < top) : [];
    const w = Float64Array.from([...span(1e-5 * top, top, DECADES), ...Array.from({ length: PLAIN }, (_, k) => (top * (k + 1)) / (PLAIN + 1)), ...turns]).sort(), count = w.length;
    const cos = w.map((x) => Math.cos(x * h)), sin = w.map((x) => Math.sin(x * h)), plant = sampledPlant({ process }, h, w);
    const weight = w.map((_, k) => (0.5 * ((w[k + 1] ?? w[k]) - (k ? w[k - 1] : -w[0])) * h) / Math.PI);
    const column = () => Array.from({ length: n + 2 }, () => [new Float64Array(count), new Float64Array(count)]), lags = column();
    const choose = (m, k) => (k ? (choose(m - 1, k - 1) * m) / k : 1);
    // Coefficients of the lags in each filtered action, T^k s^k/(1 + T s)^n, and in its slope by log T.
    const actions = Array.from({ length: n + 1 }, () => new Float64Array(n + 2)), byTime = Array.from({ length: n + 1 }, () => new Float64Array(n + 2));
    for (let i = 1; i <= n; i++) actions[0][i] = -1; // filtered 1/s minus 1/s
    byTime[0][n + 1] = -n;
    for (let k = 0; k < n; k++) {
      for (let j = 0; j <= k; j++) actions[k + 1][n - k + j] = choose(k, j) * (-1) ** j;
      for (let j = 0; j <= k + 1; j++) byTime[k + 1][n - k + j] = -n * choose(k + 1, j) * (-1) ** j;
    }
    const gamma = (i, r) => { // P(i, r), without cancellation
      let term = Math.exp(-r), sum = 0;
      for (let k = 1; k < i + 25; k++) { term *= r / k; if (k >= i) sum += term; }
      return sum;
    };
    return (gains, time) => {
      const r = h / time, a = Math.exp(-r), powers = gains.map((_, k) => Math.pow(time, 1 - k));
      lags[0][0].fill(1);
      for (let i = 1; i <= n + 1; i++) {
        const own = gamma(i, r), [re, im] = lags[i], from = Array.from({ length: i }, (_, j) => { let x = a; for (let k = 1; k <= i - j; k++) x *= r / k; return x; });
        for (let k = 0; k < count; k++) {
          let x = own, y = 0;
          for (let j = 1; j < i; j++) { x += from[j] * lags[j][0][k]; y += from[j] * lags[j][1][k]; }
          const c = cos[k] - a, d = sin[k], size = c * c + d * d;
          re[k] = (x * c + y * d) / size;
          im[k] = (y * c - x * d) / size;
        }
      }
      const sumOf = (rows, j) => gains.reduce((sum, gain, k) => sum + gain * powers[k] * rows[k][j], 0);
      const whole = Array.from({ length: n + 2 }, (_, j) => sumOf(actions, j)), slow = Array.from({ length: n + 2 }, (_, j) => sumOf(byTime, j));
      const slope = new Float64Array(gains.length + 1);
      let variance = 0;
      for (let k = 0; k < count; k++) {
        const c = cos[k] - 1, d = sin[k], far = c * c + d * d, ix = (h * c) / far, iy = (-h * d) / far; // the integrator
        let x = gains[0] * ix, y = gains[0] * iy;
        for (let j = 0; j < n + 2; j++) { x += whole[j] * lags[j][0][k]; y += whole[j] * lags[j][1][k]; }
        const lr = 1 + plant.re[k] * x - plant.im[k] * y, li = plant.re[k] * y + plant.im[k] * x, size = lr * lr + li * li;
        const sr = lr / size, si = -li / size, ur = x * sr - y * si, ui = x * si + y * sr;
        variance += weight[k] * (ur * ur + ui * ui);
        // 2 Re(conj(u) S^2 dC)
        const tr = sr * sr - si * si, ti = 2 * sr * si, vr = 2 * weight[k] * (ur * tr + ui * ti), vi = 2 * weight[k] * (ur * ti - ui * tr);
        for (let i = 0; i < gains.length; i++) {
          let p = i ? 0 : ix, q = i ? 0 : iy;
          for (let j = 0; j < n + 2; j++) if (actions[i][j]) { p += powers[i] * actions[i][j] * lags[j][0][k]; q += powers[i] * actions[i][j] * lags[j][1][k]; }
          slope[i] += gains[i] * (vr * p - vi * q);
        }
        let p = 0, q = 0;
        for (let j = 0; j < n + 2; j++) { p += slow[j] * lags[j][0][k]; q += slow[j] * lags[j][1][k]; }
        slope[gains.length] += vr * p - vi * q;
      }
      return { value: 0.5 * Math.log(variance), slope: slope.map((each) => each / (2 * variance)) };
    };
  }

  /* Return functions for IAE and limits, for one plant and order. */
  function problem(process, order, unit) {
    const n = order + 1, size = order + 3, scale = 1 / placesOf([1 / unit]), units = Array.from({ length: order + 2 }, (_, k) => scale * Math.pow(unit, k - 1));
    function placesOf(w) { const { pr, pi } = places(process, w.map(() => 0), w); return Math.hypot(pr[0], pi[0]); }
    const horizon = HORIZON * unit, sigma = DAMPING / horizon, half = SAMPLES / 2 + 1;
    const line = places(process, new Float64Array(half).fill(sigma), Float64Array.from({ length: half }, (_, k) => (2 * Math.PI * k) / horizon));
    const growth = Float64Array.from({ length: SAMPLES }, (_, k) => (Math.exp((DAMPING * k) / SAMPLES) * SAMPLES) / horizon), step = horizon / SAMPLES;
    const turns = process.delay ? Array.from({ length: 300 }, (_, k) => (0.3 * (k + 1)) / process.delay).filter((w) => w < 1e3 / unit) : [];
    const slowest = Math.min(1, ...roots(process.den).map(([a, b]) => Math.hypot(a, b) * unit).filter(Boolean));
    const grid = Float64Array.from([...span(Math.min(1e-3, 0.01 * slowest) / unit, 0.03 / unit, 40), ...span(0.031 / unit, 12 / unit, 260), ...span(12.5 / unit, 1e3 / unit, 130), ...turns]).sort();
    const axis = places(process, new Float64Array(grid.length), grid);
    const noiseTime = noiseScale(process).sampleTime, noiseOf = sampledNoise(process, order, noiseTime), fastest = Math.log(noiseTime / unit);
    // Divide s den by a polynomial with stable poles of the same speeds. Multiplied by 1 + L, its turns along the axis show if
    // the loop is stable. Because the speeds are the same, a pole beyond the highest frequency turns neither.
    const speeds = roots(process.den).map(([a, b]) => Math.hypot(a, b) || 1 / unit);
    const own = Array.from(grid, (w) => {
      let a = 0, b = 0, t;
      for (const c of process.den) { t = a * 0 - b * w + c; b = a * w; a = t; }
      return Math.atan2(b, a) + Math.PI / 2 - [1 / unit, ...speeds].reduce((sum, speed) => sum + Math.atan(w / speed), 0);
    });
    const read = (x) => ({ gains: units.map((one, k) => one * Math.exp(x[k])), time: unit * Math.exp(x[order + 2]) });
    const peaks = (sizes) => {
      const found = [];
      for (let k = 0; k < sizes.length; k++) if (!(sizes[k] < sizes[k - 1]) && !(sizes[k] <= sizes[k + 1])) found.push(k);
      return found;
    };
    /* Return the vertex of the parabola through a peak and its neighbours. */
    const topOf = (sizes, k) => {
      if (!k || k === sizes.length - 1) return sizes[k];
      const a = grid[k - 1] - grid[k], b = grid[k + 1] - grid[k], u = (sizes[k - 1] - sizes[k]) / a, v = (sizes[k + 1] - sizes[k]) / b;
      const bend = (v - u) / (b - a), slope = u - bend * a;
      return bend < 0 ? sizes[k] - (slope * slope) / (4 * bend) : sizes[k];
    };
    const sensitivity = new Float64Array(grid.length);

    /* Return the peaks near their limits, and true if the loop is stable. */
    function limits(x, ms, loud, near = 0.3) {
      const { gains, time } = read(x), { sr, si } = axis;
      close(axis, gains, time, n);
      let turned = 0, last = 0;
      for (let k = 0; k < grid.length; k++) {
        const angle = own[k] - Math.atan2(si[k], sr[k]), turn = angle - last;
        turned += turn - 2 * Math.PI * Math.round(turn / (2 * Math.PI));
        last = angle;
        sensitivity[k] = Math.log(sr[k] * sr[k] + si[k] * si[k]) / 2 - Math.log(ms);
      }
      const slopeOf = (k) => { // the slope of log |S| is -Re(P S dC)
        const pr = axis.pr[k] * sr[k] - axis.pi[k] * si[k], pi = axis.pr[k] * si[k] + axis.pi[k] * sr[k], sum = new Float64Array(size);
        slopes(axis, gains, time, n, k, -pr, -pi, sum);
        return sum;
      };
      const noise = noiseOf(gains, time), excess = noise.value - Math.log(loud), near_ = [];
      let most = -Infinity;
      for (const k of peaks(sensitivity)) {
        const value = topOf(sensitivity, k);
        most = Math.max(most, value);
        if (value > -near) near_.push({ which: 0, k, value, slope: () => slopeOf(k) });
      }
      if (excess > -near) near_.push({ which: 1, k: 0, value: excess, slope: () => noise.slope });
      return { stable: Math.abs(turned) < 0.5 * Math.PI, near: near_, missed: Math.max(0, most) + Math.max(0, excess) };
    }

    const re = new Float64Array(SAMPLES), im = new Float64Array(SAMPLES), er = new Float64Array(half), ei = new Float64Array(half);
    /* Return the log IAE and its slope. After the horizon, the integral of the error is used. */
    function worth(x) {
      const { gains, time } = read(x), { pr, pi, sr, si } = line;
      close(line, gains, time, n);
      re.fill(0);
      im.fill(0);
      for (let k = 0; k < half; k++) {
        const a = pr[k] * sr[k] - pi[k] * si[k], b = pr[k] * si[k] + pi[k] * sr[k], x0 = line.re[k], y0 = line.im[k], far = x0 * x0 + y0 * y0;
        er[k] = (a * x0 + b * y0) / far;
        ei[k] = (b * x0 - a * y0) / far;
        const share = k && k < half - 1 ? 2 / SAMPLES : 1 / SAMPLES;
        re[k] = share * er[k];
        im[k] = -share * ei[k];
      }
      transform(re, im); // the transform of the conjugate, whose real part is the error
      let area = 0, sum = 0;
      for (let k = 0; k < SAMPLES; k++) {
        const share = (k ? 1 : 0.5) * step, error = re[k] * growth[k];
        area += share * Math.abs(error);
        sum += share * error;
        re[k] = error;
      }
      const rest = 1 / gains[0] - sum, value = area + Math.abs(rest);
      return { value: Math.log(value), slope: () => slopeOfLast(gains, time, value, Math.sign(rest)) };
    }

    /* Return the slope of the last response. */
    function slopeOfLast(gains, time, value, sign) {
      const slope = new Float64Array(size);
      for (let k = 0; k < SAMPLES; k++) { re[k] = (Math.sign(re[k]) - sign) * (k ? 1 : 0.5) * step * growth[k]; im[k] = 0; }
      transform(re, im);
      for (let k = 0; k < half; k++) {
        // conj(weight) times -P S e, P S = s e
        const share = k && k < half - 1 ? 2 / SAMPLES : 1 / SAMPLES, a = er[k] * er[k] - ei[k] * ei[k], b = 2 * er[k] * ei[k];
        const u = -(a * line.re[k] - b * line.im[k]), v = -(a * line.im[k] + b * line.re[k]), p = share * re[k], q = -share * im[k];
        slopes(line, gains, time, n, k, u * p - v * q, u * q + v * p, slope);
      }
      slope[0] -= sign / gains[0];
      return slope.map((each) => each / value);
    }
    return { size, units, unit, order, fastest, read, limits, worth };
  }

  /* Return the step d that minimises g d + d B d / 2 subject to c + a d <= 0, with a penalty for violations. The method is ascent
     in one multiplier after the other. No unknown moves by more than `reach`, or out of its range. */
  function stepOf(B, g, rows, lows, highs) {
    const n = g.length, inverse = inverted(B);
    const times = (a) => inverse.map((row) => dot(row, a));
    const all = [...rows.map(({ value, slope }) => ({ c: value, a: slope, most: PRICE })), ...Array.from({ length: 2 * n }, (_, k) => {
      const a = new Float64Array(n);
      a[k >> 1] = k % 2 ? -1 : 1;
      return { c: k % 2 ? lows[k >> 1] : -highs[k >> 1], a, most: Infinity };
    })].map((row) => ({ ...row, ha: times(row.a), l: 0 }));
    const d = times(g).map((x) => -x);
    for (let sweep = 0; sweep < 400; sweep++) {
      let moved = 0;
      for (const row of all) {
        const before = row.l;
        row.l = Math.min(Math.max(before + (row.c + dot(row.a, d)) / dot(row.a, row.ha), 0), row.most);
        const by = row.l - before;
        if (by) for (let j = 0; j < n; j++) d[j] -= by * row.ha[j];
        moved = Math.max(moved, Math.abs(by));
      }
      if (moved < 1e-9) break;
    }
    const pull = rows.map((_, k) => all[k].l);
    return { d, pull };
  }

  /* Run sequential quadratic programming from a start until the steps are small. */
  function descend(one, start, ms, loud, most = 60) {
    const { size } = one, low = Array(size).fill(LOW), high = Array(size).fill(HIGH);
    low[size - 1] = one.fastest;
    high[size - 1] = SLOWEST;
    let x = start.map((value, k) => Math.min(Math.max(value, low[k]), high[k])), limit = one.limits(x, ms, loud);
    if (!limit.stable) return null;
    const costs = (x) => { const { value, slope } = one.worth(x); return { value, slope: slope() }; };
    let B = x.map((_, i) => x.map((_, j) => (i === j ? 1 : 0))), at = costs(x), reach = LONGEST, calm = 0;
    const merit = (value, missed) => value + PRICE * missed;
    for (let turn = 0; turn < most; turn++) {
      const rows = limit.near.map(({ value, slope }) => ({ value, slope: slope() }));
      const { d, pull } = stepOf(B, at.slope, rows, x.map((v, k) => Math.max(low[k] - v, -reach)), x.map((v, k) => Math.min(high[k] - v, reach)));
      const before = merit(at.value, limit.missed);
      let share = 1, next, ahead, then = null;
      for (let halving = 0; halving < 9; halving++, share /= 2.5) {
        next = x.map((v, k) => v + share * d[k]);
        ahead = one.limits(next, ms, loud);
        if (!ahead.stable) continue;
        const cost = one.worth(next);
        if (merit(cost.value, ahead.missed) < before) { then = { value: cost.value, slope: cost.slope() }; break; }
      }
      if (!then) { if (calm++) break; reach /= 10; B = x.map((_, i) => x.map((_, j) => (i === j ? 1 : 0))); continue; }
      const gain = before - merit(then.value, ahead.missed);
      // Update the curvature of the Lagrangian, with damping.
      const s = next.map((v, k) => v - x[k]), slopesThen = limit.near.length ? closest(limit.near, ahead.near) : [];
      const y = s.map((_, k) => then.slope[k] - at.slope[k]);
      slopesThen.forEach((other, i) => { if (other && pull[i]) { const ours = rows[i].slope, theirs = other.slope(); for (let k = 0; k < size; k++) y[k] += pull[i] * (theirs[k] - ours[k]); } });
      const Bs = B.map((row) => dot(row, s)), sBs = dot(s, Bs), sy = dot(s, y), theta = sy < 0.2 * sBs ? (0.8 * sBs) / (sBs - sy) : 1;
      const r = y.map((v, k) => theta * v + (1 - theta) * Bs[k]), sr = dot(s, r);
      if (sr > 1e-14) B = B.map((row, i) => row.map((v, j) => v + (r[i] * r[j]) / sr - (Bs[i] * Bs[j]) / sBs));
      reach = share === 1 ? Math.min(LONGEST, 2 * reach) : Math.max(share * reach, 1e-3);
      [x, at, limit] = [next, then, ahead];
      calm = gain < 1e-6 ? calm + 1 : 0;
      if (calm > 2) break;
    }
    return { x, value: at.value, missed: limit.missed };
  }

  /* For each limit that was near, return the limit that is nearest to it along the axis after a step. */
  const closest = (before, after) => before.map(({ which, k }) => {
    let found = null;
    for (const other of after) if (other.which === which && !(Math.abs(other.k - k) >= Math.abs((found?.k ?? Infinity) - k))) found = other;
    return found && Math.abs(found.k - k) < 15 ? found : null;
  });

  /* Return controllers to start from. These are PI and PID with filters of several speeds; controllers with all zeros at one
     place below a chosen crossover, for plants that need derivative action; and the stored optima of other plants. */
  function candidates(one, process) {
    const found = [], { order, unit } = one, least = Math.exp(-12);
    const add = (actions, time) => found.push([...one.units.map((_, k) => Math.log(Math.max(actions[k] ?? 0, least))), Math.min(Math.max(time, one.fastest), SLOWEST)]);
    for (const gain of [2, 1.2, 0.6, 0.3, 0.1, 0.03, 0.01, 0.003]) for (const share of [0.5, 0.1, 0.02, 0.004])
      for (const derivative of order ? [0, 1, 5] : [0]) for (const time of [-4, -2, 0]) add([gain * share, gain, gain * derivative], time);
    for (const w of span(0.02, 5, 9)) for (const below of [3, 8, 25]) for (let zeros = 1; zeros <= order + 1; zeros++) {
      const zero = w / below, action = [[zero, 1], [zero * zero, 2 * zero, 1], [zero ** 3, 3 * zero * zero, 3 * zero, 1]][zeros - 1];
      const { pr, pi } = places(process, [0], [w / unit]), size = Math.hypot(pr[0], pi[0]) * Math.pow(Math.hypot(w, zero), zeros) * one.units[0] * unit / w;
      for (const above of [5, 30, 200]) add(action.map((x) => x / size), -Math.log(w * above));
    }
    const { noise, designs } = globalThis.pidalabOptima ?? { designs: {} };
    for (const [key, stored] of Object.entries(designs)) {
      const [kp, ti, ...rest] = stored[order], time = rest.pop(), [td = 0, ta = 0] = rest, other = PLANTS[key];
      const theirs = unitOf(other, noise * noiseScale(other).gain), { pr, pi } = places(other, [0], [1 / theirs]);
      const gains = [kp / ti, kp, kp * td, kp * ta].slice(0, order + 2);
      add(gains.map((gain, k) => gain * Math.hypot(pr[0], pi[0]) * Math.pow(theirs, 1 - k)), Math.log(time / theirs));
    }
    return found;
  }

  const KINDS = Object.keys(ORDER), STARTS = 6, APART = 0.8, SAME = 0.005;

  /* Return the best different candidates that are stable, near the limits and fast. */
  function startsOf(one, process, ms, loud) {
    const ranked = candidates(one, process).map((x) => ({ x, ...one.limits(x, ms, loud, 0) })).filter(({ stable }) => stable)
      .map(({ x, missed }) => ({ x, cost: 3 * missed - x[0] })).sort((a, b) => a.cost - b.cost).slice(0, 60)
      .map(({ x, cost }) => ({ x, cost: one.worth(x).value + (cost + x[0]) })).sort((a, b) => a.cost - b.cost);
    const chosen = [];
    for (const { x } of ranked) if (chosen.length < STARTS && chosen.every((other) => other.some((v, k) => Math.abs(v - x[k]) > APART))) chosen.push(x);
    return chosen;
  }

  /* Return the descents from all starts, for a plant with positive gain, the best first. */
  function searched(process, order, unit, ms, loud, below) {
    const one = problem(process, order, unit), ends = [];
    const go = (start) => {
      const end = descend(one, start, ms, loud, 40);
      if (end && end.missed < 1e-3) ends.push(end);
      return end;
    };
    for (const start of startsOf(one, process, ms, loud)) go(start);
    const lower = below?.best; // start with hardly any highest derivative, and with some
    if (lower) for (const share of [-6, -1.5]) go([...lower.x.slice(0, -1), lower.x[order] + share, lower.x[order + 1]]);
    ends.sort((a, b) => a.value - b.value);
    // Try neighbouring local optima, which have another filter time or, for a PIDA, more or less acceleration at equal noise.
    const valleys = [[-1.5, 0, 0], [1.5, -0.3, -0.3], ...(order > 1 ? [-0.9, 0.9, 1.7].map((f) => [f, 2 * f, 0.1 * f]) : [])];
    if (ends.length) for (const [filter, highest, others] of valleys) {
      const { x } = ends[0];
      go(x.map((v, k) => (k > order + 1 ? Math.min(Math.max(v + filter, one.fastest), SLOWEST) : v + (k > order ? highest : others))));
    }
    const further = () => {
      ends.sort((a, b) => a.value - b.value);
      for (const k of [0, 1, 2]) for (let again = 0; ends[k] && again < 5; again++) { // repeat with a new curvature
        const end = descend(one, ends[k].x, ms, loud);
        if (!end || end.missed > 1e-3 || !(end.value < ends[k].value - 1e-4)) break;
        ends[k] = end;
      }
      ends.sort((a, b) => a.value - b.value);
    };
    further();
    // While only one start has found the best end, try more starts near it.
    const lone = () => ends.length && !(ends[1]?.value < ends[0].value + Math.log(1 + SAME));
    for (let round = 0; round < 3 && lone(); round++) {
      const { x } = ends[0], shaken = uniform(1, 3 * (round + 1) * x.length);
      for (let k = 3 * round; k < 3 * round + 3; k++) go(x.map((v, j) => v + shaken[k * x.length + j]));
      further();
    }
    return { one, ends, best: ends[0] };
  }

  /* Make the limits hold between grid points, too. Each pass tightens the limits slightly. The last resort is to reduce the
     integral gain or all gains. */
  function finished(process, one, start, ms, noise) {
    const { gain } = noiseScale(process);
    const designOf = (x) => {
      const { gains: [ki, kp, kd = 0, ka = 0], time } = one.read(x);
      return { kind: KINDS[one.order], kp, ti: kp / ki, td: kd / kp, ta: ka / kp, filterTime: time, filterOrder: one.order + 1 };
    };
    const judged = (x) => { const design = designOf(x), found = margins({ process, controller: controller(design) }); const loud = found.stable ? relativeNoiseGain(process, design) : NaN; return { x, design, ...found, noise: loud, keeps: found.ms <= ms && loud <= noise }; };
    let aimed = [ms, noise * gain], x = start.x, last;
    for (let round = 0; round < 6; round++) {
      last = judged(x);
      if (last.keeps) return last;
      // Subtract the violation from the limit, slightly more in each pass.
      if (last.stable) aimed = [[ms, last.ms], [noise, last.noise]].map(([most, is], k) => aimed[k] * Math.min(1, Math.pow(((1 - 1e-6) * most) / is, 1 + round)));
      x = descend(one, x, ...aimed)?.x ?? x;
    }
    for (let share = 1e-5; share < 3; share *= 2) for (const count of [1, x.length - 1]) {
      last = judged(x.map((v, k) => (k < count ? v - share : v)));
      if (last.keeps) return last;
    }
    return null;
  }

  /* Return the IAE after a unit load step: until the response has settled, and the remainder from the integral of the error. */
  function settled(process, design, unit) {
    const own = controller(design), end = 100 * unit, { t, y } = simulate({ process, controller: own, end, points: 4001, load: 1 });
    let sum = 0;
    for (let k = 1; k < t.length; k++) sum += 0.5 * (y[k] + y[k - 1]) * (t[k] - t[k - 1]);
    return areaOf(t, y, 0) + Math.abs(1 / own.gains[0] - sum);
  }

  function find(process, kind, { ms, noise }) {
    const { num, den, delay } = process, order = ORDER[kind], scale = noiseScale(process), loud = noise * scale.gain;
    const sign = Math.sign(num[num.length - 1]) * Math.sign(den[0]); // integral action is stable only with this sign
    if (!sign) throw new RangeError("the plant has no gain");
    if (!(ms > 1)) throw new RangeError(`Ms must be above 1, found ${ms}`);
    if (!(noise > 0)) throw new RangeError(`the noise limit must be above 0, found ${noise}`);
    if (!(loud > 0)) throw new RangeError("this plant has no time constant and no dead time, so the sample time of the noise is undefined");
    const upright = { num: num.map((c) => sign * c), den, delay };
    for (const factor of [1, 8, 64]) {
      const unit = factor * unitOf(upright, loud);
      let found;
      for (let lower = 0; lower <= order; lower++) found = searched(upright, lower, unit, ms, loud, found);
      for (const end of found.ends.slice(0, 3)) {
        const best = finished(upright, found.one, end, ms, noise);
        if (!best) continue;
        const iae = settled(upright, best.design, unit);
        if (iae > 1.02 * Math.exp(end.value) && factor < 64) break; // the response exceeded the horizon
        const ends = found.ends.map(({ value }) => Math.exp(value - found.best.value));
        return { design: { ...best.design, kp: sign * best.design.kp }, iae, ms: best.ms, noise: best.noise, ends, agree: ends.filter((x) => x < 1 + SAME).length };
      }
    }
    throw new RangeError(`no ${kind} controller was found with Ms ${ms} and a relative noise gain of ${noise}: allow a larger Ms or more noise`);
  }

  globalThis.pidalabOptimum = { find };
});
globalThis.pidalabScripts.at(-1)();
