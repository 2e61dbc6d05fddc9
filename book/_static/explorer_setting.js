// A setting: the balls, how far each is pulled back, and the numbers by which they collide.
// Pure functions: each returns a new setting and leaves the old one as it is.
(function (explorer) {
  "use strict";
  const data = explorer.data;
  const LIMITS = {
    balls: [2, 7],
    masses: [0.01, 100],
    speeds: [-2, 2],
    restitution: [0, 1],
    forward: [0, 1],
    backward: [0, 1],
    gap: [0, 1000],
    stiffness: [0.01, 1000],
  };
  const LENGTHS = { masses: 0, speeds: 0, restitution: 1, forward: 2, backward: 2 };
  const NONE = "-";
  // By whose law the balls collide. A setting without one has the paper's rule. Each other law has a
  // number: the gaps, in micrometres; or how much stiffer each spring is than the one before.
  const LAWS = ["rule", "spheres", "springs"];
  const NUMBER = { spheres: ["gap", 0], springs: ["stiffness", 1] };
  const law = (setting) => setting.law ?? LAWS[0];
  const lossless = (setting) => law(setting) === "springs" || setting.restitution.every((e) => e === 1);
  // m/s; the square of a smaller speed, an energy, might be no number.
  const SLOWEST = 1e-6;

  const changed = (row, places, value) => row.map((old, k) => (places.includes(k) ? value : old));
  const all = (row) => row.map((_, k) => k);

  // Say what is wrong with a setting; nothing if it can be computed.
  function refusal(setting) {
    const count = setting.masses.length;
    if (!(count >= LIMITS.balls[0] && count <= LIMITS.balls[1]))
      return `${count} ball${count === 1 ? "" : "s"}; must be ${LIMITS.balls[0]} to ${LIMITS.balls[1]}`;
    for (const [name, fewer] of Object.entries(LENGTHS)) {
      const [low, high] = LIMITS[name];
      if (setting[name].length !== count - fewer)
        return `${name} has ${setting[name].length} values; ${count} balls need ${count - fewer}`;
      const at = setting[name].findIndex((value) => !(value >= low && value <= high));
      if (at >= 0) return `${name}[${at}] = ${setting[name][at]}; must lie in [${low}, ${high}]`;
    }
    if (!LAWS.includes(law(setting))) return `law = ${setting.law}; must be ${LAWS.join(" or ")}`;
    const [number] = NUMBER[setting.law] ?? [];
    const [least, most] = LIMITS[number] ?? [];
    if (number && !(setting[number] >= least && setting[number] <= most))
      return `${number} = ${setting[number]}; must lie in [${least}, ${most}]`;
    const slow = setting.speeds.findIndex((speed) => speed !== 0 && Math.abs(speed) < SLOWEST);
    if (slow >= 0)
      return `speeds[${slow}] = ${setting.speeds[slow]}; must be 0 or at least ${SLOWEST} in size`;
    const at = setting.speeds.findIndex((speed, k) => k > 0 && speed > setting.speeds[k - 1]);
    if (at > 0) return `speeds[${at}] = ${setting.speeds[at]}; must not exceed the one before it`;
    const known = [...setting.letters].every((letter) => letter === NONE || Object.hasOwn(data.masses, letter));
    if (setting.letters.length !== count || !known)
      return `letters = ${setting.letters}; must be ${count} of A, B, C, D or -`;
    const other = setting.masses.findIndex((mass, k) => mass !== (data.masses[setting.letters[k]] ?? mass));
    if (other >= 0) {
      const letter = setting.letters[other];
      return `masses[${other}] = ${setting.masses[other]}; ball ${letter} has ${data.masses[letter]} kg`;
    }
    return "";
  }

  // The paper's numbers wherever all balls concerned carry letters, and one of them is in `balls`.
  function measured(setting, balls) {
    const { letters } = setting;
    const tabled = (row, size, table, read = (name) => name) =>
      row.map((old, k) => {
        const name = letters.slice(k, k + size);
        const concerned = balls.some((ball) => ball >= k && ball < k + size);
        return concerned && !name.includes(NONE) ? (table[read(name)] ?? old) : old;
      });
    return {
      ...setting,
      masses: tabled(setting.masses, 1, data.masses),
      restitution: tabled(setting.restitution, 2, data.restitution),
      forward: tabled(setting.forward, 3, data.ratios),
      backward: tabled(setting.backward, 3, data.ratios, (name) => [...name].reverse().join("")),
    };
  }

  // More balls repeat the last one; fewer leave the last ones out.
  function resized(setting, count) {
    const old = setting.masses.length;
    const fit = (row, length, first) =>
      Array.from({ length }, (_, k) => (k < row.length ? row[k] : (row[row.length - 1] ?? first)));
    const letters = setting.letters.padEnd(count, setting.letters[old - 1]).slice(0, count);
    const speeds = Array.from({ length: count }, (_, k) =>
      k < old ? setting.speeds[k] : Math.min(0, setting.speeds[old - 1]),
    );
    const ratio = 0.15;
    const sized = {
      ...setting,
      masses: fit(setting.masses, count),
      speeds,
      restitution: fit(setting.restitution, count - 1),
      forward: fit(setting.forward, count - 2, ratio),
      backward: fit(setting.backward, count - 2, ratio),
      letters,
    };
    const added = all(sized.masses).filter((ball) => ball >= old);
    return measured(sized, added);
  }

  function lettered(setting, balls, letter) {
    const letters = changed([...setting.letters], balls, letter).join("");
    return measured({ ...setting, letters }, balls);
  }

  // A ball of another mass is none of the paper's.
  function withMass(setting, balls, mass) {
    const letters = changed([...setting.letters], balls, NONE).join("");
    return { ...setting, letters, masses: changed(setting.masses, balls, mass) };
  }

  const withRestitution = (setting, contacts, e) => ({
    ...setting,
    restitution: changed(setting.restitution, contacts, e),
  });

  // `inner` counts the balls with two neighbours from 0.
  function withRatio(setting, inner, ratio, directions = ["forward", "backward"]) {
    const rows = directions.map((name) => [name, changed(setting[name], inner, ratio)]);
    return { ...setting, ...Object.fromEntries(rows) };
  }

  // The ratios, none above its bound, which depends on the ratio at the next ball: the last one is
  // known first.
  function boundedRatios({ masses, forward, backward }) {
    let held = { forward, backward };
    forward.forEach(() => {
      const most = globalThis.cradle.largestRatios(masses, held.forward, held.backward);
      const least = (row, bounds) => row.map((ratio, k) => Math.min(ratio, bounds[k]));
      held = { forward: least(forward, most.forward), backward: least(backward, most.backward) };
    });
    return held;
  }

  function withLaw(setting, chosen) {
    const { law: _, gap: __, stiffness: ___, ...rest } = setting;
    const [number, usual] = NUMBER[chosen] ?? [];
    return number ? { ...rest, law: chosen, [number]: setting[number] ?? usual } : rest;
  }

  // Pull one ball so far that it comes to its lowest point with this speed; it takes along the
  // balls in its way.
  function pulled(setting, ball, speed) {
    const [low, high] = LIMITS.speeds;
    const pull = Math.min(Math.max(speed, low), high);
    const speeds = setting.speeds.map((old, k) => {
      if (k === ball) return pull;
      return k < ball ? Math.max(old, pull) : Math.min(old, pull);
    });
    return { ...setting, speeds };
  }

  function atRest(setting) {
    return { ...setting, speeds: setting.speeds.map(() => 0) };
  }

  const equal = (one, other) =>
    one.letters === other.letters &&
    law(one) === law(other) &&
    one.gap === other.gap &&
    one.stiffness === other.stiffness &&
    Object.keys(LENGTHS).every((name) => String(one[name]) === String(other[name]));

  // --- the address: one word where all values are equal ---------------------------------------

  const short = (row) => (row.every((value) => value === row[0]) ? row.slice(0, 1) : row).join(",");

  function toFragment(setting, picture) {
    const { masses, speeds, restitution, forward, backward, letters } = setting;
    const parts = [`speeds=${speeds.join(",")}`, `masses=${short(masses)}`];
    parts.push(`restitution=${short(restitution)}`);
    if (forward.length) parts.push(`forward=${short(forward)}`);
    if (String(backward) !== String(forward)) parts.push(`backward=${short(backward)}`);
    if (/[^-]/.test(letters)) parts.push(`letters=${letters}`);
    const [number] = NUMBER[setting.law] ?? [];
    if (number) parts.push(`law=${setting.law}`, `${number}=${setting[number]}`);
    parts.push(`picture=${picture}`);
    return parts.join("&");
  }

  // What the solver itself does not take, such as a restitution of 1e-40.
  function refused(setting) {
    try {
      explorer.outcome(setting);
      return "";
    } catch (error) {
      return error.message;
    }
  }

  // Mail programs write `%2C` for a comma; what cannot be read stays as it is.
  function plain(address) {
    try {
      return decodeURIComponent(address);
    } catch {
      return address;
    }
  }

  // Read a fragment: {setting, picture}, or {error} in words. A key may be left out.
  function fromFragment(text) {
    const parts = text.split("&").filter((part) => part !== "");
    const given = new Map(parts.map((part) => part.split("=", 2)));
    const unknown = [...given.keys()].find(
      (key) => !(Object.hasOwn(LENGTHS, key) || ["letters", "picture", "law", "gap", "stiffness"].includes(key)),
    );
    if (unknown !== undefined) return { error: `${unknown || "a value without a name"} is no part of a setting` };
    const numbers = (name) =>
      given
        .get(name)
        .split(",")
        .map((word) => (word.trim() === "" ? NaN : +word));
    const listed = Math.max(
      (given.get("masses") ?? "").split(",").length,
      (given.get("letters") ?? "").length,
    );
    const others = Array((listed > 1 ? listed : 5) - 1).fill(0);
    const speeds = given.has("speeds") ? numbers("speeds") : [1, ...others];
    const row = (name, first) => {
      const values = given.has(name) ? numbers(name) : first;
      const length = Math.max(speeds.length - LENGTHS[name], 0);
      return values.length === 1 ? Array(length).fill(values[0]) : values;
    };
    const letters = given.get("letters") ?? NONE.repeat(speeds.length);
    const forward = row("forward", [0.15]);
    const plainly = {
      masses: row("masses", [1]),
      speeds,
      restitution: row("restitution", [1]),
      forward,
      backward: row("backward", forward),
      letters,
    };
    const named = given.get("law") ?? LAWS[0];
    const [number, usual] = LAWS.includes(named) ? (NUMBER[named] ?? []) : [];
    if (named !== LAWS[0]) plainly.law = named;
    if (number) plainly[number] = given.has(number) ? numbers(number)[0] : usual;
    // What an address leaves out, the letters say where they can.
    const left = Object.entries(measured(plainly, all(speeds))).filter(([name]) => !given.has(name));
    const setting = { ...plainly, ...Object.fromEntries(left) };
    const error = refusal(setting) || refused(setting);
    return error ? { error } : { setting, picture: given.get("picture") };
  }

  // --- the same in Python ---------------------------------------------------------------------

  function python(setting) {
    const list = (row) => `[${row.join(", ")}]`;
    const rule = law(setting) === "rule";
    const [name, model] = rule ? ["ImpulseCorrelation", ratios(setting)] : ["SpringChain", springs(setting)];
    const names = ["Chain", "Pendulums", name, "collide", "swing"].sort((a, b) => (a < b ? -1 : 1));
    const gap = law(setting) === "spheres" && setting.gap > 0; // of the first hit, and where they hang
    return `${gap ? "from dataclasses import replace\n\n" : ""}import numpy as np

from cradle import ${names.join(", ")}

chain = Chain(
    masses=${list(setting.masses)},
    velocities=${list(setting.speeds)},
    restitution=${rule ? list(setting.restitution) : 1},
)
model = ${name}(
${model}
)
${gap ? `gaps = ${setting.gap}e-6  # m\n` : ""}trace = collide(chain, ${gap ? "replace(model, gaps=gaps)" : "model"})  # the first hit
print(trace.velocities)

pendulums = Pendulums(length=1.0${gap ? ", gaps=gaps" : ""})
pulled = -chain.velocities / pendulums.natural_frequency(len(chain))
released = Chain(chain.masses, np.zeros(len(chain)), chain.restitution)
run = swing(released, model, pulled, np.arange(0, 10, 0.02), pendulums=pendulums)
print(run)
`;
  }

  const ratios = (setting) => `    forward=[${setting.forward.join(", ")}],
    backward=[${setting.backward.join(", ")}],
    excess="saturate",`;

  // Linear springs, the first of 1 N/m.
  const stiffnesses = ({ masses, stiffness }) => masses.slice(1).map((_, c) => stiffness ** c);

  // Steel, by Hertz's law; losses that give two balls the restitution at 1 m/s.
  function springs(setting) {
    if (setting.law === "springs")
      return `    stiffness=[${stiffnesses(setting).join(", ")}],  # N/m
    exponent=1,
    accuracy=1e-6,`;
    const { stiffness, viscosity } = globalThis.cradle.spheresLaw(setting);
    return `    stiffness=[${stiffness.join(", ")}],  # N/m^1.5
    viscosity=[${viscosity.join(", ")}],  # s
    accuracy=1e-6,`;
  }

  Object.assign(explorer, {
    LIMITS,
    NONE,
    all,
    atRest,
    boundedRatios,
    equal,
    fromFragment,
    law,
    lettered,
    lossless,
    plain,
    pulled,
    python,
    resized,
    stiffnesses,
    toFragment,
    withLaw,
    withMass,
    withRatio,
    withRestitution,
  });
})(globalThis.cradleExplorer);
