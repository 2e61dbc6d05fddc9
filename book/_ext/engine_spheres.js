// Spheres of steel in a row, touching or with gaps, and balls on linear springs: their contact
// forces followed in time by the package's own loop.

// Young's modulus in Pa, Poisson's ratio, density in kg/m^3.
const STEEL = { modulus: 210e9, poisson: 0.3, density: 7800 };
const HERTZ = 1.5;
const ACCURACY = 1e-5; // of the fastest closing speed
const MOST = 100000; // steps of a run
const PAGES = 1000; // steps between two pauses of a run that is recorded

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

// The time A of losses that give two balls this restitution, over depth and speed.
const found = new Map([[1, 0]]);
function lossOf(restitution) {
  if (found.has(restitution)) return found.get(restitution);
  const pair = { masses: [1, 1], velocities: [1, 0], stiffness: [1], exponent: HERTZ };
  const back = (loss) => {
    const [left, right] = forces({ ...pair, viscosity: [loss * depth(1, 1, 1, 1)] }).velocities;
    return right - left;
  };
  let [low, high] = [0, 0.999 * LONGEST];
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
function story({ masses, viscosity, exponent }, { mass, speed, length, h }, pages) {
  const closed = viscosity.map(() => false);
  const touching = viscosity.map((_, c) => pages[0][2][c] === 0); // so far
  const collisions = viscosity.map(() => 0);
  const loss = viscosity.map((time) => time * (speed / length));
  const path = [pages[0][1]];
  const stored = [0]; // energy in the contacts
  const events = [];
  for (const [, v, d, force] of pages.slice(1, -1)) {
    // The loop's velocities are those of half a step later, and lack the impulses of the losses.
    const late = loss.map((time, c) => force[c] * (time - 0.5 * h));
    const before = path[path.length - 1];
    const now = v.map((x, i) => x + ((late[i - 1] ?? 0) - (late[i] ?? 0)) * (mass / masses[i]));
    const row = path.push(now) - 1;
    stored.push(force.reduce((sum, push, c) => sum + (push > 0 ? (push * d[c]) / (exponent + 1) : 0), 0));
    for (let c = 0; c < loss.length; c += 1) {
      const turned = before[c] > before[c + 1] && now[c] <= now[c + 1];
      if (turned && (closed[c] || force[c] > 0)) events.push({ kind: "maximum_compression", contact: c, row });
      // The loop counts depths to h^2 / 12 of a rate; what losses have opened closes once more.
      touching[c] &&= !closed[c] && d[c] >= -h * h;
      if (force[c] > 0 === closed[c]) continue;
      const kind = closed[c] ? "end" : "close";
      if (closed[c] || !touching[c]) events.push({ kind, contact: c, row });
      closed[c] = !closed[c];
      collisions[c] += closed[c];
    }
  }
  path.push(pages[pages.length - 1][1]);
  stored.push(0);
  const impulses = path.map((v) => {
    let passed = 0;
    return collisions.map((count, c) => {
      passed += (path[0][c] - v[c]) * speed * masses[c];
      return count ? passed : 0;
    });
  });
  return { path, impulses, stored: stored.map((energy) => energy * mass * speed ** 2), events, collisions };
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
  const { masses, velocities, exponent, stiffness: k, viscosity, gap = 0, record = false } = given;
  const n = masses.length;
  const chains = Springs([masses], [velocities], [k], [viscosity], [k.map(() => gap)]);
  const out = Motions([made(n, () => 0)], [0], [0], [0], [0]);
  const [links, clock] = [made(n, Link), Clock()];
  const run = (resumed, room, effort) =>
    follow(0, resumed, n, chains, Law(exponent, ACCURACY, MOST), out, links, [clock], room, effort)[1];
  const status = run(false, [], Infinity);
  if (status === REFUSED && clock.rule === LATE) return { status: "lossy" };
  if (status !== FINISHED) return { status: status === UNSOUND ? "unsound" : "unfinished" };
  const answer = { status: "finished", velocities: out.v[0], collapsed: false, saturated: [] };
  if (!record) return { ...answer, collisions: k.map(() => 0) };
  const room = made(PAGES + 2, () => made(4, () => made(n, () => 0)));
  const pages = [];
  for (let more = PAUSED, resumed = false; more === PAUSED; resumed = true) {
    more = run(resumed, room, PAGES);
    for (const page of room.slice(0, clock.row)) pages.push(page.map((part) => [...part]));
    clock.row = 0;
  }
  const { path, impulses, stored, events, collisions } = story(given, clock, pages);
  const back = (row) => row.map((v, i) => velocities[i] + clock.speed * (v - path[0][i]));
  return { ...answer, collisions, events, path: path.map(back), pathImpulses: impulses, stored };
}

Object.assign(globalThis.cradle, { forces, spheres, spheresLaw });
