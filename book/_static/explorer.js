// The live explorer. Data flow one way: what a reader does changes the state, and the next frame
// draws the state. Written by hand, without a library; the page says why.
//
//   explorer_setting.js   what is let go; the address; the same in Python
//   explorer_swing.js     the sequence of hits, answered by the project's own solver
//   explorer_words.js     a hit in words
//   explorer_plots.js     pictures of one hit       explorer_fields.js     of many hits
//   explorer_stage.js     the balls, to be pulled   explorer_controls.js   buttons and sliders
//   explorer_panels.js, explorer_pictures.js, explorer_guess.js, explorer_tasks.js
//                         the parts of an explorer
//   explorer_state.js     the state and its changes
(function (explorer) {
  "use strict";
  const { Stage, State, controls, panels } = explorer;
  const ALL_PARTS =
    "scenes tasks count scope material law stiffness speed mass restitution ratio beside inside sweep map share";
  const LONGEST_FRAME = 0.1; // s; a page that was hidden must not jump

  const less = () => matchMedia("(prefers-reduced-motion: reduce)").matches;

  // Whether an element has a use of its own for a key.
  const uses = (node, key) =>
    node.matches("input, select, summary") ||
    (key === " " && node.matches("button")) ||
    (key.startsWith("Arrow") && node.matches(".ball, .point"));

  // A click, the louder the harder the balls meet; `strength` from 0 to 1.
  function click(audio, strength) {
    const [tone, volume] = [audio.createOscillator(), audio.createGain()];
    tone.frequency.value = 2400;
    volume.gain.setValueAtTime(0.5 * strength, audio.currentTime);
    volume.gain.exponentialRampToValueAtTime(1e-4, audio.currentTime + 0.06);
    tone.connect(volume).connect(audio.destination);
    tone.start();
    tone.stop(audio.currentTime + 0.07);
  }

  class Explorer {
    // A host without `data-parts` has a page of its own: all parts, the address, the wall.
    constructor(host) {
      this.host = host;
      const { scene, parts, picture, guess, answers } = host.dataset;
      this.page = parts === undefined;
      this.bare = this.page && !location.hash; // nobody was sent to a scene
      this.parts = new Set((parts ?? ALL_PARTS).split(" "));
      // Who follows a link to a setting wants to see it.
      const linked = this.page && location.hash.includes("=");
      const guessing = guess === undefined || linked ? "" : guess || "once";
      this.lecture = Boolean(guessing); // in full screen each scene is guessed, unless one has said
      // An answer of a few is known once it is told; speeds can be guessed again, on a page of its
      // own by a button.
      const again = answers || this.page ? "" : guessing;
      // In a chapter the text beside it speaks of the first hit.
      this.state = new State({ scene, picture, guessing, again, first: !this.page });
      this.visible = true;
      this.pointed = false; // whether a pointer has chosen what has the focus
      this.box = this.box.bind(this);
      this.stageBox = this.stageBox.bind(this);
      this.build();
      if (this.page) this.readAddress();
      this.watch();
      this.stale = true;
      this.tick(performance.now()); // at once: a frame could be painted before the next one
    }

    // --- the page's elements --------------------------------------------------------------------

    build() {
      const act = this.actions();
      const { make } = controls;
      const beside = this.parts.has("beside") ? panels.besidePanel(act) : null;
      this.panels = {
        scenes: ["scenes", "chains"].some((name) => this.parts.has(name))
          ? panels.scenesPanel(act, this.parts, this.page && document.querySelector(".first-guess")?.textContent)
          : null,
        question: panels.questionPanel(act, this.host.dataset),
        run: panels.runPanel(act, this.parts),
        words: panels.wordsPanel(),
        outcome: panels.outcomePanel(this.host, act, beside?.bars),
        beside,
        tasks: this.parts.has("tasks") ? panels.tasksPanel() : null,
        settings: panels.settingsPanel(act, this.parts),
        pictures: panels.picturesPanel(act, this.parts),
        share: this.parts.has("share") ? panels.sharePanel(act) : null,
      };
      const node = (name) => this.panels[name]?.node ?? "";
      const cradle = make("div", { class: "cradle" });
      const stages = make("div", { class: "stages" }, cradle, beside?.place ?? "", this.panels.tasks?.told ?? "");
      // What is to be guessed comes before the button that shows it.
      const guessed = "guess" in this.host.dataset && !this.page;
      const outcome = (here) => (here ? node("outcome") : "");
      const left = make("div", { class: "left" }, stages, outcome(guessed), node("run"), node("words"));
      if (beside) this.panels.settings.rarer.append(beside.node);
      const right = make("div", { class: "right" }, outcome(!guessed), node("pictures"));
      this.link = make("a", { href: "explorer.html" }, "Open in the live cradle");
      this.host.replaceChildren(
        node("question"),
        node("scenes"),
        make("div", { class: "desk" }, left, node("settings"), right, node("tasks")),
        this.panels.question?.after ?? "",
        node("share"),
        this.page ? "" : make("p", { class: "more" }, this.link),
      );
      this.host.classList.add("live");
      this.host.setAttribute("role", "group");
      this.host.setAttribute("aria-label", "live cradle");
      if (this.page) this.host.tabIndex = -1; // a click on it gives it the keys
      this.stage = new Stage(cradle, this.pulling());
    }

    // Each ball has a colour of its own; with `data-kinds` each kind of ball, as in a figure beside it.
    paint({ letters }) {
      explorer.data.palette.forEach((own, ball, palette) => {
        const kind = "kinds" in this.host.dataset ? "ABCD".indexOf(letters[ball] ?? "-") : -1;
        const colour = palette[kind] ?? own;
        // Black lines take the colour of the text, as in all figures of the book, and pale ones a
        // part of it: a mark on white needs a luminance of at most 0.3.
        const pale = explorer.luminance(colour) > 0.3;
        const shown = pale ? `color-mix(in srgb, ${colour} 80%, var(--ink))` : colour;
        this.host.style.setProperty(`--ball-${ball}`, colour === "#000000" ? "var(--ink)" : shown);
      });
    }

    watch() {
      const redraw = () => this.changed();
      // Only the wall asks for the height, which what is drawn below the cradle changes too.
      new ResizeObserver(([{ contentRect: { width, height } }]) => {
        const size = `${width} ${this.full ? height : ""}`;
        if (size !== this.size) redraw();
        this.size = size;
      }).observe(this.host);
      const theme = { attributeFilter: ["data-theme"] };
      // At once: a page that is printed turns light, and waits for no frame.
      const recolour = () => this.draw(this.state.scenery());
      new MutationObserver(recolour).observe(document.documentElement, theme);
      new IntersectionObserver(([entry]) => {
        this.visible = entry.isIntersecting;
        this.wake();
      }).observe(this.host);
      document.addEventListener("fullscreenchange", () => {
        if (this.full && this.lecture) this.state.guessing = "always";
        redraw();
      });
      window.addEventListener("beforeprint", () => this.print());
      this.host.addEventListener("pointerdown", () => (this.pointed = true));
      document.addEventListener("keydown", (event) => this.key(event), true);
      if (this.page) window.addEventListener("hashchange", () => this.readAddress());
    }

    // --- what a reader can do ---------------------------------------------------------------------

    actions() {
      const { state } = this;
      const { view, clock } = state;
      const on =
        (change) =>
        (...values) => {
          change(...values);
          this.changed();
        };
      const concerned = () => panels.concerned(state.setting, view.scope);
      const setting = (change) => on((...values) => state.set(change(state.setting, ...values)));
      return {
        scene: on((key) => key && state.take(key)),
        walk: on((step) => state.walk(step)),
        fullScreen: () => this.fullScreen(),
        play: on(() => state.play()),
        step: on(() => state.step()),
        back: on(() => state.pullBack()),
        slow: on(() => state.slow()),
        guess: on((ball, value) => state.guess(ball, value)),
        answer: on((answer) => state.answer(answer)),
        guessing: on(() => {
          state.guessing = state.guessing === "always" ? "" : "always";
          this.lecture = false;
          state.set(state.setting);
          if (state.guessing) state.restart(false);
        }),
        sound: on(() => {
          this.audio?.close();
          this.audio = this.audio ? null : new AudioContext();
        }),
        beside: on((chosen) => state.beside(chosen)),
        speed: on((speed) => state.pull([[concerned().balls[0], speed]])),
        scope: on((scope) => (view.scope = scope)),
        picture: on((picture) => (view.picture = picture)),
        contact: on((contact) => (view.contact = contact === "all" ? "all" : +contact)),
        part: on((part) => {
          view.part = part;
          clock.inside = null;
        }),
        count: setting(explorer.resized),
        letter: setting((old, letter) => explorer.lettered(old, concerned().balls, letter)),
        mass: setting((old, mass) => explorer.withMass(old, concerned().balls, mass)),
        restitution: setting((old, e) => explorer.withRestitution(old, concerned().contacts, e)),
        law: setting(explorer.withLaw),
        gap: setting((old, gap) => ({ ...old, gap })),
        stiffness: setting((old, stiffness) => ({ ...old, stiffness })),
        ratio: setting((old, ratio, directions, inner = concerned().inner) =>
          explorer.withRatio(old, inner, ratio, directions),
        ),
        masses: setting(explorer.withRatios),
        moveMasses: setting(explorer.movedRatios),
        snapshot: () => state.snapshot(),
        restore: on((restore) => restore()),
        address: () => `${location.href.split("#")[0]}#${state.fragment()}`,
        // A page that came over plain HTTP has no clipboard.
        copy: async (text) => {
          try {
            await navigator.clipboard.writeText(text);
            return true;
          } catch {
            return false;
          }
        },
      };
    }

    // Balls are pulled from where they hang; a ball taken out of a swing finds all others at rest.
    // Each finger pulls a ball of its own; where they disagree, the one that moved last is followed.
    pulling() {
      const { state } = this;
      const held = new Map(); // the balls in somebody's hand; their pull, once there is one
      let speeds = []; // of all balls, without those pulls
      let restore = null;
      return {
        grab: (ball) => {
          if (!held.size) {
            const { setting, clock } = state;
            speeds = clock.time <= 0 ? state.origin(ball) : explorer.atRest(setting).speeds;
            restore = state.snapshot();
          }
          held.set(ball, null);
        },
        speed: (ball) => state.setting.speeds[ball],
        pull: (ball, speed) => {
          if (speeds.length !== state.setting.speeds.length) return; // there are other balls now
          held.delete(ball);
          held.set(ball, speed);
          state.pull([...held].filter((pull) => pull[1] !== null), speeds);
          state.clock.time = 0;
          this.changed();
        },
        letGo: (ball, moved) => {
          held.delete(ball);
          ({ speeds } = state.setting);
          if (moved && !held.size && !less() && !state.covered) state.clock.playing = true;
          this.changed();
        },
        giveUp: (undo = false) => {
          held.clear();
          if (undo) restore();
          this.changed();
        },
      };
    }

    // The keys of a lecture. In full screen what a pointer has pressed leaves all of them to the
    // lecture; what was reached with Tab, and what is found on the page, keeps its own.
    key(event) {
      const { key, target } = event;
      if (key === "Tab") this.pointed = false;
      const { state } = this;
      const act = {
        ArrowRight: () => state.walk(1),
        PageDown: () => state.walk(1),
        ArrowLeft: () => state.walk(-1),
        PageUp: () => state.walk(-1),
        " ": () => state.play(),
        ".": () => state.step(),
      }[key];
      if (!act || !this.page) return;
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (!this.full && !this.host.contains(target)) return;
      if (!this.full && key.startsWith("Page")) return; // they scroll
      const freed = this.full && this.pointed && !target.matches("input[type=text]");
      if (!freed && uses(target, key)) return;
      if (freed) target.blur();
      event.preventDefault();
      event.stopPropagation();
      act();
      this.changed();
    }

    // --- the address and the screen -----------------------------------------------------------------

    readAddress() {
      const fragment = explorer.plain(location.hash.slice(1));
      // Others are headings of the page.
      if (!fragment.includes("=") || fragment === this.written) return;
      this.state.read(fragment);
      this.changed();
    }

    writeAddress() {
      const { view } = this.state;
      const fragment = this.state.fragment();
      if (!this.page || view.notice || fragment === this.written) return;
      // The plain address, or that of a heading, gives the first scene.
      const asked = explorer.plain(location.hash).includes("=");
      if (!this.written && !asked && view.scene === this.host.dataset.scene) return;
      clearTimeout(this.writing);
      const before = location.hash;
      this.writing = setTimeout(() => {
        // A link has been followed, of which the page is just about to hear.
        if (location.hash !== before) return;
        this.written = fragment;
        history.replaceState(null, "", `#${fragment}`);
      }, 200);
    }

    get full() {
      return document.fullscreenElement === this.host;
    }

    // Full screen, and wide: the style sheet puts all side by side then.
    get wall() {
      return this.full && matchMedia("(min-aspect-ratio: 4/3)").matches;
    }

    fullScreen() {
      if (this.pointed) this.host.focus({ preventScroll: true });
      if (this.full) document.exitFullscreen();
      else this.host.requestFullscreen?.();
    }

    // --- drawing --------------------------------------------------------------------------------------

    changed() {
      this.stale = true;
      this.wake();
    }

    wake() {
      this.frame ||= requestAnimationFrame((now) => this.tick(now));
    }

    tick(now) {
      this.frame = 0;
      const seconds = Math.min((now - (this.last ?? now)) / 1000, LONGEST_FRAME);
      this.last = now;
      const { clock, moves } = this.state;
      const running = clock.playing && moves && this.visible && !this.stage.drags.size;
      const begins = clock.inside === null; // in slow motion a hit ends later
      if (running && this.state.advance(seconds)) {
        this.stale = true;
        if (begins) this.sound();
      }
      const scenery = this.state.scenery();
      if (this.stale) this.draw(scenery);
      this.move(scenery);
      const working = this.visible && this.resume(scenery);
      if (running || working) this.wake();
      else this.last = undefined;
    }

    // After a hit: as loud as the balls meet fast.
    sound() {
      const { clock, swing } = this.state;
      const { before, happened } = swing.hit(swing.latest(clock.time));
      if (!this.audio || !happened) return;
      click(this.audio, Math.min(1, Math.max(...before.slice(1).map((v, c) => before[c] - v))));
    }

    // Bring everything up to date with the state.
    draw(scenery) {
      this.stale = false;
      const { pictures } = this.panels;
      if (pictures) pictures.node.hidden = scenery.covered;
      this.host.classList.toggle("covered", scenery.covered);
      this.paint(scenery.setting);
      this.calm(this.bare && scenery.covered && scenery.guessing === "once");
      for (const panel of Object.values(this.panels))
        if (!panel?.node.hidden) panel?.show({ ...scenery, loud: this.audio }, this.box, this.stageBox);
      this.stage.lay(scenery.setting, this.stageBox());
      this.link.href = `explorer.html#${this.state.fragment()}`;
      this.writeAddress();
    }

    // Until the first hit of its own page a reader sees little more than the cradle and the guess.
    // When all else comes, the cradle stays where it is on the screen.
    calm(on) {
      const { classList } = this.host;
      if (classList.contains("calm") === on) return;
      const top = () => this.stage.svg.getBoundingClientRect().top;
      const before = top();
      classList.toggle("calm", on);
      if (!on && !this.full) scrollBy({ top: top() - before, behavior: "instant" });
    }

    resume(scenery) {
      return !scenery.covered && this.panels.pictures?.resume(scenery, this.box);
    }

    // What is printed is finished, seen or not.
    print() {
      const scenery = this.state.scenery();
      this.draw(scenery);
      this.move(scenery);
      while (this.resume(scenery));
    }

    // Move what moves between two changes: balls, and what travels through a hit.
    move(scenery) {
      const { clock, setting, record, firstAfter, part } = scenery;
      const { swing } = this.state;
      const positions = swing.positions(Math.max(clock.time, 0)) ?? setting.masses.map(() => 0);
      this.stage.scale(Math.max(...[...setting.speeds, ...(firstAfter ?? [])].map(Math.abs)));
      const inside = record && clock.time > 0 && part < 1;
      const pressed = inside ? explorer.during(record, part).pressed : [];
      this.stage.show(positions, { held: clock.time <= 0, speeds: setting.speeds, pressed });
      if (clock.inside !== null) this.panels.outcome.show(scenery, this.box);
      this.panels.beside?.move(scenery, this.stage.size);
      if (!scenery.covered) this.panels.pictures?.move(scenery, this.box);
    }

    // The size of a plot. On the wall it takes what is left of the height; `under`: its slider and
    // notes, em.
    box(host, under = 5) {
      const em = parseFloat(getComputedStyle(host).fontSize);
      const width = host.clientWidth;
      const wall = Math.max(this.below(host) - under * em, 11 * em);
      // A bar has room for a finger, as far as all of them are seen with the cradle.
      const room = matchMedia("(pointer: coarse)").matches ? 12.5 / this.state.setting.masses.length : 0;
      const row = Math.min(Math.max(room, 1.75), 2.5) * em;
      return { width, height: this.wall ? wall : Math.min(20 * em, 0.62 * width + 4 * em), em, row };
    }

    // The cradle's box; on the wall, what the rest of its column leaves.
    stageBox(host = this.stage.svg.parentElement) {
      const { width, em } = this.box(host);
      const others = this.panels.run.node.offsetHeight + this.panels.words.node.offsetHeight;
      const wall = Math.max(this.below(host) - others - 2 * em, 12 * em);
      const most = (this.page ? 24 : 15) * em;
      // On a phone that lies on its side the button below is seen, too.
      const seen = Math.max(0.55 * innerHeight, 10 * em);
      return { width, em, height: this.wall ? wall : Math.min(most, 0.72 * width, seen) };
    }

    // On the wall: the height from the top of an element down to the settings.
    below(host) {
      const top = host.getBoundingClientRect().top - this.host.getBoundingClientRect().top;
      return innerHeight - top - this.panels.settings.node.offsetHeight;
    }
  }

  function start() {
    const hosts = document.querySelectorAll(".cradle-explorer");
    explorer.live = [...hosts].map((host) => new Explorer(host));
  }

  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", start);
  else start();
})(globalThis.cradleExplorer);
