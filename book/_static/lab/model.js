/* Model of the lab and the live figures: plants, controllers in standard form, rules, and all numbers of a design.

   A design is {kind, kp, ti, td, ta, filterTime, filterOrder}: kp (1 + 1/(ti s) + td s + ta s^2) / (1 + filterTime s)^filterOrder.
   This script needs engine.js, and optimum.js for the rule of that name. It does not depend on a page. */
(globalThis.pidalabScripts ??= []).push(function () {
  "use strict";
  const { simulate, simulateSampled, margins, frequencyResponse, sampledResponse, roots, remembering, solve, zero, summit } = globalThis.pidalabEngine;

  const multiply = (a, b) => {
    const product = Array(a.length + b.length - 1).fill(0);
    a.forEach((x, i) => b.forEach((y, j) => { product[i + j] += x * y; }));
    return product;
  };
  const lags = (order, lag = 1) => Array.from({ length: order }).reduce((den) => multiply(den, [lag, 1]), [1]);

  /* Plants of the papers. `end` is a time by which a good loop is at rest. */
  const PLANTS = {
    "lags3": { name: "1/(s+1)³, dead time 1", num: [1], den: lags(3), delay: 1, end: 40 },
    "unequal": { name: "1/((5s+1)(s+1)(0.5s+1)), dead time 0.5", num: [1], den: multiply([5, 1], multiply([1, 1], [0.5, 1])), delay: 0.5, end: 40 },
    "haalman-1": { name: "haalman2024, example 1: 1/(s+1)⁴", num: [1], den: lags(4), delay: 0, end: 30 },
    "haalman-2": { name: "haalman2024, example 2: 1/(s+1)⁸", num: [1], den: lags(8), delay: 0, end: 70 },
    "heo-1": { name: "heo2023, example 1: e^(−0.2s)/(s+1)³", num: [1], den: lags(3), delay: 0.2, end: 20 },
    "vrancic-3": { name: "vrancic2021, G_P3 as computed: e^(−0.5s)/(s+1)³", num: [1], den: lags(3), delay: 0.5, end: 30 },
    "vrancic-6": { name: "vrancic2021, G_P6: 1/((s+1)(s+3)(s+6))", num: [1], den: multiply([1, 1], multiply([1, 3], [1, 6])), delay: 0, end: 12 },
    "huba-ipdt": { name: "huba2018, huba2024: e^(−s)/s", num: [1], den: [1, 0], delay: 1, end: 30 },
    "oscillating": { name: "oscillating: damping 0.3, dead time 0.3", num: [1], den: [1, 0.6, 1], delay: 0.3, end: 30 },
    "inverse": { name: "inverse response: (1−s)/(s+1)³", num: [-1, 1], den: lags(3), delay: 0, end: 40 },
  };

  /* Return the user's plant: gain, up to three lags (or an oscillating pair and a lag), a zero, an integrator, a dead time. */
  function ownPlant({ gain, t1, t2, t3, damping, zero, integrating, delay }) {
    const pair = damping < 1 ? [t1 * t1, 2 * damping * t1, 1] : multiply([t1, 1], [t2, 1]);
    let den = multiply(pair, [t3, 1]);
    while (den.length > 1 && den[0] === 0) den = den.slice(1);
    if (integrating) den = [...den, 0];
    const num = zero && den.length > 1 ? [gain * zero, gain] : [gain];
    return { name: "own", num, den, delay, end: 8 * (t1 + t2 + t3) + 18 * delay + (integrating ? 1 : 0) || 1 };
  }

  const ORDER = { PI: 0, PID: 1, PIDA: 2 };

  /* Return a design in the form that the engine takes. */
  function controller({ kind, kp, ti, td, ta, filterTime, filterOrder }, limits) {
    const order = ORDER[kind];
    return {
      gains: [kp / ti, kp, order > 0 ? kp * td : 0, order > 1 ? kp * ta : 0],
      filterTime, filterOrder: Math.max(filterOrder, order), limits,
    };
  }

  /* Return the absolute area between the set point and y. Trapezoids are split where the error changes its sign. */
  function iae(t, y, setpoint) {
    let sum = 0;
    for (let k = 1; k < t.length; k++) {
      const a = setpoint - y[k - 1], b = setpoint - y[k], h = t[k] - t[k - 1];
      sum += a * b < 0 ? (0.5 * h * (a * a + b * b)) / (Math.abs(a) + Math.abs(b)) : 0.5 * h * Math.abs(a + b);
    }
    return sum;
  }

  function largest(values) {
    let top = 0;
    for (let k = 0; k < values.length; k++) top = Math.max(top, Math.abs(values[k]));
    return top;
  }

  // --- noise --------------------------------------------------------------------------------------------------------

  const REMEMBERED = 20, NOISE_SAMPLES = 100; // number of cached results, and samples of the noise in an ultimate period
  const integratorsOf = ({ den }) => den.length - 1 - den.findLastIndex((c) => c !== 0);

  /* Return the lowest frequency at which the phase of the plant, relative to zero frequency, falls below -180 degrees, or null
     (see pidalab.reduction.ultimate_frequency). Each factor 1 - jw/root stays in one half plane, so its angle is continuous. */
  function ultimateFrequency({ num, den, delay }) {
    const zeros = roots(num).filter(([re, im]) => re || im), all = roots(den), poles = all.filter(([re, im]) => re || im);
    const onAxis = ([re, im]) => Math.abs(re) <= 1e-9 * Math.hypot(re, im), integrators = all.length - poles.length;
    if (integrators > 1 || poles.some((pole) => pole[0] >= 0 || onAxis(pole))) return null;
    const turn = (found, w) => found.reduce((sum, [re, im]) => {
      const size = re * re + im * im; // squared modulus of the root
      return sum + Math.atan2((-w * re) / size, 1 - (w * im) / size);
    }, 0);
    const phase = (w) => turn(zeros, w) - turn(poles, w) - delay * w - (integrators * Math.PI) / 2;
    const speeds = [...zeros, ...poles].map(([re, im]) => Math.hypot(re, im)).concat(delay ? [1 / delay] : []);
    if (!speeds.length) return null;
    const sign = -Math.sign(gainOf({ num, den })); // the roots give the number of turns, and the plant gives the exact angle
    const beyond = (w) => { const { re, im } = frequencyResponse({ process: { num, den, delay }, controller: { gains: [0, 1] }, w: [w] }); return Math.atan2(sign * im[0], sign * re[0]); };
    const jump = Math.min(Infinity, ...zeros.filter(onAxis).map(([, im]) => Math.abs(im)));
    let before = 1e-4 * Math.min(...speeds);
    for (const last = Math.min(1e4 * Math.max(...speeds), jump); before < last;) {
      const w = 1.02 * before;
      if (w < jump && phase(w) < -Math.PI) return zero(beyond, before, w);
      before = w;
    }
    return null;
  }

  /* Return the sample time of measurement noise and the unit of the noise gain, as pidalab.noise_scale does: a hundredth of the
     ultimate period, and the ultimate gain. Without an ultimate period, use the sum of time constants and dead time, and
     1/|static gain|. Return NaN if a plant has neither a time constant nor a dead time. */
  const noiseScale = remembering(REMEMBERED, ({ num, den, delay }) => {
    const process = { num, den, delay }, w = ultimateFrequency(process);
    if (w) {
      const { re, im } = frequencyResponse({ process, controller: { gains: [0, 1] }, w: [w] });
      return { sampleTime: (2 * Math.PI) / w / NOISE_SAMPLES, gain: 1 / Math.hypot(re[0], im[0]) };
    }
    const time = roots(den).reduce((sum, [re, im]) => sum + (re || im ? 1 / Math.hypot(re, im) : 0), delay);
    return time ? { sampleTime: time / NOISE_SAMPLES, gain: 1 / (Math.abs(gainOf(process)) * Math.pow(time, integratorsOf(process))) } : { sampleTime: NaN, gain: NaN };
  });

  const FIRST_TAIL = 2048, LONGEST_TAIL = 1 << 20, FADED = 1e-7; // samples of an impulse response, and the allowed share of its squares in the second half

  /* Return the standard deviation of u for held white measurement noise of standard deviation 1. It is the root of the sum of
     squares of the response to one sample. Return NaN if this response does not decay. */
  function noiseGainOf(process, own, sampleTime, method) {
    for (let samples = Math.max(FIRST_TAIL, Math.ceil((4 * process.delay) / sampleTime)); samples <= LONGEST_TAIL; samples *= 2) {
      const noise = new Float64Array(samples);
      noise[0] = 1;
      const { u } = simulateSampled({ process, controller: { ...own, limits: null }, sampleTime, end: (samples - 1) * sampleTime, noise, method });
      let total = 0, late = 0;
      for (let k = 0; k < samples; k++) { total += u[k] * u[k]; if (2 * k >= samples) late += u[k] * u[k]; }
      if (late <= FADED * total) return Math.sqrt(total);
      if (!Number.isFinite(total)) break;
    }
    return NaN;
  }

  /* Return the noise gain with a sample time. If the filter is faster than a sample, or the sampled loop is unstable, the
     controller is discretised by differences. */
  function noiseGainAt(process, design, sampleTime) {
    if (!(sampleTime > 0) || atOnce(process)) return NaN;
    const own = controller(design), held = own.filterTime > 0 && own.filterTime < sampleTime ? NaN : noiseGainOf(process, own, sampleTime, "held");
    return Number.isNaN(held) ? noiseGainOf(process, own, sampleTime, "backward") : held;
  }

  /* Return the relative noise gain, as pidalab.relative_noise_gain does. */
  const relativeNoiseGain = remembering(REMEMBERED, ({ num, den, delay }, design) => {
    const process = { num, den, delay }, { sampleTime, gain } = noiseScale(process);
    return noiseGainAt(process, design, sampleTime) / gain;
  });

  /* Return true if a plant has a direct path without dead time. The noise gain is then not defined. */
  function atOnce({ num, den, delay }) {
    const degree = (values) => values.length - values.findIndex(Boolean);
    return !delay && degree(num) === degree(den);
  }

  // --- a digital controller -----------------------------------------------------------------------------------------

  const MOST_SAMPLES = 6e5, LONG = 8;

  /* Return the slowest of several time constants: dead time, filter, plant, and the closed loop without dead time and filter.
     The last determines slow poles. */
  function slowest({ num, den, delay }, { gains: [ki, kp, kd, ka], filterTime }) {
    const top = multiply(num, [ka, kd, kp, ki]), bottom = [...den, 0], size = Math.max(top.length, bottom.length);
    const at = (values, k) => values[k - size + values.length] ?? 0;
    const closed = Array.from({ length: size }, (_, k) => at(top, k) + at(bottom, k));
    const speeds = [den, closed].flatMap((values) => {
      const shorn = values.slice(values.findIndex(Boolean));
      return shorn.length > 1 ? roots(shorn).map(([re, im]) => Math.hypot(re, im)).filter((speed) => speed > 0) : [];
    });
    return Math.max(delay, filterTime, ...speeds.map((speed) => 1 / speed));
  }

  /* Return the response of the measurement to one noisy sample, including this sample. It is the impulse response of S. */
  function pulseResponse(process, own, sampleTime, end) {
    const noise = new Float64Array(Math.round(end / sampleTime) + 1);
    noise[0] = 1;
    const { y } = simulateSampled({ process, controller: { ...own, limits: null }, sampleTime, end, noise, method: "backward" });
    y[0] += 1;
    return y;
  }

  /* Return Ms and mks of a loop with a digital controller, at the samples. The loop is stable if its impulse response decays
     after its slowest time, and unstable if the response grows. If this takes long, more samples are used. Beyond 600000 samples
     the result is unknown. */
  function sampledMargins({ process, controller: own, sampleTime, end }, curve = sampledResponse({ process, controller: own, sampleTime })) {
    const none = { ms: NaN, mks: NaN, gm: NaN, pm: NaN, dm: NaN, stable: false, unknown: false };
    let span = Math.max(Math.min(3 * end, 8000 * sampleTime), LONG * slowest(process, own)), grew = false, s, third;
    for (;;) {
      if (!(span <= MOST_SAMPLES * sampleTime)) return { ...none, unknown: true };
      s = pulseResponse(process, own, sampleTime, span);
      third = Math.floor(s.length / 3);
      const [first, middle, last] = [0, 1, 2].map((k) => largest(s.slice(k * third, (k + 1) * third)));
      if (last < 0.1 * middle || last < 1e-6 * first) break;
      if (!(last < middle) && grew) return none;
      grew = !(last < middle); // a beat may cause a single rise
      span *= 2;
    }
    const gain = (which, { re, im, control }, k) => (which ? control[k] : 1) / Math.hypot(1 + re[k], im[k]), { w } = curve;
    const [ms, mks] = [0, 1].map((which) => {
      const sizes = Array.from(w, (_, k) => gain(which, curve, k));
      const at = (x) => gain(which, sampledResponse({ process, controller: own, sampleTime, w: [x] }), 0);
      const tops = sizes.map((_, k) => k).filter((k) => !(sizes[k] < sizes[k - 1]) && !(sizes[k] < sizes[k + 1]))
        .sort((a, b) => sizes[b] - sizes[a]).slice(0, 3);
      return Math.max(sizes[tops[0]], ...tops.map((k) => summit(at, w[Math.max(k - 1, 0)], w[Math.min(k + 1, w.length - 1)])));
    });
    return { ...none, ms, mks, stable: true };
  }

  /* Return the phase margin at the first gain crossover in degrees, and the largest |L| at higher frequencies, which a
     plot of the usual frequencies does not show. */
  function beyondCrossover(process, own, { w, size: sizes } = frequencyResponse({ process, controller: own })) {
    const at = (x) => { const { re, im, size } = frequencyResponse({ process, controller: own, w: [x] }); return { phase: (Math.atan2(im[0], re[0]) * 180) / Math.PI, size: size[0] }; };
    const below = sizes.findIndex((x, k) => k && x < 1 && sizes[k - 1] >= 1);
    if (below < 0) return { first: NaN, hump: NaN };
    const { phase } = at(zero((x) => Math.log(at(x).size), w[below - 1], w[below]));
    const valley = sizes.findIndex((x, k) => k >= below && x < sizes[k + 1]);
    let top = valley;
    for (let k = valley; k < w.length; k++) if (sizes[k] > sizes[top]) top = k;
    const hump = valley < 0 ? 0 : summit((x) => at(x).size, w[top - 1], w[Math.min(top + 1, w.length - 1)]);
    return { first: phase > 0 ? phase - 180 : phase + 180, hump };
  }

  /* Return margins, curves and the relative noise gain, which do not depend on steps, limits and noise. */
  const character = remembering(REMEMBERED, ({ num, den, delay }, design, sampleTime, end) => {
    const process = { num, den, delay }, own = controller(design), curve = sampleTime ? sampledResponse({ process, controller: own, sampleTime }) : frequencyResponse({ process, controller: own });
    const found = sampleTime ? sampledMargins({ process, controller: own, sampleTime, end }, curve) : margins({ process, controller: own });
    let beyond, noise;
    const noiseOf = () => (sampleTime ? noiseGainOf(process, own, sampleTime, "backward") / noiseScale(process).gain : relativeNoiseGain(process, design));
    return { ...found, noise: () => (noise ??= noiseOf()), beyond: () => (beyond ??= sampleTime ? {} : beyondCrossover(process, own, curve)), curve };
  });

  const LEAST_OVERSHOOT = 5e-5; // smaller: rounding or the end of a slow rise
  const PER_PERIOD = 20, MOST_POINTS = 40000; // number of points of a response, per ultimate period and in total

  /* Refuse responses whose area under y is wrong. The integral gain determines the area, since at rest u is the integral. */
  function requireShown({ gains: [ki] }, { t, y, u }) {
    const area = y.reduce((sum, value, k) => (k ? sum + 0.5 * (t[k] - t[k - 1]) * (value + y[k - 1]) : 0), 0);
    if (Math.abs(u[u.length - 1] + 1) < 0.01 && Math.abs(ki * area - 1) > 0.05) throw new RangeError(`the time axis ends at ${t[t.length - 1]}, too long for this loop, which comes to rest between two plotted points: choose a shorter axis`);
  }

  const STEPS = [{ setpoint: 1, load: 0 }, { setpoint: 0, load: 1 }];

  /* Return the responses to steps. A digital controller uses backward differences. */
  const answers = remembering(REMEMBERED, ({ num, den, delay }, design, { end, points = 401, limits = null, antiWindup = "clamping", trackingTime, sampleTime = 0, noise = 0 }) => {
    const asked = { process: { num, den, delay }, controller: controller(design, limits), end, antiWindup, trackingTime };
    const between = sampleTime ? Math.min(Math.max(Math.ceil((1200 * sampleTime) / end), 1), 30) : 1; // points of a sample
    const period = NOISE_SAMPLES * noiseScale(asked.process).sampleTime, fine = Math.max(Math.ceil((PER_PERIOD * end) / period) || 0, points);
    if (fine > MOST_POINTS) throw new RangeError(`the time axis ends at ${end}, more than ${MOST_POINTS / PER_PERIOD} ultimate periods of the plant: choose a shorter axis`);
    const h = sampleTime || end / Math.max(4000, fine - 1), digital = { ...asked, sampleTime: h, method: "backward", between };
    if (noise) digital.noise = uniform(noise, Math.round(end / h) + 1);
    const [setpoint, load] = STEPS.map((step) => (sampleTime || noise ? simulateSampled({ ...digital, ...step }) : simulate({ ...asked, points: fine, ...step })));
    if (!sampleTime && !noise && !limits) requireShown(asked.controller, load);
    let top = 1;
    for (let k = 0; k < setpoint.y.length; k++) top = Math.max(top, setpoint.y[k]);
    // At rest u is minus the load. If this is beyond the limits, an error remains.
    const bears = !limits || (limits[0] <= -1 && limits[1] >= -1);
    return {
      setpoint, load, stairs: sampleTime > 0, limited: limits !== null, bears,
      iae: bears ? iae(load.t, load.y, 0) : Infinity, iaeSetpoint: iae(setpoint.t, setpoint.y, 1), peak: largest((setpoint.fine ?? setpoint).u), overshoot: top - 1 < LEAST_OVERSHOOT ? 0 : 100 * (top - 1),
    };
  });

  /* Return everything that the lab shows of one design on one plant. Visible results stay cached. With a
     digital controller the noise has its sample time. Otherwise the plant determines the sample time of the noise. */
  function study(process, design, conditions) {
    const { sampleTime = 0, end } = conditions, found = character(process, design, sampleTime, end);
    const sigma = found.stable ? found.noise() : NaN;
    return { design, ...found, sigma, noiseTime: sampleTime || noiseScale(process).sampleTime, ...answers(process, design, conditions) };
  }

  /* Return uniform noise between −size and size, the same at every call. */
  function uniform(size, count) {
    const noise = new Float64Array(count);
    for (let k = 0, state = 12345; k < count; k++) {
      state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
      noise[k] = size * (state / 2147483648 - 1);
    }
    return noise;
  }

  // --- rules --------------------------------------------------------------------------------------------------------

  /* Return the largest gain with which a loop of given shape keeps the maximum sensitivity. At each frequency, the gains k with
     |1 + k L| < 1/ms lie between the roots of a quadratic equation. Gaps remain between the intervals of all frequencies. The
     result is the upper end of a gap in which the loop is stable. The gain has the sign of the static gain of the plant. An
     unstable plant may need the other sign. */
  function gainForMs(process, design, ms) {
    const sign = Math.sign(gainOf(process));
    const found = gainOfSign(sign, process, design, ms) ?? gainOfSign(-sign, process, design, ms);
    if (found !== null) return found;
    throw new RangeError(`no gain gives a stable loop with a maximum sensitivity of ${ms}: change the times or the filter`);
  }

  function gainOfSign(sign, process, design, ms) {
    const own = controller({ ...design, kp: sign });
    const between = (w) => {
      const { re, im } = frequencyResponse({ process, controller: own, w });
      return w.map((x, i) => {
        const square = re[i] * re[i] + im[i] * im[i], root = re[i] * re[i] - square * (1 - 1 / (ms * ms));
        return root >= 0 && re[i] < 0 ? [(-re[i] - Math.sqrt(root)) / square, (-re[i] + Math.sqrt(root)) / square, i] : null;
      });
    };
    const { w } = frequencyResponse({ process, controller: own });
    const forbidden = between(w).filter(Boolean).sort((a, b) => a[0] - b[0]);
    const starts = [];
    let top = 0;
    for (const [low, high, i] of forbidden) {
      if (low > top) starts.push([low, i]);
      top = Math.max(top, high);
    }
    let largest = null;
    for (const [gain, i] of starts) {
      let best = gain, from = w[Math.max(i - 1, 0)], to = w[Math.min(i + 1, w.length - 1)];
      for (let round = 0; round < 3; round++) { // refine between the neighbours
        const fine = Array.from({ length: 41 }, (_, k) => from + ((to - from) * k) / 40), lows = between(fine).map((x) => (x ? x[0] : Infinity));
        const at = lows.indexOf(Math.min(...lows));
        best = Math.min(best, lows[at]);
        from = fine[Math.max(at - 1, 0)];
        to = fine[Math.min(at + 1, 40)];
      }
      const found = margins({ process, controller: controller({ ...design, kp: sign * best * (1 - 1e-9) }) });
      if (found.stable && found.ms < ms * 1.001) largest = sign * best * (1 - 1e-9); // its margins are cached now
      else if (largest !== null) break;
    }
    return largest;
  }

  /* Return the gain of a plant without its integrator. */
  const gainOf = ({ num, den }) => num[num.length - 1] / den[den.findLastIndex((c) => c !== 0)];

  /* Return the lags of a plant, the slowest first, and true if it integrates. The rules below require real, stable lags. */
  function realLags({ den }) {
    let rest = den.slice(), integrating = false;
    if (rest.length > 1 && rest[rest.length - 1] === 0) { integrating = true; rest = rest.slice(0, -1); }
    if (rest[rest.length - 1] === 0) throw new RangeError("this rule needs at most one integrator");
    // With den = c ∏ (1 + T s) the lags are minus the roots of the reversed polynomial.
    const found = rest.length > 1 ? roots(rest.slice().reverse()) : [];
    const size = Math.max(0, ...found.map(([re, im]) => Math.hypot(re, im)));
    // Rounding spreads a lag of order n over a small circle. An oscillating pair is far from the axis.
    if (found.some(([re, im]) => -re <= 0 || Math.abs(im) > 0.05 * size)) throw new RangeError("this rule needs real, stable lags");
    return { lags: found.map(([re]) => -re).sort((a, b) => b - a), integrating };
  }

  /* Reduce a plant to `keep` lags by Skogestad's half rule. Half of the next lag is added to the last kept lag. The other half,
     all smaller lags and a zero in the right half plane are added to the dead time. */
  function halfRule(process, keep) {
    const { lags: found, integrating } = realLags(process);
    const own = found.slice(0, keep), rest = found.slice(keep);
    let delay = process.delay;
    if (rest.length) {
      if (own.length) own[own.length - 1] += rest[0] / 2;
      delay += (own.length || integrating ? rest[0] / 2 : rest[0]) + rest.slice(1).reduce((sum, lag) => sum + lag, 0);
    }
    const end = process.num.length - 1;
    if (end > 0) delay += Math.max(0, -process.num[end - 1] / process.num[end]);
    return { lags: own, delay, integrating };
  }

  /* SIMC (Skogestad 2003) with the closed-loop time constant tc: PI for one lag, PID for two, in standard form. */
  function simc(process, design, tc) {
    const order = ORDER[design.kind];
    if (order > 1) throw new RangeError("SIMC has no PIDA");
    if (!(tc > 0)) throw new RangeError(`closed_loop_time must be above 0, found ${tc}`);
    const { num } = process;
    if (num.length > 2 || (num.length === 2 && num[0] * num[1] > 0)) throw new RangeError(`model must have at most one zero, in the right half-plane, found num = [${num.join(", ")}]`);
    const { lags: found, delay, integrating } = halfRule(process, integratingOf(process) ? order : order + 1);
    const gain = gainOf(process);
    const first = integrating ? Infinity : found[0] ?? 0, second = order ? found[integrating ? 0 : 1] ?? 0 : 0;
    const kc = (integrating ? 1 : first) / (gain * (tc + delay)), ti = Math.min(first, 4 * (tc + delay));
    const factor = 1 + second / ti, made = { kp: kc * factor, ti: ti * factor, td: second / factor, ta: 0 };
    if (!Object.values(made).every(Number.isFinite)) throw new RangeError("this rule makes no finite design for this plant and closed-loop time");
    return { ...design, ...made };
  }

  const integratingOf = ({ den }) => den.length > 1 && den[den.length - 1] === 0;

  /* Cancellation (haalman2024): the zeros of the controller are the poles of the model, and Ms determines the gain. The half
     rule reduces the model to as many lags as the controller has zeros. */
  function cancelling(process, design) {
    if (integratingOf(process)) throw new RangeError("cancellation needs a plant that does not integrate");
    const keep = ORDER[design.kind] + 1, model = halfRule(process, keep).lags;
    if (model.length < keep) throw new RangeError(`a ${design.kind} controller needs a plant with ${keep} lags to cancel`);
    const [, a1 = 0, a2 = 0, a3 = 0] = model.reduce((den, lag) => multiply(den, [1, lag]), [1]); // ascending powers
    return { ...design, ti: a1, td: a2 / a1, ta: a3 / a1 };
  }

  const byMs = (process, shape, ms) => ({ ...shape, kp: gainForMs(process, shape, ms) });

  /* Return the first terms of P(s)/(1 + filterTime s)^filterOrder as a power series in s. */
  function series({ num, den, delay }, { filterTime, filterOrder }, count) {
    const up = (values, k) => values[values.length - 1 - k] ?? 0; // coefficient of s^k
    const terms = [];
    for (let k = 0; k < count; k++) {
      let value = up(num, k);
      for (let j = 1; j <= k; j++) value -= up(den, j) * terms[k - j];
      terms.push(value / up(den, 0));
    }
    const dead = [1];
    for (let k = 1; k < count; k++) dead.push((dead[k - 1] * -delay) / k);
    const delayed = terms.map((_, k) => dead.slice(0, k + 1).reduce((sum, d, j) => sum + d * terms[k - j], 0));
    for (let n = 0; n < filterOrder; n++) for (let k = 1; k < count; k++) delayed[k] -= filterTime * delayed[k - 1];
    return delayed;
  }

  /* Magnitude optimum (vrancic2021, eqs. (13) to (16)): Re L(jw) stays -1/2 to as high a power of w as there are gains. With
     L = sum l_n s^n this means l_0 = -1/2 and l_2 = l_4 = ... = 0, linear in the gains. The filter counts as part of the plant. */
  function magnitudeOptimum(process, design) {
    if (integratingOf(process)) throw new RangeError("the magnitude optimum needs a plant that does not integrate");
    const order = ORDER[design.kind], size = order + 2;
    const { filterTime, filterOrder } = controller(design);
    const c = series(process, { filterTime, filterOrder }, 2 * size);
    const time = Math.abs(c[1] / c[0]) || 1, scaled = c.map((value, k) => value / Math.pow(time, k));
    const rows = Array.from({ length: size }, (_, r) => Array.from({ length: size }, (_, j) => scaled[2 * r - j + 1] ?? 0));
    const gains = solve(rows, rows.map((_, r) => (r ? 0 : -0.5))).map((gain, j) => gain * Math.pow(time, j - 1));
    const [ki, kp, kd = 0, ka = 0] = gains, made = { ...design, kp, ti: kp / ki, td: kd / kp, ta: ka / kp };
    if (!(made.ti > 0)) throw new RangeError(UNSTABLE(design));
    return made;
  }

  const UNSTABLE = ({ kind }) => `this plant has no magnitude optimum with a ${kind} controller that is stable`;

  /* Return a design with the gain of its rule, if the loop is stable. */
  function ifStable(process, made, words) {
    if (!margins({ process, controller: controller(made) }).stable) throw new RangeError(words);
    return made;
  }

  /* Return velocity gain and dead time of an integrator with dead time, for the next two rules. */
  function integratorOf({ num, den, delay }) {
    if (num.length !== 1 || den.length !== 2 || den[1] !== 0) throw new RangeError("this rule needs an integrator with dead time and nothing else");
    return { velocity: num[0] / den[0], delay };
  }

  const factorial = (k) => (k < 2 ? 1 : k * factorial(k - 1));

  /* Return the numerator c0 + c1 x + ... of the controller (with denominator x) that puts m + 3 poles of the loop at one place.
     x is s times the dead time (huba2018, eq. (6) and Table I). */
  function multiplePole(m) {
    const mu = Math.sqrt(m + 2), a = mu * mu - mu;
    return Array.from({ length: m + 2 }, (_, j) => {
      const rest = m + 1 - j, head = ((mu + j - 1) * Math.pow(a, rest + 1)) / factorial(rest);
      const tail = Array.from({ length: rest + 1 }, (_, i) => Math.pow(a, i) / factorial(i)).reduce((sum, x) => sum + x, 0);
      return (Math.exp(-a) / factorial(j)) * (head - j * (j - 1) * tail);
    });
  }

  const SHORT = "this rule makes no stable loop with so short a filter: use a longer filter time";

  /* Return the design for the numbers c0, c1, ..., which apply to a dead time and a gain of 1. */
  const dimensioned = (design, velocity, delay, [c0, c1, c2 = 0, c3 = 0]) => ({ ...design, kp: c1 / (velocity * delay), ti: (c1 / c0) * delay, td: (c2 / c1) * delay, ta: (c3 / c1) * delay * delay });

  /* Multiple real dominant pole (huba2018): a dead time T_e represents the filter, eq. (11) and Table II. */
  function dominantPole(process, design) {
    const { velocity, delay } = integratorOf(process), m = ORDER[design.kind], { filterTime, filterOrder: n } = controller(design), mu = Math.sqrt(m + 2);
    const pole = (m + 2) * (n + 1) - Math.sqrt((m + 2) * (n + 1) * (n - m)), ratio = pole / ((n + 1) * (n + 2) * (mu * mu - mu));
    return dimensioned(design, velocity, delay + filterTime / ratio, multiplePole(m));
  }

  /* Automatic reset (huba2024): PI and PID by the multiple pole, and PIDA_1 with a double real zero, one of which is the reset,
     eqs. (26) to (29). The dead time is that of the plant plus n T_f, eqs. (10) and (11). */
  function automaticReset(process, design) {
    const { velocity, delay } = integratorOf(process), m = ORDER[design.kind], { filterTime, filterOrder } = controller(design), c = multiplePole(m);
    if (m < 2) return dimensioned(design, velocity, delay + filterOrder * filterTime, c);
    const slow = -1 / roots(c.slice().reverse()).find(([, im]) => Math.abs(im) < 1e-9)[0];
    const first = c[0] * slow, second = (c[1] - first) * slow, short = (2 * c[3]) / second; // the double zero
    const kp = (first * short) / slow, kd = kp * (slow + short), ka = kp * slow * short;
    return dimensioned(design, velocity, delay + filterOrder * filterTime, [kp / short, kp + kd / short, kd + ka / short, ka]);
  }

  /* Least ITAE (heo2023) for a second-order model with dead time, with the tables as corrected in pidalab.rules.itae. The model
     is the plant itself, or its two lags by the half rule. The filter is that of the lab. */
  function itae(process, design, load) {
    const order = ORDER[design.kind], { num, den } = process;
    if (!order) throw new RangeError("this rule has no PI");
    const gain = gainOf(process);
    let { delay } = process, tau, xi;
    if (num.length === 1 && den.length === 3 && den[2]) [tau, xi] = [Math.sqrt(den[0] / den[2]), den[1] / (2 * Math.sqrt(den[0] * den[2]))];
    else {
      const model = halfRule(process, 2), [first, second] = model.lags;
      if (model.integrating || !second) throw new RangeError("this rule needs a plant with two lags that does not integrate");
      [tau, xi, delay] = [Math.sqrt(first * second), (first + second) / (2 * Math.sqrt(first * second)), model.delay];
    }
    const r = delay / tau;
    if (!(xi >= 0.3 && xi < 2.0000001 && r >= 0.1 && r <= 2)) throw new RangeError(`this rule needs a model with damping from 0.3 to 2 and dead time / time constant from 0.1 to 2, found ${xi.toPrecision(3)} and ${r.toPrecision(3)}`);
    let share = 0, factor = 0;
    if (order > 1) { // Table 1
      const row = r <= 0.37 ? 0 : r <= 1 ? 1 : 2, over = xi > 1;
      const [a, b, c] = (over ? [[0.966, 0.088, 1.136], [0.22, 0.02, 6.255], [0.0825, 0.0075, 18]] : [[0.105, 0.949, 0.149], [0.024, 0.216, 1.908], [0.009, 0.081, 6.407]])[row];
      share = over ? 0.5175 - 0.0875 * xi - 0.12 * r : 0.3425 + 0.0875 * xi - 0.12 * r;
      factor = (over ? -0.768 : 0.273) + (a + b * xi) * (r + c);
    }
    const time = tau + 0.5 * delay * share, [kc, ti, inverse] = (load ? loadTable : setpointTable)((delay * (1 - share)) / time, xi);
    if (!(Math.min(kc, ti, inverse) > 0)) throw new RangeError("the tables of this rule do not hold for this plant");
    const td = time / inverse;
    return { ...design, kp: kc / gain, ti: ti * time, td, ta: (td * factor) ** 2 / 2 };
  }

  const setpointTable = (r, xi) => [ // Table 2
    xi <= 0.9 ? -0.04 + (0.333 + 0.949 * r ** -0.983) * xi : -0.544 + 0.308 * r + 1.408 * xi * r ** -0.832,
    (r <= 1 ? 2.055 + 0.072 * r : 1.768 + 0.329 * r) * xi, -Math.expm1((-(r ** 1.06) * xi) / 0.87) * (0.55 + 1.683 * r ** -1.09)];
  const loadTable = (r, xi) => [ // Table 3
    2.189 * xi * r ** -0.766 + (r < 0.9 ? -0.67 + 0.297 * r ** -2.001 : -0.365 + 0.26 * (r - 1.4) ** 2),
    r < 0.4 ? 2.2122 * r ** 0.52 - 0.3 : -0.975 + 0.91 * (r - 1.845) ** 2 - Math.expm1(-xi / (0.15 + 0.33 * r)) * (5.25 - 0.88 * (r - 2.8) ** 2),
    -1.9 + 1.576 * r ** -0.53 - Math.expm1(-xi / (-0.15 + 0.939 * r ** -1.121)) * (1.45 + 0.969 * r ** -1.171)];

  /* For each rule: name, parameter, and a function that makes a design from a plant, a design and the parameter. If the
     gain of a rule is searched or tested, `shape` is the design before. */
  const RULES = {
    hand: { name: "by hand", knob: null, apply: (process, design) => design },
    optimum: {
      name: "least IAE", knob: "ms", noise: true, slow: true,
      apply: (process, design, ms, noise = 1.5) => ({ ...design, ...globalThis.pidalabOptimum.find(process, design.kind, { ms, noise }).design }),
    },
    gain: { name: "this shape, gain by Ms", knob: "ms", shape: (process, design) => design, apply: byMs },
    cancellation: { name: "cancel the lags (haalman2024)", knob: "ms", shape: cancelling, apply: (process, design, ms) => byMs(process, cancelling(process, design), ms) },
    magnitude: { name: "magnitude optimum (vrancic2021)", knob: null, shape: magnitudeOptimum, apply: (process, design) => ifStable(process, magnitudeOptimum(process, design), UNSTABLE(design)) },
    multiple: { name: "multiple pole (huba2018)", knob: null, shape: dominantPole, apply: (process, design) => ifStable(process, dominantPole(process, design), SHORT) },
    reset: { name: "automatic reset (huba2024)", knob: null, shape: automaticReset, apply: (process, design) => ifStable(process, automaticReset(process, design), SHORT) },
    itaeSetpoint: { name: "ITAE, set point (heo2023)", knob: null, apply: (process, design) => itae(process, design, false) },
    itaeLoad: { name: "ITAE, load (heo2023)", knob: null, apply: (process, design) => itae(process, design, true) },
    simc: { name: "SIMC (PI, PID)", knob: "tc", apply: simc },
  };

  // --- equal terms --------------------------------------------------------------------------------------------------

  const LONGEST = 1 / 4, FILTER_TIMES = 24; // longest filter time / end of the time axis (the shortest is a sample of the noise); number of filter times
  const MET = 2e-4, CLOSE = 0.05; // tolerances of the noise limit, in logarithms

  /* Estimate the largest gain of a shape with Ms (the upper end of the first gap) and its noise gain. The error
     is a few hundredths. If the dead time turns too far between two frequencies, every phase is assumed to occur. */
  function roughly(process, shape, ms, w, sampleTime) {
    const own = controller({ ...shape, kp: Math.sign(gainOf(process)) }), { re, im, control } = frequencyResponse({ process, controller: own, w });
    const size = w.map((_, k) => Math.hypot(re[k], im[k])), wide = process.delay * (w[1] / w[0] - 1);
    const forbidden = w.map((x, k) => {
      const along = wide * x > 1 ? -size[k] : re[k], root = along * along - size[k] * size[k] * (1 - 1 / (ms * ms));
      return along < 0 && root >= 0 ? [-1, 1].map((sign) => (-along + sign * Math.sqrt(root)) / (size[k] * size[k])) : null;
    });
    // With two integrators, the lowest frequencies exclude small gains, up to the frequency at which phase lead begins.
    const slow = forbidden.indexOf(null), least = Math.max(0, ...forbidden.slice(0, slow).map(([, high]) => high));
    const gain = Math.min(...forbidden.slice(slow).filter(Boolean).map(([low]) => low));
    if (slow < 0 || (slow > 0 && im[slow] > 0) || !(gain > least)) throw new RangeError(`no gain gives this shape a stable loop with a maximum sensitivity of ${ms}`);
    let variance = 0; // integral of the spectrum of held noise, up to half the sampling frequency
    w.forEach((x, k) => {
      if (!k || x > Math.PI / sampleTime) return;
      const held = (x * sampleTime) / 2, u = (gain * control[k] * Math.sin(held)) / held / Math.max(wide * x > 1 ? 1 - gain * size[k] : Math.hypot(1 + gain * re[k], gain * im[k]), 0.1);
      variance += ((x - w[k - 1]) * sampleTime * u * u) / Math.PI;
    });
    return { gain, noise: Math.sqrt(variance) };
  }

  /* Return the place of the maximum of a unimodal function, by golden-section search. */
  function highest(f, low, high, turns = 16) {
    const share = (Math.sqrt(5) - 1) / 2;
    let a = high - share * (high - low), b = low + share * (high - low), fa = f(a), fb = f(b);
    for (let turn = 0; turn < turns; turn++) {
      if (fa > fb) { [high, b, fb] = [b, a, fa]; a = high - share * (high - low); fa = f(a); } else { [low, a, fa] = [a, b, fb]; b = low + share * (high - low); fb = f(b); }
    }
    return fa > fb ? a : b;
  }

  /* Return the design of a rule on equal terms, much as pidalab.compare does. The rule determines the ratios of the gains, and
     Ms determines the gain. Filters with a relative noise gain of at most `noise` are allowed. The one with the largest integral
     gain is used. */
  const alike = remembering(REMEMBERED, ({ num, den, delay, end }, design, { knob, ms, noise }) => {
    const process = { num, den, delay }, { sampleTime, gain } = noiseScale(process), rule = RULES[design.rule], shapeOf = rule.shape ?? rule.apply;
    if (!(sampleTime > 0)) throw new RangeError("this plant has no time constant and no dead time, so the sample time of the noise is undefined");
    const low = Math.log(sampleTime), high = Math.log(Math.max(LONGEST * end, 4 * sampleTime)), rung = (high - low) / FILTER_TIMES;
    const shapeAt = (x) => shapeOf(process, { ...design, filterTime: Math.exp(x) }, knob);
    const w = Array.from({ length: 351 }, (_, k) => (0.1 / end) * Math.pow(10, k / 50));
    let refused = null;
    /* Return the integral gain with a filter, or the excess of the noise. */
    const worth = (x) => {
      try {
        const shape = shapeAt(x), found = roughly(process, shape, ms, w, sampleTime), loud = Math.log(found.noise / (noise * gain));
        return loud > 0 ? -loud : found.gain / shape.ti;
      } catch (error) { // some rules do not accept this filter
        refused = error;
        return -Infinity;
      }
    };
    const worths = Array.from({ length: FILTER_TIMES + 1 }, (_, k) => worth(low + k * rung)), best = worths.indexOf(Math.max(...worths));
    if (!(worths[best] > 0)) throw worths[best] > -Infinity ? new RangeError("no filter makes it as quiet as this noise limit: allow more noise") : refused;
    let x = best && highest(worth, low + (best - 1) * rung, Math.min(low + (best + 1) * rung, high)), made, slope = -Math.max(ORDER[design.kind], 1), before;
    if (!best) x = low;
    const bound = Math.log(roughly(process, shapeAt(x), ms, w, sampleTime).noise / (noise * gain)) > -CLOSE; // true if the noise limits the filter
    for (let turn = 0; turn < 8; turn++) { // find the exact filter
      const shape = shapeAt(x);
      made = { ...shape, kp: gainForMs(process, shape, ms) };
      const loud = Math.log(relativeNoiseGain(process, made) / noise);
      if (loud <= 0 && (loud > -MET || x === low || !bound)) break;
      if (before && Math.abs(x - before.x) > 1e-12) slope = Math.min((loud - before.loud) / (x - before.x), -0.2);
      before = { x, loud };
      x = Math.max(x - (loud + 0.5 * MET) / slope, low);
    }
    return made;
  });

  // --- entered numbers ----------------------------------------------------------------------------------------------

  const PLAIN = String.raw`(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:e[-+]?\d+)?`, SPACE = String.raw`\s*`;
  const TOKEN = new RegExp(`${SPACE}(?:(${PLAIN})|(pi|π|e(?![a-z])|exp|sqrt|ln|log10|[-+*/^()]|\\*\\*))`, "iy");

  /* Read a number in a usual notation: 2.5, 2,5, 5/2, 1+2.5, 2^3, exp(-1), 1/e, 36.8 %, 8.4 dB. Return NaN for other text. */
  function readNumber(entered) {
    if (typeof entered === "number") return entered;
    const text = String(entered ?? "").trim().replace(/[−–]/g, "-").replace(/[·×]/g, "*"), unit = /(%|dB)$/i.exec(text)?.[1];
    if (text.length > 60) return NaN;
    const body = unit ? text.slice(0, -unit.length) : text, tokens = [];
    TOKEN.lastIndex = 0;
    for (let at = 0; body.slice(at).trim(); at = TOKEN.lastIndex) {
      TOKEN.lastIndex = at;
      const found = TOKEN.exec(body);
      if (!found) return NaN;
      tokens.push(found[1] !== undefined ? Number(found[1].replace(",", ".")) : found[2].toLowerCase().replace("**", "^"));
    }
    const NAMED = { pi: Math.PI, "π": Math.PI, e: Math.E }, CALLED = { exp: Math.exp, sqrt: Math.sqrt, ln: Math.log, log10: Math.log10 };
    let at = 0;
    const take = (...wanted) => (wanted.includes(tokens[at]) ? tokens[at++] : null);
    const sum = () => { let x = product(); for (let sign; (sign = take("+", "-"));) x = sign === "+" ? x + product() : x - product(); return x; };
    const product = () => { let x = signed(); for (let sign; (sign = take("*", "/"));) x = sign === "*" ? x * signed() : x / signed(); return x; };
    const signed = () => (take("-") ? -power() : take("+") ? power() : power());
    const power = () => { const x = atom(); return take("^") ? Math.pow(x, signed()) : x; };
    const atom = () => {
      const token = tokens[at++];
      if (typeof token === "number") return token;
      if (Object.hasOwn(NAMED, token ?? "")) return NAMED[token];
      if (token === "(" || (Object.hasOwn(CALLED, token ?? "") && take("("))) {
        const x = sum();
        return take(")") ? (CALLED[token] ?? ((value) => value))(x) : NaN;
      }
      return NaN;
    };
    const value = tokens.length ? sum() : NaN;
    if (at < tokens.length || !Number.isFinite(value)) return NaN;
    return unit === "%" ? value / 100 : unit ? Math.pow(10, value / 20) : value;
  }

  // --- a state as the end of an address: letters that are also a valid name of an anchor -----------------------------

  const PREFIX = "lab-";
  const write = (state) => PREFIX + btoa(String.fromCharCode(...new TextEncoder().encode(JSON.stringify(state)))).replace(/\+/g, "_").replace(/\//g, "-").replace(/=+$/, "");

  /* Return the state in an address, or null if it has none. Older addresses are percent-encoded. */
  function read(hash) {
    const text = hash.replace(/^#/, "");
    try {
      decodeURIComponent(text);
      if (!text.startsWith(PREFIX)) return null;
      const bytes = atob(text.slice(PREFIX.length).replace(/_/g, "+").replace(/-/g, "/"));
      return JSON.parse(bytes.startsWith("%") ? decodeURIComponent(bytes) : new TextDecoder("utf-8", { fatal: true }).decode(Uint8Array.from(bytes, (c) => c.charCodeAt(0))));
    } catch { throw new RangeError("it is cut short or mistyped"); }
  }

  globalThis.pidalabModel = { alike, noiseScale, noiseGainAt, relativeNoiseGain, readNumber, write, read, gainOf, PLANTS, RULES, ORDER, ownPlant, controller, study, sampledMargins, beyondCrossover, iae, gainForMs, halfRule, uniform };
});
globalThis.pidalabScripts.at(-1)();
