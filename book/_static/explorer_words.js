// What the pictures show, in words: for all readers, and for screen readers above all.
(function (explorer) {
  "use strict";

  // Two digits after the point, with a true minus sign and without a negative zero.
  function fixed(value, digits = 2) {
    const text = value.toFixed(digits);
    return (+text === 0 ? text.replace("-", "") : text).replace("-", "\u2212");
  }

  function list(words) {
    if (words.length < 2) return words.join("");
    return `${words.slice(0, -1).join(", ")} and ${words[words.length - 1]}`;
  }

  // Below this, m/s, a velocity is the rounding of zero, or what contact forces leave out.
  const ROUNDING = 1e-7;

  function way(v) {
    if (Math.abs(v) < ROUNDING) return ["rests", "rest"];
    if (+v.toFixed(2) === 0) return ["almost rests", "almost rest"];
    return v < 0 ? ["moves left", "move left"] : ["moves right", "move right"];
  }

  // "ball 1 moves left at 0.08 m/s, balls 2 and 3 rest and balls 4 and 5 move right at 0.09
  // and 0.99 m/s". Balls keep their order, so those that go one way are neighbours.
  function motions(velocities) {
    const groups = [];
    velocities.forEach((v, ball) => {
      const verb = way(v);
      const last = groups[groups.length - 1];
      if (last && last.verb[0] === verb[0]) last.balls.push(ball);
      else groups.push({ verb, balls: [ball] });
    });
    return list(
      groups.map(({ verb, balls }) => {
        const [first, last] = [balls[0] + 1, balls[balls.length - 1] + 1];
        const names =
          ["", `ball ${first}`, `balls ${first} and ${last}`][balls.length] ??
          `balls ${first} to ${last}`;
        const speeds = balls.map((ball) => fixed(Math.abs(velocities[ball])));
        const each = speeds.every((speed) => speed === speeds[0]) ? speeds.slice(0, 1) : speeds;
        const how = /move/.test(verb[0]) ? ` at ${list(each)} m/s` : "";
        return `${names} ${verb[balls.length > 1 ? 1 : 0]}${how}`;
      }),
    );
  }

  const kinetic = (masses, velocities) => masses.map((m, ball) => 0.5 * m * velocities[ball] ** 2);
  const sum = (row) => row.reduce((total, value) => total + value, 0);

  const kept = (masses, before, after) => sum(kinetic(masses, after)) / (sum(kinetic(masses, before)) || 1);

  // `number` counts from 0.
  function hitName(number) {
    return number === 0 ? "the first hit" : `hit ${number + 1}`;
  }

  function noAnswer(status, setting) {
    if (status === "lossy" && setting.restitution.some((e) => e < 0.02))
      return "Spheres that lose so much are not followed here: choose a restitution of 0.02 or more.";
    if (status === "lossy")
      return "Spheres that differ so much and lose so much are not followed here: choose larger restitutions, or masses nearer to each other.";
    const many =
      explorer.law(setting) === "rule"
        ? `This hit takes more than ${explorer.EVENTS} events, more`
        : "To follow the contact forces of this hit takes more steps";
    if (status === "unfinished")
      return `${many} than a page should compute between two pictures. The Python package has no such limit.`;
    return "The solver's answer did not pass its own checks, so none is shown.";
  }

  // One hit in full: `hit` and `answer` (its record or outcome) as explorer_swing.js makes them.
  function outcome(setting, hit, number, answer) {
    const { masses } = setting;
    if (hit.status !== "finished") return noAnswer(hit.status, setting);
    if (!hit.happened) {
      if (hit.before.every((v) => v === 0)) return "No ball is pulled back. Drag one to a side.";
      return "The balls swing together: none strikes another.";
    }
    const lost = 1 - kept(masses, hit.before, hit.after);
    const percent = lost < 0.0005 ? "Less than 0.1" : fixed(100 * lost, lost < 0.1 ? 1 : 0);
    // Contact forces are followed to five digits, which do not tell a small loss from none.
    const all = explorer.lossless(setting) || (explorer.law(setting) === "rule" && Math.abs(lost) < 1e-9);
    const said = [
      `Before ${hitName(number)}, ${motions(hit.before)}.`,
      `After it, ${motions(hit.after)}.`,
      all ? "All energy is kept." : `${percent}\u00a0% of the energy is lost.`,
    ];
    if (answer) {
      const total = sum(answer.collisions);
      said.push(
        answer.collapsed
          ? `The collisions never end; after ${total} of them the rest was taken in one step.`
          : `${total} collision${total === 1 ? "" : "s"} in all.`,
      );
      if (answer.saturated.length) {
        const pairs = answer.saturated.map((c) => `of balls ${c + 1} and ${c + 2}`);
        said.push(
          pairs.length > 1
            ? `Ratios are above their bounds, and held there: at the contacts ${list(pairs)}.`
            : `A ratio is above its bound, and held there: at the contact ${pairs[0]}.`,
        );
      }
    }
    return said.join(" ");
  }

  Object.assign(explorer, {
    fixed,
    hitName,
    kept,
    kinetic,
    list,
    outcomeInWords: outcome,
    sum,
  });
})(globalThis.cradleExplorer);
