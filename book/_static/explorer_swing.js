// The swing: equal pendulums that touch at rest. With small angles all balls come to their lowest
// points at the same instants, half a period apart, and only there can they collide. So a swing is
// a sequence of hits: reverse the velocities of the last one, and let the solver answer.
(function (explorer) {
  "use strict";
  // Metres and m/s^2, as in the Python that the page shows.
  const LENGTH = 1.0;
  const GRAVITY = 9.81;
  const FREQUENCY = Math.sqrt(GRAVITY / LENGTH);
  const HALF_PERIOD = Math.PI / FREQUENCY;
  // As in cradle/swinging/resting.py: slower motion against each other counts as none.
  const RESTING = 1e-10;
  // Beyond this number of events a hit would hold up the picture.
  const EVENTS = 4000;

  const question = (setting, velocities) => ({
    masses: setting.masses,
    velocities,
    restitution: setting.restitution,
    forward: setting.forward,
    backward: setting.backward,
    maxEvents: EVENTS,
  });

  // The answer of the law that the setting names; with its history if asked for.
  function answered(setting, velocities, record) {
    const { masses, restitution, gap } = setting;
    const given = { masses, velocities, record };
    if (setting.law === "spheres")
      return globalThis.cradle.spheres({ ...given, restitution, gap: 1e-6 * gap });
    if (setting.law === "springs") {
      const stiffness = explorer.stiffnesses(setting);
      const viscosity = stiffness.map(() => 0);
      return globalThis.cradle.forces({ ...given, exponent: 1, stiffness, viscosity });
    }
    return globalThis.cradle.collide({ ...question(setting, velocities), record });
  }

  // Touching balls that hardly move against each other get their common velocity (rule 2 of
  // cradle/swinging/resting.py).
  function settled(masses, velocities, least) {
    let v = velocities.slice();
    const resting = v.map(() => false); // against the right neighbour
    for (;;) {
      const found = v.findIndex(
        (_, c) => c + 1 < v.length && !resting[c] && v[c] - v[c + 1] >= -least,
      );
      if (found < 0) return v;
      for (let c = 0; c + 1 < v.length; c += 1) if (v[c] - v[c + 1] >= -least) resting[c] = true;
      for (let first = 0, last; first < v.length; first = last + 1) {
        for (last = first; resting[last];) last += 1;
        if (last === first) continue;
        let mass = 0;
        let momentum = 0;
        for (let ball = first; ball <= last; ball += 1) {
          mass += masses[ball];
          momentum += masses[ball] * v[ball];
        }
        v = v.map((old, ball) => (ball >= first && ball <= last ? momentum / mass : old));
      }
    }
  }

  // The outcome of a hit without its history, for sweeps and maps.
  const outcome = (setting, velocities = setting.speeds) => answered(setting, velocities, false);

  class Swing {
    constructor(setting) {
      this.setting = setting;
      const { masses, speeds } = setting;
      const mass = masses.reduce((sum, m) => sum + m, 0);
      const energy = masses.reduce((sum, m, k) => sum + m * speeds[k] ** 2, 0);
      this.least = RESTING * Math.sqrt(energy / mass);
      this.hits = []; // {before, after, status, happened}
    }

    static time(hit) {
      return HALF_PERIOD / 2 + hit * HALF_PERIOD;
    }

    // Hit 0 is the first one.
    hit(number) {
      while (this.hits.length <= number) this.hits.push(this.next());
      return this.hits[number];
    }

    next() {
      const last = this.hits[this.hits.length - 1];
      if (last && last.status !== "finished") return last;
      const before = last ? last.after.map((v) => 0 - v) : this.setting.speeds;
      const happened = before.some((v, k) => k > 0 && before[k - 1] - v > this.least);
      const answer = happened
        ? outcome(this.setting, before)
        : { status: "finished", velocities: before };
      const { status } = answer;
      const after =
        status === "finished" ? settled(this.setting.masses, answer.velocities, this.least) : null;
      return { before, after, status, happened };
    }

    // The same hit with its history: what the solver went through.
    record(number) {
      const { before, happened, status } = this.hit(number);
      if (!happened || status !== "finished") return null;
      return answered(this.setting, before, true);
    }

    // The number of the last hit up to a time; -1 before the first one.
    latest(time) {
      return Math.floor((time - HALF_PERIOD / 2) / HALF_PERIOD + 1e-9);
    }

    // Positions along the arcs at a time, m; null beyond a hit that has no answer.
    positions(time) {
      const number = this.latest(time);
      if (number < 0)
        return this.setting.speeds.map((v) => (-v / FREQUENCY) * Math.cos(FREQUENCY * time));
      const { after, status } = this.hit(number);
      if (status !== "finished") return null;
      const since = time - Swing.time(number);
      return after.map((v) => (v / FREQUENCY) * Math.sin(FREQUENCY * since));
    }
  }

  Object.assign(explorer, { EVENTS, FREQUENCY, LENGTH, Swing, outcome });
})(globalThis.cradleExplorer);
