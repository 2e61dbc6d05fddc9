// Spheres of steel in a row, touching or with gaps, and balls on linear springs: their contact
// forces followed in time by the package's own loop, in the chain's own units. Between two runs with steps h and h / 2 no velocity
// may differ by more than half of the accuracy.

// Young's modulus in Pa, Poisson's ratio, density in kg/m^3.
const STEEL = { modulus: 210e9, poisson: 0.3, density: 7800 };
const HERTZ = 1.5;
const ACCURACY = 1e-5; // of the fastest closing speed
const MOST = 100000; // steps of a run
const HALVINGS = 8;
const PAGES = 1000; // steps between two pauses of a run that is recorded
const LONGEST = 0.3; // time of the losses, at most, in contact times

const sum = (row) => row.reduce((total, value) => total + value, 0);
const zeros = (size) => Array(size).fill(0);
const made = (size, make) => Array.from({ length: size }, make);
const contacts = (row, of) => row.slice(1).map((right, c) => of(row[c], right, c));

// Hertz's k of two balls, N/m^1.5.
function stiffness(left, right) {
  const [r, s] = [left, right].map((m) => Math.cbrt((3 * m) / (4 * Math.PI * STEEL.density)));
  const modulus = STEEL.modulus / (2 * (1 - STEEL.poisson ** 2));
  return (4 / 3) * modulus * Math.sqrt((r * s) / (r + s));
}

const reduced = (left, right) => (left / (left + right)) * right;
// The depth of two balls is of this size, m.
const depth = (left, right, speed, k, p = HERTZ) =>
  ((reduced(left, right) * speed ** 2) / k) ** (1 / (p + 1));

// A bound of the square of a ball's frequency: two contacts store at most all the energy there is.
function highest({ w, v, k, p }) {
  const m = w.map((x) => 1 / x);
  const mean = sum(m.map((x, i) => x * v[i])) / sum(m);
  const energy = sum(m.map((x, i) => 0.5 * x * (v[i] - mean) ** 2));
  const both = m.map((_, i) => (k[i - 1] ?? 0) + (k[i] ?? 0));
  const part = Math.max(...both.map((x, i) => x ** (2 / (p + 1)) * w[i]));
  return p * part * ((p + 1) * energy) ** ((p - 1) / (p + 1));
}

// One run with steps h: its status, velocities, and, if recorded, where the chain was after each.
function follow(chain, h, recorded) {
  const n = chain.v.length;
  const lossy = chain.loss.some((time) => time > 0);
  const law = Law(chain.p, 0.01 * ACCURACY, MOST, lossy, false);
  const { w, v, k, loss, d } = chain;
  const out = Motions([zeros(n)], [0], [0], [0]);
  const [links, clocks] = [made(n, Link), [Clock()]];
  const record = recorded ? made(PAGES, () => made(4, () => zeros(n))) : [];
  const pages = [];
  let status = PAUSED;
  for (let resumed = false; status === PAUSED; resumed = true) {
    const forces = Forces([w], [v], [k], [loss], [d], [h]);
    const effort = recorded ? PAGES : Infinity;
    status = springs(0, resumed, n, forces, law, out, links, clocks, record, effort)[1];
    for (let row = 0; row < clocks[0].row && recorded; row += 1) pages.push(record[row].map((part) => [...part]));
    clocks[0].row = 0;
  }
  return { status, v: out.v[0], pages };
}

// The run that is fine enough.
function fine(chain, recorded) {
  const top = highest(chain);
  if (!contacts(chain.v, (left, right) => left > right).some(Boolean)) return { status: FINISHED, v: chain.v, pages: [] };
  const losses = Math.max(...chain.loss, 1e-300) * top;
  let h = Math.min(0.13 / Math.sqrt(top), 0.5 / losses);
  let last = follow(chain, h, false);
  for (let halved = 0; last.status === FINISHED && halved < HALVINGS; halved += 1) {
    h /= 2;
    const next = follow(chain, h, false);
    const near = next.v.every((v, i) => Math.abs(v - last.v[i]) <= 0.5 * ACCURACY);
    if (next.status === FINISHED && near) return recorded ? { ...follow(chain, h, true), h } : next;
    last = next;
  }
  return { ...last, status: UNFINISHED };
}

// The time A of losses that give two balls this restitution, over depth and speed.
const found = new Map([[1, 0]]);
function lossOf(restitution) {
  if (found.has(restitution)) return found.get(restitution);
  const back = (loss) => {
    const { v } = fine({ w: [0.5, 0.5], v: [1, 0], k: [1], loss: [loss], d: [0], p: HERTZ }, false);
    return v[1] - v[0];
  };
  let [low, high] = [0, LONGEST];
  if (back(high) > restitution) return NaN;
  for (let k = 0; k < 24; k += 1) {
    const half = (low + high) / 2;
    if (back(half) > restitution) low = half;
    else high = half;
  }
  found.set(restitution, high);
  return high;
}

// k and A of each contact: restitutions are those at a closing speed of 1 m/s.
function spheresLaw({ masses, restitution }) {
  const k = contacts(masses, stiffness);
  const viscosity = contacts(masses, (left, right, c) => lossOf(restitution[c]) * depth(left, right, 1, k[c]));
  return { stiffness: k, viscosity };
}

// What happened, at every step: rows of velocities and impulses, and the events with their rows.
function story(chain, { pages, h, v: after }) {
  const n = chain.v.length;
  const closed = chain.d.map(() => false);
  const touching = chain.d.map((d) => d === 0); // so far
  const collisions = zeros(n - 1);
  const path = [chain.v];
  const events = [];
  const pushed = (v, push) => v.map((x, i) => x + ((push[i - 1] ?? 0) - (push[i] ?? 0)) * chain.w[i]);
  for (const [, v, d, f] of pages) {
    const force = f.slice(0, n - 1);
    // The loop's velocities are those of half a step later, and lack the impulses of the losses.
    const late = force.map((x, c) => x * (chain.loss[c] - 0.5 * h));
    const before = path[path.length - 1];
    const now = pushed(v.slice(0, n), late);
    path.push(now);
    for (let c = 0; c < n - 1; c += 1) {
      const row = path.length - 1;
      const turned = before[c] > before[c + 1] && now[c] <= now[c + 1];
      if (turned && (closed[c] || force[c] > 0)) events.push({ kind: "maximum_compression", contact: c, row });
      touching[c] &&= d[c] >= -1e-12;
      if (force[c] > 0 === closed[c]) continue;
      const kind = closed[c] ? "end" : "close";
      if (closed[c] || !touching[c]) events.push({ kind, contact: c, row });
      closed[c] = !closed[c];
      collisions[c] += closed[c];
    }
  }
  path.push(after);
  const impulses = path.map((v) => {
    let passed = 0;
    return collisions.map((count, c) => {
      passed += (chain.v[c] - v[c]) / chain.w[c];
      return count ? passed : 0;
    });
  });
  return { path, impulses, events, collisions };
}

// Return the outcome for spheres that hang apart by `gap`, m; with its events and its path if
// `record` is true. Restitutions below what the law reaches have no answer: "lossy".
function spheres(given) {
  const law = spheresLaw(given);
  if (law.viscosity.some(Number.isNaN)) return { status: "lossy" };
  return forces({ ...given, ...law, exponent: HERTZ });
}

// The same for any stiffnesses and viscosities.
function forces(given) {
  const { masses, velocities, exponent: p, stiffness: k, viscosity, gap = 0, record = false } = given;
  const closing = contacts(velocities, (left, right) => left - right);
  const at = closing.indexOf(Math.max(...closing));
  const [speed, mass] = [closing[at], reduced(masses[at], masses[at + 1])];
  const unit = depth(masses[at], masses[at + 1], speed, k[at], p);
  if (!(speed > 0)) return { status: "finished", velocities, collisions: zeros(k.length), collapsed: false, saturated: [] };
  const chain = {
    w: masses.map((m) => mass / m),
    v: velocities.map((v) => (v - velocities[at]) / speed),
    k: k.map((x) => x / k[at]),
    loss: viscosity.map((time) => time * (speed / unit)),
    d: k.map(() => 0 - gap / unit),
    p,
  };
  const done = fine(chain, record);
  if (done.status !== FINISHED) return { status: "unfinished" };
  const back = (row) => row.map((v, i) => velocities[i] + speed * (v - chain.v[i]));
  const after = back(done.v);
  if (!certified(masses, velocities, after, speed)) return { status: "unsound" };
  const answer = { status: "finished", velocities: after, collapsed: false, saturated: [] };
  if (!record) return { ...answer, collisions: zeros(k.length) };
  const { path, impulses, events, collisions } = story(chain, done);
  const passed = impulses.map((row) => row.map((x) => x * mass * speed));
  return { ...answer, collisions, events, path: path.map(back), pathImpulses: passed };
}

// Momentum to rounding, no energy made, nobody overtakes.
function certified(masses, before, after, speed) {
  const change = masses.map((m, i) => m * (after[i] - before[i]));
  const size = sum(masses.map((m, i) => m * (Math.abs(after[i]) + Math.abs(before[i]))));
  const gained = sum(change.map((p, i) => 0.5 * p * (after[i] + before[i])));
  const order = contacts(after, (left, right) => left - right <= 0.01 * ACCURACY * speed);
  return Math.abs(sum(change)) <= 1e-10 * size && gained <= ACCURACY * speed * size && order.every(Boolean);
}

Object.assign(globalThis.cradle, { forces, spheres, spheresLaw });
