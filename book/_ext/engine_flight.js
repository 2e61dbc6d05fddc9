// Pendulums between impacts: the closed forms of cradle/flight.py. A complex number is [re, im].

// Events nearer than this part of a swing (over 2 pi) are one; so are lengths, of the amplitude.
const TIE = 1e-9;
// Below this part of its largest value a derivative is a rounding error.
const ROUNDING = 1e-11;
const MOST_STEPS = 100000;

const times = ([a, b], [c, d]) => [a * c - b * d, a * d + b * c];
const size_of = ([a, b]) => Math.hypot(a, b);
const wave = ([a, b], t) => {
  const left = Math.exp(a * t);
  return [left * Math.cos(b * t), left * Math.sin(b * t)];
};
// exp(z t) - 1 without cancellation: cos b - 1 = -2 sin(b / 2) ** 2.
const wave_minus_one = ([a, b], t) => {
  const half = Math.sin((b * t) / 2);
  return [Math.expm1(a * t) * Math.cos(b * t) - 2 * half * half, Math.exp(a * t) * Math.sin(b * t)];
};
const sum = (values) => values.reduce((total, value) => total + value, 0);

// Return when level + sum Re(C exp(rate t)) first falls to zero; terms are [C, rate]. `parting`: it
// starts at exactly zero and is about to rise.
function firstFall(level, given, parting, horizon) {
  const terms = given.filter(([c]) => c[0] !== 0 || c[1] !== 0);
  if (terms.length === 0) return Infinity;
  if (terms.length > 1 || !(level === 0 || terms[0][1][0] === 0)) {
    return march(level, terms, parting, horizon);
  }
  let [c, rate] = terms[0];
  if (parting) c = [-level, -Math.abs(c[1])];
  if (level >= size_of(c)) return Infinity;
  let wait = Math.acos(Math.max(-level / size_of(c), -1)) - Math.atan2(c[1], c[0]);
  if (!parting) {
    wait %= 2 * Math.PI;
    if (wait < 0) wait += 2 * Math.PI;
    // It meets now, and rounding says that it has just met.
    if (wait > 2 * Math.PI - TIE) wait = 0;
  }
  return wait / rate[1];
}

// March from below: with a bound K on the second derivative from now on, the parabola
// f + f' h - K h ** 2 / 2 lies below the function, so a step to its root passes no root.
function march(level, terms, parting, horizon) {
  const size = sum(terms.map(([c]) => size_of(c)));
  const decay = Math.min(...terms.map(([, rate]) => -rate[0]));
  const [speed, ...bounds] = [1, 2, 3, 4].map((n) =>
    sum(terms.map(([c, rate]) => size_of(c) * size_of(rate) ** n)),
  );
  let time = parting ? firstStep(terms, bounds, speed) : 0;
  for (let step = 0; step < MOST_STEPS; step += 1) {
    const left = Math.exp(-decay * time);
    if (time > horizon || size * left < level) return Infinity;
    let [value, noise] = [0, 4e-16 * speed * time];
    if (parting) {
      // From zero: the difference from the start keeps its digits.
      value = sum(terms.map(([c, rate]) => times(c, wave_minus_one(rate, time))[0]));
    } else {
      value = level + sum(terms.map(([c, rate]) => times(c, wave(rate, time))[0]));
      noise = 4e-16 * (Math.abs(level) + size);
    }
    const slope = sum(terms.map(([c, rate]) => times(times(c, rate), wave(rate, time))[0]));
    if (value <= noise && (slope < 0 || value < -noise)) {
      return slope < 0 ? Math.max(time + value / Math.abs(slope), 0) : time;
    }
    const bound = bounds[0] * left;
    const root = Math.sqrt(slope * slope + 2 * bound * Math.max(value, noise));
    time += slope > 0 ? (root + slope) / bound : (2 * Math.max(value, noise)) / (root - slope);
  }
  throw new Error(`no end of the search for a meeting after ${MOST_STEPS} steps`);
}

// Return a step that passes no root, for a function that rises from exactly zero: if its first
// derivative that is not zero is the n-th, d, and the next at most K, up to (n + 1) d / K.
function firstStep(terms, bounds, speed) {
  let parts = terms.map(([c]) => c);
  for (let order = 1; order <= bounds.length; order += 1) {
    parts = parts.map((part, k) => times(part, terms[k][1]));
    const derivative = sum(parts.map((part) => part[0]));
    if (derivative > ROUNDING * (order > 1 ? bounds[order - 2] : speed)) {
      return ((order + 1) * derivative) / bounds[order - 1];
    }
  }
  return TIE / Math.max(...terms.map(([, rate]) => size_of(rate)));
}

// Mean weighted by mass of balls first..last - 1; equal values stay what they are, to the bit.
function mean(m, values, first, last) {
  let [total, mass, equal] = [0, 0, true];
  for (let i = first; i < last; i += 1) {
    total += m[i] * values[i];
    mass += m[i];
    equal = equal && values[i] === values[first];
  }
  return equal ? values[first] : total / mass;
}

// Return [first, last + 1] of the balls of each stretch of marked contacts.
function stretches(marked) {
  const found = [];
  for (let c = 0; c < marked.length; c += 1) {
    if (!marked[c]) continue;
    const first = c;
    while (marked[c]) c += 1;
    found.push([first, c + 1]);
  }
  return found;
}

// A flight: damped harmonic motion of bodies of one or more balls. Ball i is at
// centre[i] + Re(amplitude[i] exp(rate[i] t)).
function makeFlight(hanging, x, v, together, parting) {
  const { m, square, damping, gaps } = hanging;
  const n = m.length;
  const [centre, amplitude, rate, firstOf] = made(4, () => Array(n));
  for (let first = 0, last; first < n; first = last) {
    for (last = first + 1; together[last - 1]; ) last += 1;
    const [w2, d] = [mean(m, square, first, last), mean(m, damping, first, last)];
    const offset = [];
    for (let i = first, at = 0; i < last; at -= gaps[i], i += 1) offset[i] = at;
    const pulls = offset.map((at, i) => square[i] * at);
    const lowest = -mean(m, pulls, first, last) / w2;
    const frequency = Math.sqrt(w2 - d * d);
    const start = x[first] - lowest;
    for (let i = first; i < last; i += 1) {
      firstOf[i] = first;
      centre[i] = lowest + offset[i];
      amplitude[i] = [start, -(v[first] + d * start) / frequency];
      rate[i] = [-d, frequency];
    }
  }

  function meeting(c, horizon) {
    const level = gaps[c] + centre[c + 1] - centre[c];
    const [one, other] = [amplitude[c], amplitude[c + 1]];
    const same = rate[c][0] === rate[c + 1][0] && rate[c][1] === rate[c + 1][1];
    const terms = same
      ? [[[other[0] - one[0], other[1] - one[1]], rate[c]]]
      : [[other, rate[c + 1]], [[-one[0], -one[1]], rate[c]]];
    return firstFall(level, terms, parting[c], horizon);
  }

  // When the force in contact c, whose balls move together, falls to zero. It stops the balls up to
  // c from moving as they would alone.
  function release(c, horizon) {
    const factor = times(rate[c], rate[c]);
    let [level, weight, farthest, pull] = [0, 0, 0, [0, 0]];
    for (let i = firstOf[c]; i <= c; i += 1) {
      level -= m[i] * square[i] * centre[i];
      weight += m[i] * square[i];
      farthest = Math.max(farthest, Math.abs(centre[i]));
      pull = [
        pull[0] + m[i] * (square[i] + 2 * damping[i] * rate[c][0] + factor[0]),
        pull[1] + m[i] * (2 * damping[i] * rate[c][1] + factor[1]),
      ];
    }
    const swings = times(amplitude[c], pull);
    const largest = weight * (size_of(amplitude[c]) + farthest);
    // They swing together by themselves.
    if (size_of(swings) + Math.abs(level) <= ROUNDING * largest) return Infinity;
    return firstFall(level, [[[-swings[0], -swings[1]], rate[c]]], false, horizon);
  }

  return {
    // The first event within the horizon, s: when, which contacts close, which are drawn apart.
    next(horizon) {
      const due = gaps.map((_, c) => (together[c] ? release(c, horizon) : meeting(c, horizon)));
      const time = Math.min(...due);
      const closing = due.map((at, c) => !together[c] && at <= time + TIE / hanging.fastest);
      const releasing = due.map((at, c) => together[c] && at === time);
      return time > horizon ? null : { time, closing, releasing };
    },
    at(time) {
      const [positions, velocities] = [[], []];
      for (let i = 0; i < n; i += 1) {
        const now = times(amplitude[i], wave(rate[i], time));
        positions.push(centre[i] + now[0] + 0); // no -0
        velocities.push(times(rate[i], now)[0] + 0);
      }
      return { positions, velocities };
    },
  };
}
