// The swinging cradle: impacts by the event loop, pendulums between them. The rules are those of
// cradle/swinging.py and cradle/resting.py.

// Speeds below this part of the swing's speed are none: they carry 1e-20 of its energy.
const RESTING = 1e-10;
// Steps of one impact, and impacts of one call, before they are too many for a picture.
const STEPS_OF_AN_IMPACT = 20000;
const IMPACTS_OF_A_CALL = 1000;

// Return balls on their pendulums, checked.
function checkedPendulums(given) {
  const m = checkedMasses(given.masses);
  const n = m.length;
  const least = "must be at least 0";
  const rows = {
    length: row("length", given.length ?? 0.1, n, "must be above 0", POSITIVE),
    gaps: row("gaps", given.gaps ?? 0, n - 1, least, 0),
    damping: row("damping", given.damping ?? 0, n, least, 0),
  };
  for (const [name, size] of [["length", n], ["gaps", n - 1], ["damping", n]]) {
    const count = rows[name].length;
    if (count !== size) throw new Error(`${name} has ${count} values; must be ${size}, or one number`);
  }
  const gravity = one("gravity", given.gravity ?? 9.81, "must be above 0", POSITIVE);
  const square = rows.length.map((length) => gravity / length);
  const frequency = square.map(Math.sqrt);
  const at = frequency.findIndex((natural, i) => rows.damping[i] >= natural);
  if (at >= 0) {
    throw new Error(
      `damping[${at}] = ${shown(rows.damping[at])}; must be below the natural frequency ` +
        `sqrt(g/l) = ${shown(frequency[at])}`,
    );
  }
  return { ...rows, m, square, fastest: Math.max(...frequency), slowest: Math.min(...frequency) };
}

// Rule 2: give touching balls that hardly move against each other their common velocity; return
// which contacts rest.
function rest(m, v, touching, least) {
  const resting = touching.map(() => false);
  for (;;) {
    const slow = touching.map((touches, c) => touches && v[c] - v[c + 1] >= -least);
    if (!slow.some((is, c) => is && !resting[c])) return resting;
    // The common velocity may be as slow against the next ball: look again.
    slow.forEach((is, c) => (resting[c] ||= is));
    for (const [first, last] of stretches(resting)) v.fill(mean(m, v, first, last), first, last);
  }
}

// Rule 3: return the resting contacts whose balls, left alone, would not separate: neighbours are
// pooled while the left one would accelerate no less than the right one.
function pressed(m, alone, resting, least) {
  const kept = [...resting];
  for (const [first, last] of stretches(resting)) {
    const pools = [];
    for (let i = first; i < last; i += 1) {
      pools.push({ begin: i, mass: m[i], pull: alone[i] });
      while (pools.length > 1 && pools.at(-2).pull >= pools.at(-1).pull - least) {
        const right = pools.pop();
        const left = pools.at(-1);
        const mass = left.mass + right.mass;
        left.pull = (left.mass * left.pull + right.mass * right.pull) / mass;
        left.mass = mass;
      }
    }
    for (const { begin } of pools.slice(1)) kept[begin - 1] = false;
  }
  return kept;
}

// Let a cradle swing; see cradle/swinging.py for what is given.
function swing(given) {
  const hanging = checkedPendulums(given);
  const { m, gaps, square, damping, length } = hanging;
  const n = m.length;
  const whole = checkedImpact({ ...given, velocities: zeros(n) });
  const steps = given.maxEvents ?? STEPS_OF_AN_IMPACT;
  // All that changes. `since` is when the flight began, `clear` how long it has no event for sure.
  let [time, since, clear, status, count] = [0, 0, 0, "swinging", 0];
  let [x, v, flight, coming, together] = [[], [], null, null, []];
  let [speed, released] = [0, 0];

  function energy() {
    const { positions, velocities } = now();
    return sum(m.map((mass, i) => 0.5 * mass * (velocities[i] ** 2 + square[i] * positions[i] ** 2)));
  }

  // Begin anew: at rest, or with velocities.
  function restart({ positions, angles, velocities = 0 }) {
    const name = positions === undefined ? "angles" : "positions";
    const places = row(name, positions ?? angles, n);
    const speeds = row("velocities", velocities, n);
    if (places.length !== n) throw new Error(`${name} has ${places.length} values; ${n} balls need ${n}`);
    if (speeds.length !== n) throw new Error(`velocities has ${speeds.length} values; ${n} balls need ${n}`);
    const at = name === "angles" ? places.map((angle, i) => angle * length[i]) : places;
    const doubled = sum(m.map((mass, i) => mass * (speeds[i] ** 2 + square[i] * at[i] ** 2)));
    const pace = Math.sqrt(doubled / sum(m));
    const distance = gaps.map((gap, c) => gap + (at[c + 1] - at[c]));
    const size = Math.max(...at.map(Math.abs), pace / hanging.slowest);
    const c = distance.findIndex((gap) => gap < -TIE * size);
    if (c >= 0) {
      throw new Error(`${name}: balls ${c} and ${c + 1} overlap by ${shown(-distance[c])} m`);
    }
    [time, since, status, count, released, speed] = [0, 0, "swinging", 0, doubled / 2, pace];
    [x, v, flight, coming, together] = [at, speeds, null, null, gaps.map(() => false)];
    return settle(distance.map((gap) => Math.abs(gap) <= TIE * size), together);
  }

  // Move balls that touch, but for rounding, to where they touch; keep their centre.
  function align(first, last) {
    const offset = [];
    for (let i = first, at = 0; i < last; at += gaps[i], i += 1) offset[i] = at;
    const centre = mean(m, x.map((place, i) => place + offset[i]), first, last);
    for (let i = first; i < last; i += 1) x[i] = centre - offset[i];
  }

  // Solve the impacts of this instant; return them as one, or null. If one cannot be solved, nothing
  // has changed and the status says so.
  function strike(touching) {
    const [before, after, contacts] = [[...v], [...v], []];
    let loss = 0;
    for (const [first, last] of stretches(touching)) {
      const part = (values, fewer) => values.slice(first, last - fewer);
      const closing = part(v, 1).map((_, k) => v[first + k] - v[first + k + 1]);
      if (closing.every((u) => u <= RESTING * speed)) continue;
      const found = collide({
        masses: part(m, 0),
        velocities: part(v, 0),
        restitution: part(whole.e, 1),
        forward: part(whole.forward, 2),
        backward: part(whole.backward, 2),
        meeting: whole.meeting,
        maxEvents: steps,
        record: false,
      });
      if (found.status !== "finished") {
        status = found.status;
        return null;
      }
      found.velocities.forEach((velocity, k) => (after[first + k] = velocity));
      found.absorbed.forEach((work, k) => {
        loss += (1 - whole.e[first + k] ** 2) * work;
        contacts.push(first + k);
      });
    }
    if (contacts.length === 0) return null;
    v = after;
    count += 1;
    return { time: since, contacts, positions: [...x], before, after: [...after], energyLoss: loss };
  }

  // Apply the rules of touching, resting, pressing and pulling apart to this instant.
  function settle(touching, releasing) {
    for (const [first, last] of stretches(touching)) align(first, last);
    const impact = strike(touching);
    if (status !== "swinging") return null;
    const mayRest = touching.map((touches, c) => touches && !releasing[c]);
    const resting = rest(m, v, mayRest, RESTING * speed);
    const alone = x.map((place, i) => 0 - square[i] * place - 2 * damping[i] * v[i]);
    together = pressed(m, alone, resting, 1e-12 * speed * hanging.fastest);
    const parting = touching.map((touches, c) => touches && !together[c]);
    [flight, coming, clear] = [makeFlight(hanging, x, v, together, parting), null, 0];
    return impact;
  }

  // Look for the next event up to `end`, and some swings further, so that frames need not.
  function look(end) {
    while (coming === null && since + clear < end) {
      clear = Math.max(2 * clear, (4 * Math.PI) / hanging.slowest);
      coming = flight.next(clear);
    }
    return coming !== null && since + coming.time <= end ? coming : null;
  }

  // Go on to `end`, or to what `enough` says of the impacts so far.
  function proceed(end, enough) {
    const impacts = [];
    while (status === "swinging" && !enough(impacts)) {
      const event = look(end);
      if (event === null) {
        time = end;
        return { status, impacts };
      }
      const { positions, velocities } = flight.at(event.time);
      [x, v, since] = [positions, velocities, since + event.time];
      time = since;
      const touching = together.map((is, c) => is || event.closing[c]);
      const impact = settle(touching, event.releasing);
      if (impact) impacts.push(impact);
    }
    return { status: status === "swinging" ? "behind" : status, impacts };
  }

  function now() {
    if (status !== "swinging") return { positions: [...x], velocities: [...v] };
    return flight.at(time - since);
  }

  const first = restart(given);
  return {
    restart,
    energy,
    first,
    advance(dt, most = IMPACTS_OF_A_CALL) {
      return proceed(time + one("dt", dt, "must be at least 0", 0), (impacts) => impacts.length >= most);
    },
    toNextImpact(within = (4 * Math.PI) / hanging.slowest) {
      const { impacts } = proceed(time + within, (found) => found.length > 0);
      return impacts.length ? impacts[0] : null;
    },
    // When the next event comes, s: before it nothing but swinging happens. Null if not `within`.
    nextEvent(within = (4 * Math.PI) / hanging.slowest) {
      const event = status === "swinging" ? look(time + within) : null;
      return event === null ? null : since + event.time;
    },
    // Put a ball somewhere by hand, at rest like all others; it pushes those in its way.
    drag(ball, position, places = now().positions) {
      const at = [...places];
      at[ball] = position;
      for (let i = ball + 1; i < n; i += 1) at[i] = Math.max(at[i], at[i - 1] - gaps[i - 1]);
      for (let i = ball - 1; i >= 0; i -= 1) at[i] = Math.min(at[i], at[i + 1] + gaps[i]);
      restart({ positions: at });
      return at;
    },
    positions: () => now().positions,
    angles: () => now().positions.map((place, i) => place / length[i]),
    velocities: () => now().velocities,
    together: () => together.flatMap((is, c) => (is ? [c] : [])),
    get time() {
      return time;
    },
    get status() {
      return status;
    },
    get impactCount() {
      return count;
    },
    get released() {
      return released;
    },
  };
}

globalThis.cradle.swing = swing;
