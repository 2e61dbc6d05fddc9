// Tasks on the live cradle, from easy to hard. Whether one is done, the solver says: each asks what
// was set, the velocities after the first hit, and the record of it.
(function (explorer) {
  "use strict";
  const { controls, kept, panels } = explorer;
  const { make } = controls;
  const STILL = 0.005; // of the fastest ball's speed

  const back = (v) => v.filter((speed) => speed < -STILL).length;
  // Above its bound a ratio is that of the bound.
  const smallestRatio = (setting) => {
    const { forward, backward } = explorer.boundedRatios(setting);
    return Math.min(...forward, ...backward);
  };
  const whole = ({ masses, before, v }) => kept(masses, before, v) > 1 - 1e-4;
  const TASKS = [
    [1, "Lose no energy, and make the last two balls leave at the same speed.",
      (hit) => whole(hit) && hit.last > 0.1 && Math.abs(hit.v.at(-2) - hit.last) < STILL],
    [1, "Send the last ball off faster than the striker came.", ({ last }) => last > 1 + STILL],
    [2, "Lose more than half of the energy, and let the last ball leave with more than half of the striker's speed.",
      ({ masses, before, v, last }) => kept(masses, before, v) < 0.5 && last > 0.5],
    [3, "Stop the striker dead, with ratio 0.1 or more. (After chapter 3 you can do this with a pencil.)",
      ({ v, setting }) => explorer.law(setting) === "rule" && Math.abs(v[0]) < STILL && smallestRatio(setting) >= 0.1],
    [3, "Lose no energy, and make exactly two balls come back.", (hit) => whole(hit) && back(hit.v) === 2],
    [3, "Lose no energy, and make balls 1 and 2 collide ten times in one hit.",
      (hit) => whole(hit) && hit.record.collisions[0] >= 10],
  ]; // prettier-ignore

  // Whether each task is done by the first hit: one ball, the first, strikes others at rest.
  function done(setting, { before, after, happened }, record) {
    const alone = before[0] > 0 && before.slice(1).every((v) => v === 0) && before.length > 2;
    if (!alone || !happened || !after || !record) return TASKS.map(() => false);
    const [unit, v] = [before, after].map((row) => row.map((speed) => speed / before[0]));
    const asked = { setting, masses: setting.masses, before: unit, v, last: v.at(-1), record };
    return TASKS.map(([, , met]) => met(asked));
  }

  function tasksPanel() {
    const met = TASKS.map(() => false);
    const items = TASKS.map(([stars, words]) =>
      make("li", {}, make("span", { role: "img", "aria-label": `grade ${stars} of 3` }, "★".repeat(stars)), ` ${words} `, make("b", {})),
    );
    const count = make("span", { role: "status" });
    const node = make(
      "details",
      { class: "tasks", open: true },
      make("summary", {}, "Tasks ", count),
      make("p", {}, "Of three balls or more pull back the first, and set whatever else you like. The first hit counts."),
      make("ol", {}, ...items),
    );
    const told = make("p", { class: "task-told", role: "status" }); // beside the cradle
    let judged = null; // the setting of the last hit
    // A task is done at the hit, not by a setting that one passes.
    function show({ setting, hit, number, record, covered, own, clock }) {
      if (setting !== judged) told.textContent = "";
      const over = clock.time >= explorer.Swing.time(0) && clock.inside === null;
      if (own && over && !covered && number === 0 && setting !== judged) {
        judged = setting;
        const now = done(setting, hit, record).flatMap((yes, k) => (yes ? [k] : []));
        for (const k of now) {
          met[k] = true;
          items[k].lastChild.textContent = "\u2713 done";
          items[k].classList.add("done");
        }
        if (now.length) told.textContent = `\u2713 Done: task ${now.map((k) => k + 1).join(" and ")}`;
      }
      const words = `(${met.filter(Boolean).length} of ${TASKS.length} done)`;
      if (count.textContent !== words) count.textContent = words;
    }
    return { node, told, show };
  }

  explorer.tasksDone = done;
  panels.tasksPanel = tasksPanel;
})(globalThis.cradleExplorer);
