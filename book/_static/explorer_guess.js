// What the reader says before the balls move: bars that are drawn by hand, or one of some answers.
(function (explorer) {
  "use strict";
  const { controls, fixed, kept, percent, sum } = explorer;
  const { choice, make } = controls;
  const STEP = 0.05; // of the fastest ball's speed

  // Questions with one answer that the solver knows.
  const ANSWERS = {
    collisions: ({ record }) => (record ? String(sum(record.collisions)) : ""),
    back: ({ hit }) => {
      const back = hit.after?.flatMap((v, ball) => (v < -1e-9 ? [ball + 1] : [])) ?? [];
      return back.length ? `ball${back.length > 1 ? "s" : ""} ${explorer.list(back)}` : "none";
    },
  };

  // The velocities that can be drawn.
  function reach({ speeds }) {
    const fastest = Math.max(...speeds.map(Math.abs), 1e-9);
    return { fastest, span: [-fastest, 1.5 * fastest] };
  }

  // Ranges over the bars, one for each ball: any finger, key or screen reader can draw them.
  function handles(act) {
    const node = make("div", { class: "handles" });
    let count = 0;
    function show({ setting, guess }, box) {
      node.hidden = !guess || guess.open;
      if (node.hidden) return;
      const { fastest, span } = reach(setting);
      if (count !== guess.values.length) {
        count = guess.values.length;
        node.replaceChildren(
          ...guess.values.map((_, ball) =>
            make("input", {
              type: "range",
              "aria-label": `your guess for ball ${ball + 1}, m/s`,
              style: `--ball: ${explorer.colour(ball)}`,
              oninput: (event) => act.guess(ball, +event.target.value),
            }),
          ),
        );
      }
      const { row, x } = explorer.barPlaces(box, span);
      const half = 0.75 * box.em; // of the handle, in explorer_controls.css
      [...node.children].forEach((range, ball) => {
        Object.assign(range, { min: span[0], max: span[1], step: STEP * fastest });
        range.value = guess.values[ball];
        range.setAttribute("aria-valuetext", fixed(guess.values[ball]));
        Object.assign(range.style, {
          left: `${x(span[0]) - half}px`,
          top: `${ball * row}px`,
          height: `${row}px`,
          width: `${x(span[1]) - x(span[0]) + 2 * half}px`,
        });
      });
    }
    return { node, show };
  }

  // What a guess says: while it is drawn, and once it is known how the balls leave.
  function inWords({ setting, hit, guess, now }) {
    const { masses } = setting;
    const momentum = (row) => sum(row.map((v, ball) => masses[ball] * v));
    if (!guess.open) {
      const before = momentum(hit.before);
      const share = Math.abs(before) > 1e-9 && percent(momentum(now) / before);
      const moves = share ? `${share} of the momentum and ` : "";
      const energy = percent(kept(masses, hit.before, now));
      const lossless = explorer.lossless(setting);
      const full = "100\u00a0%";
      let aim = lossless ? `Fill both, to ${full}.` : `Fill momentum, to ${full}; of energy some is lost.`;
      if (lossless && share === full && energy === full) aim = "Both are kept. Other guesses keep both, too.";
      return `Your bars have ${moves}${energy} of the energy before the hit. ${share ? aim : ""}`;
    }
    if (!guess.touched || !hit.after) return "";
    const off = hit.after.map((v, ball) => Math.abs(v - guess.values[ball]));
    const worst = off.indexOf(Math.max(...off));
    return `Solid outlines: your guess. It is off by at most ${fixed(off[worst])} m/s, at ball ${worst + 1}.`;
  }

  // The question above an explorer in a chapter, its answers, and the task that comes after.
  function questionPanel(act, { ask, answers, answer, task }) {
    if (!ask) return null;
    const options = answers?.split("|").map((value) => ({ value, text: value }));
    const list = options && choice({ words: "your answer", options, choose: act.answer });
    const told = make("p", { class: "told", role: "status" });
    const next = make("p", {}, make("b", {}, "Now you. "), task ?? "");
    const node = make("div", { class: "question" }, make("p", {}, make("b", {}, ask)), list?.node ?? "", told);
    const after = make("div", { class: "question" }, next); // below the cradle: nothing jumps
    function show({ guess, hit, record, now, number }) {
      const open = !guess || guess.open;
      next.hidden = !(open && task);
      if (!list) return;
      list.node.inert = open;
      list.show(guess?.answer ?? null);
      if (guess?.open && number > 0) return; // the question is that of the first hit
      const right = open && guess && ANSWERS[answer]({ hit, record, now });
      let words = "";
      if (right && !guess.answer) words = `Answer: ${right}.`;
      else if (right && right === guess.answer) words = `Yes: ${right}.`;
      else if (right) words = `You said ${guess.answer}; it is ${right}.`;
      if (told.textContent !== words) told.textContent = words; // it is heard once
    }
    return { node, after, show };
  }

  Object.assign(explorer, { guessInWords: inWords, guessReach: reach });
  Object.assign(explorer.panels, { handles, questionPanel });
})(globalThis.cradleExplorer);
