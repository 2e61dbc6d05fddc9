// The parts of an explorer. A panel makes its elements once; `show` then brings them up to date
// with the state. What a reader does is passed on as a call of `act`, nothing else is changed here.
(function (explorer) {
  "use strict";
  const { LIMITS, NONE, all, controls } = explorer;
  const { button, choice, make, select, slider } = controls;
  const panels = (explorer.panels = {});

  // --- scenes: choose one, or walk through them -------------------------------------------------

  // In a chapter of them: the paper's chains alone.
  function scenesPanel(act, parts, first) {
    const { scenes } = explorer.data;
    const chains = parts.has("chains");
    const entries = (list) => list.map(({ key, title }) => ({ value: key, text: title }));
    const options = [
      { entries: [{ value: "", text: "a setting of your own" }] },
      { group: "The story", entries: entries(scenes.filter((scene) => !scene.paper)) },
      { group: "The paper's ten chains (letters: kinds of ball)", entries: entries(scenes.filter((scene) => scene.paper)) },
    ];
    const list = select({
      words: chains ? "Chain" : "Scene",
      options: chains ? options.slice(2) : options,
      choose: act.scene,
      hidden: true,
    });
    const place = make("span", { class: "place" });
    const full = button("Full screen", act.fullScreen, { class: "full" });
    const text = make("p", { class: "scene-text" });
    const walk = make(
      "div",
      { class: "walk" },
      ...(chains
        ? [list.node]
        : [
            button("←", () => act.walk(-1), { "aria-label": "previous scene" }),
            list.node,
            button("→", () => act.walk(1), { "aria-label": "next scene" }),
            place,
            full,
          ]),
    );
    function show({ scene }) {
      full.textContent = document.fullscreenElement ? "Leave full screen" : "Full screen";
      const at = scenes.findIndex(({ key }) => key === scene);
      list.show(scene);
      place.textContent = at < 0 ? "" : `${at + 1} of ${scenes.length}`;
      const { text: said, link } = scenes[at] ?? { text: "" };
      const more = link ? [" ", make("a", { href: link.address }, link.words)] : [];
      // It tells the answer: it is there unseen, so that nothing below it moves when it comes.
      const words = [make("span", { class: "said-of-scene" }, said, ...more)];
      if (first) words.push(make("span", { class: "first" }, first)); // before the first hit
      text.replaceChildren(...words);
    }
    return { node: make("div", { class: "scenes" }, walk, chains ? "" : text), show };
  }

  // --- running: let go, step, slow motion ---------------------------------------------------------

  function runPanel(act, parts) {
    const play = button("", act.play, { class: "main" });
    const step = button("Next hit", act.step);
    const back = button("Pull back", act.back);
    const slow = button("Slow motion", act.slow, {
      title: "through each hit from the inside; a star marks a contact that is pressed",
    });
    const more = parts.has("share")
      ? [
          button("Guess first", act.guessing, { title: "in each scene cover what comes out until the balls have moved" }),
          button("Sound", act.sound, { title: "a click at each hit, as loud as it is hard" }),
        ]
      : [];
    function show({ again, clock, guessing, loud }) {
      const words = clock.playing ? "Pause" : clock.time > 0 ? "Go on" : "Let go";
      if (play.textContent !== words) play.textContent = words;
      const name = again ? "Guess again" : "Pull back";
      if (back.textContent !== name) back.textContent = name;
      // It keeps the focus of who has pressed it.
      back.setAttribute("aria-disabled", clock.time <= 0 && !clock.playing && !again);
      slow.setAttribute("aria-pressed", clock.slow);
      [guessing === "always", Boolean(loud)].forEach((on, k) => more[k]?.setAttribute("aria-pressed", on));
    }
    return { node: make("div", { class: "run" }, play, step, back, slow, ...more), show };
  }

  // --- settings -----------------------------------------------------------------------------------

  // What the sliders change: all balls, or one of them with what lies at it.
  function concerned(setting, scope) {
    const balls = all(setting.masses);
    if (scope === "all")
      return { balls, contacts: all(setting.restitution), inner: all(setting.forward) };
    const ball = +scope;
    return {
      balls: [ball],
      contacts: ball + 1 < balls.length ? [ball] : [],
      inner: ball > 0 && ball + 1 < balls.length ? [ball - 1] : [],
    };
  }

  const RATIOS = {
    ratio: { words: "ratio", directions: ["forward", "backward"] },
    forward: { words: "ratio, pushed from the left", directions: ["forward"] },
    backward: { words: "ratio, pushed from the right", directions: ["backward"] },
  };

  function settingSliders(act, most) {
    const [lightest, heaviest] = LIMITS.masses;
    const ratio = ({ words, directions }) =>
      slider({ words, low: 0, high: most, step: 0.01, input: (value) => act.ratio(value, directions) });
    const [slowest, fastest] = LIMITS.speeds;
    return {
      speed: slider({
        words: "comes in with",
        called: "speed",
        low: slowest,
        high: fastest,
        step: 0.05,
        unit: "m/s",
        input: act.speed,
      }),
      mass: slider({
        words: "mass",
        low: lightest,
        high: heaviest,
        step: 0.02,
        logarithmic: true,
        unit: "kg",
        input: act.mass,
      }),
      restitution: slider({
        words: "restitution",
        low: 0,
        high: 1,
        step: 0.01,
        input: act.restitution,
      }),
      ratio: ratio(RATIOS.ratio),
      forward: ratio(RATIOS.forward),
      backward: ratio(RATIOS.backward),
      gap: slider({ words: "gaps", low: 0, high: 100, step: 0.1, unit: "µm", input: act.gap }),
      stiffness: slider({
        words: "stiffness quotient",
        low: 0.01,
        high: 1000,
        step: 0.01,
        logarithmic: true,
        input: act.stiffness,
      }),
    };
  }

  function settingsPanel(act, parts) {
    const [fewest, most] = LIMITS.balls;
    const count = choice({
      words: "number of balls",
      choose: (value) => act.count(+value),
      options: Array.from({ length: most - fewest + 1 }, (_, k) => ({
        value: String(fewest + k),
        text: String(fewest + k),
      })),
    });
    const scope = choice({ words: "sliders for", options: [], choose: act.scope });
    const letters = [NONE, ...Object.keys(explorer.data.masses)];
    const material = choice({
      words: "material",
      choose: act.letter,
      options: letters.map((value) => ({
        value,
        text: value === NONE ? "any" : value,
        title:
          value === NONE
            ? "masses, restitutions and ratios as set below"
            : `the paper's ball ${value}, ${1000 * explorer.data.masses[value]} g`,
      })),
    });
    const law = choice({
      words: "law",
      choose: act.law,
      options: [
        { value: "rule", text: "by ratio", title: "the rule of this book, by restitution and ratios" },
        { value: "spheres", text: "spheres", title: "of steel, which push by Hertz's law" },
        ...(parts.has("scenes") ? [{ value: "springs", text: "springs", title: "linear ones" }] : []),
      ],
    });
    const sliders = settingSliders(act, parts.has("half") ? 0.5 : 1); // the largest ratio
    const wanted = { count, scope, law, ...sliders };
    const has = (name) => parts.has({ forward: "ratio", backward: "ratio", gap: "law" }[name] ?? name);
    const { restitution, ratio, forward, backward, gap, stiffness } = sliders;
    for (const { node } of [law, restitution, ratio, forward, backward, gap, stiffness])
      node.classList.add("near"); // on a phone below the buttons
    const nodes = Object.keys(wanted)
      .filter(has)
      .map((name) => wanted[name].node);
    // Where there is much, the rarer things are folded.
    const rarer = parts.has("beside") && make("details", {}, make("summary", {}, "More: the paper's balls, a second cradle"), material.node);
    let offered = 0;
    function show({ setting, scope: chosen }) {
      const { balls, contacts, inner } = concerned(setting, chosen);
      const size = setting.masses.length;
      if (offered !== size) {
        // A ball is offered if it has something to set: without masses, one with two neighbours.
        const some = all(setting.masses).filter(
          (ball) => parts.has("mass") || concerned(setting, ball).inner.length > 0,
        );
        const each = some.map((ball) => ({
          value: String(ball),
          text: `${ball + 1}`,
          title: `ball ${ball + 1}`,
          colour: explorer.colour(ball),
        }));
        scope.offer([{ value: "all", text: "all" }, ...each]);
        offered = size;
      }
      count.show(String(size));
      scope.show(chosen);
      const worn = new Set(balls.map((ball) => setting.letters[ball]));
      material.show(worn.size === 1 ? [...worn][0] : null);
      const one = chosen !== "all";
      const chosenLaw = explorer.law(setting);
      law.show(chosenLaw);
      const bounded = explorer.boundedRatios(setting);
      const ratios = (row) => (one && chosenLaw === "rule" ? inner.map((k) => row[k]) : []);
      const both = inner.flatMap((k) => [setting.forward[k], setting.backward[k]]);
      const rows = {
        speed: one ? [setting.speeds[balls[0]]] : [],
        mass: balls.map((ball) => setting.masses[ball]),
        restitution: chosenLaw === "springs" ? [] : contacts.map((c) => setting.restitution[c]),
        ratio: one || chosenLaw !== "rule" ? [] : both,
        forward: ratios(setting.forward),
        backward: ratios(setting.backward),
        gap: chosenLaw === "spheres" ? [setting.gap] : [],
        stiffness: chosenLaw === "springs" ? [setting.stiffness] : [],
      };
      for (const [name, values] of Object.entries(rows)) sliders[name].show(values, setting);
      const restitution = chosenLaw === "spheres" ? "restitution at 1 m/s" : "restitution";
      const pair = one && contacts.length ? `, balls ${contacts[0] + 1} and ${contacts[0] + 2}` : "";
      sliders.restitution.rename(restitution + pair);
      // A ratio above its bound looks so. (Where two balls push one, more than the bound may count.)
      for (const [name, { words, directions }] of Object.entries(RATIOS)) {
        const over = directions.flatMap((way) =>
          inner.filter((k) => setting[way][k] - bounded[way][k] > 1e-9).map((k) => bounded[way][k]),
        );
        const bounds = new Set([Math.min(...over), Math.max(...over)].map((bound) => +bound.toFixed(3)));
        sliders[name].rename(words + (over.length ? ` (bound ${[...bounds].join(" to ")})` : ""));
        sliders[name].node.classList.toggle("over", over.length > 0);
      }
    }
    return { node: make("div", { class: "settings" }, ...nodes, rarer || ""), rarer, show };
  }

  // --- the outcome of a hit -----------------------------------------------------------------------

  // A heading one step below the one that an explorer stands under.
  function headingBelow(host) {
    const before = [...document.querySelectorAll("h1, h2, h3, h4")].filter(
      (node) => node.compareDocumentPosition(host) & Node.DOCUMENT_POSITION_FOLLOWING,
    );
    return `h${+(before.pop()?.tagName[1] ?? 1) + 1}`;
  }

  // `other`: the bars of the cradle at its side.
  function outcomePanel(host, act, other) {
    const level = headingBelow(host);
    const title = make(level, {});
    const [bars, momentum, energy] = [1, 2, 3].map(() => make("div", { class: "plot" }));
    const handles = panels.handles(act);
    const told = make("p", { class: "note guessed" });
    const next = make("p", { class: "next" }, host.dataset.next ?? ""); // a step to take after the first hit
    const inAll = make("small", {});
    const named = (plot, ...words) => make("div", { class: "named" }, make("span", {}, ...words), plot);
    const balance = make("div", { class: "balance" }, named(momentum, "momentum"), named(energy, "energy ", inAll));
    const node = make(
      "div",
      { class: "outcome" },
      title,
      make("div", { class: "drawn" }, bars, handles.node),
      balance,
      told,
      next,
      other ?? "",
    );
    function show(seen, box) {
      // Who chooses an answer draws no bars: until then all is as before the hit.
      const asked = seen.covered && "answers" in host.dataset;
      const state = asked ? { ...seen, covered: false, guess: null, now: seen.hit.before } : seen;
      const { setting, hit, number, record, now, part, guess, covered } = state;
      const when = asked ? "Before" : part < 1 ? "During" : "After";
      title.textContent = covered ? "Your guess (m/s)" : `${when} ${explorer.hitName(number)} (m/s)`;
      const ghost = guess?.open && guess.touched && number === 0 ? { guess: guess.values } : {};
      const drawn = covered ? { span: explorer.guessReach(setting).span, gap: 1.1 } : ghost;
      // The numbers of a guess stand where the outlines of the velocities before would be.
      const before = covered ? hit.before.map(() => 0) : hit.before;
      balance.hidden = !now;
      bars.innerHTML = now ? explorer.bars(box(bars), setting, before, now, drawn) : "";
      momentum.innerHTML = now ? explorer.momentum(box(momentum), setting, hit.before, now) : "";
      const inside = !covered && record && part < 1;
      const held = inside ? explorer.stored(setting, record, part) : 0;
      energy.innerHTML = now ? explorer.energy(box(energy), setting, hit.before, now, held) : "";
      const kinetic = now && explorer.percent(explorer.kept(setting.masses, hit.before, now));
      inAll.textContent = now ? `${inside ? "moves" : "total"} ${kinetic}` : "";
      handles.show(state, box(bars));
      told.textContent = guess && number === 0 ? explorer.guessInWords(state) : "";
      const same = seen.scene === host.dataset.scene && number === 0; // with gaps, say, it would be false
      next.hidden = !host.dataset.next || covered || !same;
    }
    return { node, show };
  }

  // --- a second cradle ------------------------------------------------------------------------------

  // At the side of the first one, with the same clock: another ratio, or a setting that was kept.
  function besidePanel(act) {
    const options = [["", "nothing"], ["0", "ratio 0"], ["0.15", "ratio 0.15"], ["spheres", "spheres that touch"], ["kept", "a copy of this setting"]]; // prettier-ignore
    const chosen = choice({
      words: "second cradle",
      choose: act.beside,
      options: options.map(([value, text]) => ({ value, text })),
    });
    chosen.node.classList.add("beside");
    const place = make("div", { class: "cradle other" });
    const plot = make("div", { class: "plot" });
    const name = make("p", { class: "note" });
    const bars = make("div", {}, name, plot);
    const idle = () => {};
    const stage = new explorer.Stage(place, { giveUp: idle });
    stage.svg.setAttribute("aria-label", "the other cradle");
    function show({ other, number, beside, covered }, box, stageBox) {
      chosen.show(typeof beside === "object" ? "kept" : beside);
      place.hidden = !other;
      bars.hidden = !other || covered;
      if (!other) return;
      const how = { object: "as it was kept" }[typeof beside] ?? { spheres: "spheres that touch" }[beside];
      name.textContent = `The cradle at its side, ${how ?? `ratio ${beside}`}:`;
      const { setting } = other;
      stage.lay(setting, stageBox(place));
      stage.balls.forEach(({ group }) => group.removeAttribute("tabindex"));
      const hit = other.hit(number);
      plot.innerHTML = hit.after ? explorer.bars(box(plot), setting, hit.before, hit.after) : "";
    }
    function move({ other, clock }, size) {
      if (!other) return;
      const { setting } = other;
      const positions = other.positions(Math.max(clock.time, 0)) ?? setting.speeds.map(() => 0);
      stage.size = size;
      stage.show(positions, { held: clock.time <= 0, speeds: setting.speeds });
    }
    return { node: chosen.node, place, bars, show, move };
  }

  // --- what the page says and gives away ------------------------------------------------------------

  function wordsPanel() {
    const seen = make("p", { class: "words", "aria-hidden": true });
    const heard = make("p", { class: "unseen", role: "status", "aria-live": "polite" });
    let later = 0;
    let next = ""; // what is heard, or soon will be
    // Screen readers hear it once the reader has paused, not at every step of a slider; of a swing
    // that goes on they hear the first hit.
    function show({ words, number, clock }) {
      if (seen.textContent !== words) seen.textContent = words;
      if (seen.textContent === next || (clock.playing && number > 0)) return;
      next = words;
      clearTimeout(later);
      later = setTimeout(() => (heard.textContent = words), 700);
    }
    return { node: make("div", { class: "said" }, seen, heard), show };
  }

  function sharePanel(act) {
    const code = make("code", {});
    const told = make("span", { class: "told", role: "status" });
    const copied = (what) => (done) => {
      told.textContent = done
        ? `${what} copied`
        : "The browser does not allow copying; select the text by hand.";
      setTimeout(() => (told.textContent = ""), 4000);
    };
    const node = make(
      "div",
      { class: "share" },
      button("Copy Python", () => act.copy(code.textContent).then(copied("Python"))),
      button("Copy link", () => act.copy(act.address()).then(copied("Link"))),
      told,
      make("details", {}, make("summary", {}, "The same in Python"), make("pre", {}, code)),
    );
    return { node, show: ({ setting }) => (code.textContent = explorer.python(setting)) };
  }

  Object.assign(panels, {
    besidePanel,
    concerned,
    outcomePanel,
    runPanel,
    scenesPanel,
    settingsPanel,
    sharePanel,
    wordsPanel,
  });
})(globalThis.cradleExplorer);
