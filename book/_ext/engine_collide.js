// One impact: what is asked of input, the event loop's work area, the outcome.

const KINDS = ["maximum_compression", "end", "close", "collapse", "repetition"];
// Steps after which an impact is given up, unless told otherwise: some tenths of a second.
const MAX_EVENTS = 20000;
const ENDLESS = 2 ** 53;

// Largest admissible ratio at each inner ball, forward (Eq. 53) and backward (its mirror image). The
// bound needs the ratio at the next ball; at 0, the last one's, it is Eq. 34.
function largestRatios(masses, forward = 0, backward = 0) {
  const m = checkedMasses(masses);
  const inner = m.length - 2;
  const [f, b] = [checkedRatios("forward", forward, inner), checkedRatios("backward", backward, inner)];
  const bounds = { forward: [], backward: [] };
  for (let i = 0; i < inner; i += 1) {
    const [onward, back] = [i + 1 < inner ? f[i + 1] : 0, i > 0 ? b[i - 1] : 0];
    bounds.forward.push(1 / (1 + (m[i + 1] / m[i + 2]) * (1 - onward)));
    bounds.backward.push(1 / (1 + (m[i + 1] / m[i]) * (1 - back)));
  }
  return bounds;
}

function checkedMasses(masses) {
  const m = row("masses", masses, undefined, "must be above 0", Number.MIN_VALUE);
  if (m.length > 1) return m;
  throw new Error(
    `masses has shape ${shape(masses)}; a chain needs (N,) with N >= 2: one row of two or more numbers`,
  );
}

function checkedRatios(name, ratios, inner) {
  const values = row(name, ratios, inner, "must lie in [0, 1]", 0, 1);
  if (values.length !== inner) {
    throw new Error(`${name} has ${values.length} values; ${inner + 2} balls need ${inner}, or one number`);
  }
  return values;
}

const ASKED = [
  "masses", "velocities", "restitution", "forward", "backward", "meeting", "saturate", "maxEvents", "record",
];

// Return a chain and its model as the event loop wants them, or throw.
function checkedImpact(given) {
  const unknown = Object.keys(given).find((name) => !ASKED.includes(name));
  if (unknown) throw new Error(`${unknown} is no part of an impact; these are: ${ASKED.join(", ")}`);
  const m = checkedMasses(given.masses);
  const n = m.length;
  const heaviest = Math.max(...m);
  const light = m.findIndex((mass) => mass < LIMITS.lightest * heaviest);
  if (light >= 0) {
    throw new Error(
      `masses[${light}] = ${shown(m[light])}; for this model it must be at least ` +
        `${shown(LIMITS.lightest)} of the heaviest ball of its chain`,
    );
  }
  const v = row("velocities", given.velocities);
  if (v.length !== n || typeof given.velocities === "number") {
    throw new Error(
      `velocities has shape ${shape(given.velocities)}; ${n} masses need (${n},): ` +
        `one velocity for each of ${n} balls`,
    );
  }
  refuseOverflow(m, v);
  const e = row("restitution", given.restitution ?? 1, n - 1, "must lie in [0, 1]", 0, 1);
  const least = LIMITS.least_restitution;
  const small = e.findIndex((value) => value > 0 && value < least);
  if (small >= 0) {
    const here = typeof given.restitution === "number" ? "" : `[${small}]`;
    throw new Error(`restitution${here} = ${shown(e[small])}; must be 0 or at least ${shown(least)}`);
  }
  if (e.length !== n - 1) {
    throw new Error(
      `restitution has shape ${shape(given.restitution)}; ${n} balls need () or (${n - 1},): ` +
        "one number, or one for each contact",
    );
  }
  // Two balls have no ratio.
  const forward = checkedRatios("forward", given.forward ?? (n === 2 ? [] : undefined), n - 2);
  const backward = checkedRatios("backward", given.backward ?? forward, n - 2);
  const meeting = one("meeting", given.meeting ?? 0.5, "must lie in [0, 1]", 0, 1);
  const saturate = given.saturate ?? true;
  if (typeof saturate !== "boolean") throw new Error(`saturate = ${shown(saturate)}; must be true or false`);
  if (!saturate) refuseExcess(m, forward, backward);
  return { m, v, e, forward, backward, meeting };
}

function refuseOverflow(m, v) {
  const sum = (term) => m.reduce((total, mass, i) => total + term(mass, v[i]), 0);
  const energy = sum((mass, speed) => mass * speed * speed);
  const momentum = 2 * sum((mass, speed) => mass * Math.abs(speed));
  if (Number.isFinite(energy) && Number.isFinite(momentum)) return;
  const sizes = v.map(Math.abs);
  const at = sizes.indexOf(Math.max(...sizes));
  const what = Number.isFinite(energy) ? "momentum" : "kinetic energy";
  throw new Error(`velocities[${at}] = ${shown(v[at])}; ${what} overflows: choose larger units`);
}

function refuseExcess(m, forward, backward) {
  const bounds = largestRatios(m, forward, backward);
  for (const [name, ratios, mirrored] of [["forward", forward, ""], ["backward", backward, ", mirrored"]]) {
    const at = ratios.findIndex((ratio, i) => ratio > bounds[name][i] * LIMITS.rounded);
    if (at < 0) continue;
    const bound = shown(Number(bounds[name][at].toPrecision(6))).replace(/\.0$/, "");
    throw new Error(
      `${name}[${at}] = ${shown(ratios[at])}; at ball ${at + 1}, counted from 0, it must not exceed ` +
        `${bound} (Eq. 53${mirrored}): above it a driven contact opens; ` +
        "saturate: true holds the contact closed instead",
    );
  }
}

// Return a row of things; a plain loop, as this is much of the time of a short impact.
function made(size, make) {
  const things = [];
  for (let k = 0; k < size; k += 1) things.push(make());
  return things;
}

const zero = () => 0;
const zeros = (size) => made(size, zero);

// A work area for n balls, all zeros.
function area(n, record) {
  const memory = [made(n, Memory), made(n, Memory)];
  return State(made(n, Ball), made(n, Contact), made(n, Run), made(2, Level), memory, [Tally()], record);
}

// Rows that the last record of n balls did not need, kept for the next one if they are not many.
const records = new Map();
const KEPT_ROWS = 1000;

// Make room in a record for more events than one round can write: each contact may end, close,
// collapse, pass its maximum and repeat itself.
function makeRoom(state, n, least) {
  const { kinds, contacts, velocities, impulses } = state.record;
  const spare = 5 * n;
  const room = max(kinds.length, spare + least);
  while (kinds.length < room) {
    kinds.push(0);
    contacts.push(0);
  }
  while (velocities.length <= room) {
    velocities.push(zeros(n));
    impulses.push(zeros(n - 1));
  }
  state.tally[0].room = room - spare;
}

// Solve an impact that has been checked.
function solved(chain, maxEvents, recorded) {
  const n = chain.m.length;
  if (recorded && !records.has(n)) records.set(n, Record([], [], [], []));
  const state = area(n, recorded ? records.get(n) : Record([], [], [], []));
  state.tally[0].room = ENDLESS;
  if (recorded) makeRoom(state, n, 64);
  const { m, v, e, forward, backward, meeting } = chain;
  const out = Outputs([zeros(n)], [zeros(n - 1)], [0], [0], zeros(n - 1), zeros(n - 1), zeros(n - 1));
  const inputs = Inputs([m], [v], [e], [forward], [backward]);
  const options = Options(meeting, maxEvents, false);
  let status = FINISHED;
  for (let resumed = false; ; resumed = true) {
    status = batch(0, resumed, n, inputs, options, out, state, ENDLESS)[1];
    if (status === UNDECIDED) continue; // here the loop decides
    if (status !== PAUSED) break;
    makeRoom(state, n, 2 * state.record.kinds.length);
  }
  if (recorded) [state.record.velocities[0], state.record.impulses[0]] = [[...v], zeros(n - 1)];
  return { status, state, out };
}

// Return the outcome of an impact, with `events`, `path` and `pathImpulses` if `record` is true.
function collide(given) {
  if (typeof given !== "object" || given === null) throw new Error(`an impact = ${given}; must be an object`);
  const recorded = given.record ?? true;
  const limit = given.maxEvents ?? MAX_EVENTS;
  if (!(Number.isInteger(limit) && limit >= 1)) {
    throw new Error(`maxEvents = ${shown(limit)}; must be a whole number, at least 1`);
  }
  const { status, state, out } = solved(checkedImpact(given), limit, recorded);
  const tally = state.tally[0];
  if (status === UNSOUND || status === REFUSED) {
    // No number of such an outcome is worth anything.
    const defect = status === UNSOUND ? DEFECTS[tally.defect] : "the event loop refused the input";
    return { status: "unsound", defect };
  }
  const result = {
    status: status === FINISHED ? "finished" : "unfinished",
    velocities: out.v[0],
    impulses: out.p,
    absorbed: out.a,
    collisions: out.hits[0],
    collapsed: out.collapsed[0] === 1,
    saturated: out.held.flatMap((held, c) => (held ? [c] : [])),
    margin: out.margin[0],
  };
  if (recorded) {
    const { kinds, contacts, velocities, impulses } = state.record;
    result.events = contacts.slice(0, tally.events).map((contact, k) => ({ kind: KINDS[kinds[k]], contact }));
    result.path = velocities.splice(0, tally.events + 1);
    result.pathImpulses = impulses.splice(0, tally.events + 1);
    if (kinds.length > KEPT_ROWS) records.delete(out.v[0].length);
  }
  return result;
}

// The same without a record: for sweeps and maps.
function outcome(given) {
  return collide({ ...given, record: false });
}

globalThis.cradle = { collide, outcome, largestRatios, shown };
