// The live explorer. Data flow one way: what a reader does changes the state, and the next frame
// draws the state. Written by hand in SVG, without a library; the page says why.
//
//   explorer_setting.js   what is let go; the address; the same in Python
//   explorer_swing.js     the sequence of hits, answered by the project's own solver
//   explorer_words.js     a hit in words
//   explorer_plots.js     pictures of one hit       explorer_fields.js     of many hits
//   explorer_stage.js     the balls, to be pulled   explorer_controls.js   buttons and sliders
//   explorer_panels.js, explorer_pictures.js        the parts of this page
(function (explorer) {
  "use strict";
  const { Stage, Swing, controls, panels } = explorer;
  const ALL_PARTS = "scenes count scope material mass restitution ratio inside sweep map share";
  const SLOW = 0.25; // of the true speed
  const INSIDE = 3.5; // seconds that a hit takes in slow motion
  const REST = 0.5; // seconds before the balls are let go again
  const LONGEST_FRAME = 0.1; // s; a hidden page must not jump

  const less = () => matchMedia("(prefers-reduced-motion: reduce)").matches;

  class Explorer {
    constructor(host) {
      this.host = host;
      this.page = host.dataset.parts === undefined;
      this.parts = new Set((host.dataset.parts ?? ALL_PARTS).split(" "));
      this.clock = { time: 0, playing: this.page && !less(), slow: false, inside: null };
      this.view = { scene: "", scope: "all", picture: "inside", contact: "all", part: 1, number: 0, notice: "" };
      this.visible = true;
      this.build();
      const { scene } = host.dataset;
      this.take(scene);
      if (this.page) this.readAddress();
      this.watch();
      this.changed();
    }

    // --- the page's elements --------------------------------------------------------------------

    build() {
      const act = this.actions();
      const { make } = controls;
      this.panels = {
        scenes: this.parts.has("scenes") ? panels.scenesPanel(act) : null,
        run: panels.runPanel(act),
        words: panels.wordsPanel(),
        outcome: panels.outcomePanel(),
        settings: panels.settingsPanel(act, this.parts),
        pictures: panels.picturesPanel(act, this.parts),
        share: this.parts.has("share") ? panels.sharePanel(act) : null,
      };
      const node = (name) => this.panels[name]?.node ?? "";
      const stage = make("div", { class: "cradle" });
      const left = make("div", { class: "left" }, stage, node("run"), node("words"));
      const right = make("div", { class: "right" }, node("outcome"), node("pictures"));
      const more = this.page
        ? ""
        : make("p", { class: "more" }, make("a", { href: "explorer.html" }, "Open in the full explorer"));
      this.host.replaceChildren(node("scenes"), make("div", { class: "desk" }, left, node("settings"), right), node("share"), more);
      this.host.classList.add("live");
      this.host.setAttribute("role", "group");
      this.host.setAttribute("aria-label", "live cradle");
      this.stage = new Stage(stage, this.pulling());
      explorer.data.palette.forEach((colour, ball) => {
        // Black lines take the colour of the text, as in all figures of the book.
        const shown = colour === "#000000" ? "var(--pst-color-text-base, #000)" : colour;
        this.host.style.setProperty(`--ball-${ball}`, shown);
      });
    }

    watch() {
      const redraw = () => this.changed();
      new ResizeObserver(redraw).observe(this.host);
      new MutationObserver(redraw).observe(document.documentElement, { attributeFilter: ["data-theme"] });
      new IntersectionObserver(([entry]) => {
        this.visible = entry.isIntersecting;
        redraw();
      }).observe(this.host);
      document.addEventListener("fullscreenchange", redraw);
      document.addEventListener("keydown", (event) => this.key(event));
      if (this.page) window.addEventListener("hashchange", () => this.readAddress());
    }

    // --- what a reader can do ---------------------------------------------------------------------

    actions() {
      const on = (change) => (...values) => {
        change(...values);
        this.changed();
      };
      const concerned = () => panels.concerned(this.setting, this.view.scope);
      const { view, clock } = this;
      return {
        scene: on((key) => key && this.take(key)),
        walk: on((step) => this.walk(step)),
        fullScreen: () => this.fullScreen(),
        play: on(() => this.play()),
        step: on(() => this.step()),
        back: on(() => this.restart(false)),
        slow: on(() => Object.assign(clock, { slow: !clock.slow, inside: null })),
        count: on((count) => this.set(explorer.resized(this.setting, count))),
        scope: on((scope) => (view.scope = scope)),
        letter: on((letter) => this.set(explorer.lettered(this.setting, concerned().balls, letter))),
        mass: on((mass) => this.set(explorer.withMass(this.setting, concerned().balls, mass))),
        restitution: on((e) => this.set(explorer.withRestitution(this.setting, concerned().contacts, e))),
        ratio: on((ratio, directions, inner = concerned().inner) =>
          this.set(explorer.withRatio(this.setting, inner, ratio, directions))),
        masses: on((right, left) => this.set(explorer.withRatios(this.setting, right, left))),
        picture: on((picture) => (view.picture = picture)),
        contact: on((contact) => (view.contact = contact === "all" ? "all" : +contact)),
        part: on((part) => {
          view.part = part;
          clock.inside = null;
        }),
        address: () => `${location.href.split("#")[0]}#${explorer.toFragment(this.setting, view.picture)}`,
        copy: (text) => navigator.clipboard.writeText(text).then(() => true, () => false),
      };
    }

    pulling() {
      let before = null;
      return {
        grab: () => (before = { setting: this.setting, held: this.clock.time <= 0 }),
        pull: (ball, speed) => {
          // A ball taken out of a swing: all others hang at rest.
          const from = before.held ? before.setting : explorer.atRest(before.setting);
          const playing = this.clock.playing;
          this.set(explorer.pulled(from, ball, speed));
          this.dragging = Boolean(this.stage.drag);
          this.clock.playing = playing;
          this.clock.time = 0;
          this.changed();
        },
        letGo: () => {
          this.dragging = false;
          if (!less()) this.clock.playing = true;
          this.changed();
        },
      };
    }

    // --- changes of the state -----------------------------------------------------------------------

    set(setting) {
      this.setting = setting;
      this.swing = new Swing(setting);
      this.first = null;
      if (this.view.scope !== "all" && +this.view.scope >= setting.masses.length) this.view.scope = "all";
      if (this.view.contact !== "all" && this.view.contact >= setting.masses.length - 1) this.view.contact = "all";
      const same = explorer.data.scenes.find((scene) => explorer.equal(scene.setting, setting));
      this.view.scene = same ? same.key : "";
      if (same) this.lastScene = same.key;
      this.view.notice = "";
      this.restart(this.clock.playing);
    }

    take(key) {
      const scene = explorer.data.scenes.find((one) => one.key === key);
      this.view.picture = this.host.dataset.picture ?? scene.picture;
      this.view.scope = "all";
      this.view.contact = "all";
      this.set(scene.setting);
    }

    walk(step) {
      const { scenes } = explorer.data;
      const at = scenes.findIndex(({ key }) => key === this.lastScene) + step;
      this.take(scenes[Math.min(Math.max(at, 0), scenes.length - 1)].key);
    }

    // Hold the balls where they are pulled to; go on by oneself if asked.
    restart(playing) {
      Object.assign(this.clock, { time: playing ? -REST : 0, playing, inside: null });
      this.show(0);
    }

    // Make a hit the one that all pictures show.
    show(number) {
      Object.assign(this.view, { number, part: 1 });
      this.record = this.swing.record(number);
    }

    play() {
      if (!this.clock.playing && this.swing.positions(this.clock.time) === null) return;
      this.clock.playing = !this.clock.playing;
    }

    step() {
      const number = this.swing.latest(Math.max(this.clock.time, 0)) + 1;
      Object.assign(this.clock, { time: Swing.time(number), playing: false, inside: null });
      this.show(number);
    }

    // Let time pass. In slow motion the clock stands still during a hit, which takes no time.
    advance(seconds) {
      const { clock, view } = this;
      if (clock.inside !== null) {
        clock.inside += seconds / INSIDE;
        view.part = Math.min(clock.inside, 1);
        if (clock.inside >= 1) clock.inside = null;
        return;
      }
      const next = this.swing.latest(clock.time) + 1;
      clock.time += seconds * (clock.slow ? SLOW : 1);
      if (clock.time < Swing.time(next)) return;
      if (this.swing.hit(next).status !== "finished") {
        Object.assign(clock, { time: Swing.time(next), playing: false });
        this.show(next);
        this.changed();
      } else if (clock.slow && this.swing.hit(next).happened) {
        Object.assign(clock, { time: Swing.time(next), inside: 0 });
        this.show(next);
        view.part = 0;
        this.changed();
      }
    }

    // --- the address ----------------------------------------------------------------------------------

    readAddress() {
      const fragment = decodeURIComponent(location.hash.slice(1));
      if (!fragment.includes("=") || fragment === this.written) return;
      const scene = /^scene=(\w+)$/.exec(fragment)?.[1];
      if (scene && explorer.data.scenes.some(({ key }) => key === scene)) {
        this.take(scene);
      } else {
        const { setting, picture, error } = explorer.fromFragment(fragment);
        if (error) {
          this.view.notice = `The address asks for what cannot be: ${error}.`;
        } else {
          this.set(setting);
          if (["inside", "sweep", "map"].includes(picture)) this.view.picture = picture;
        }
      }
      this.changed();
    }

    writeAddress() {
      if (!this.page || this.view.notice) return;
      const fragment = explorer.toFragment(this.setting, this.view.picture);
      // The first setting of the page needs no fragment: the plain address gives it.
      if (fragment === this.written || (!this.written && !location.hash && this.view.scene === this.host.dataset.scene)) return;
      clearTimeout(this.writing);
      this.writing = setTimeout(() => {
        this.written = fragment;
        history.replaceState(null, "", `#${fragment}`);
      }, 200);
    }

    // --- full screen and keys -------------------------------------------------------------------------

    get full() {
      return document.fullscreenElement === this.host;
    }

    // Full screen, and wide: the style sheet puts all side by side then.
    get wall() {
      return this.full && matchMedia("(min-aspect-ratio: 4/3)").matches;
    }

    fullScreen() {
      if (document.fullscreenElement) document.exitFullscreen();
      else if (this.host.requestFullscreen) this.host.requestFullscreen();
    }

    key(event) {
      if (!this.full && !this.host.contains(event.target)) return;
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.target.closest?.("input, select, textarea, summary, .ball, .point")) return;
      const act = {
        ArrowRight: () => this.walk(1), PageDown: () => this.walk(1),
        ArrowLeft: () => this.walk(-1), PageUp: () => this.walk(-1),
        " ": () => this.play(), ".": () => this.step(),
      }[event.key];
      const pages = event.key.startsWith("Page");
      if (!act || (pages && !this.full) || !this.panels.scenes) return;
      if (event.key === " " && event.target.closest?.("button")) return;
      event.preventDefault();
      act();
      this.changed();
    }

    // --- drawing --------------------------------------------------------------------------------------

    changed() {
      this.stale = true;
      this.wake();
    }

    wake() {
      if (this.frame) return;
      this.frame = requestAnimationFrame((now) => this.tick(now));
    }

    tick(now) {
      this.frame = 0;
      const seconds = Math.min((now - (this.last ?? now)) / 1000, LONGEST_FRAME);
      this.last = now;
      const running = this.clock.playing && this.visible && !this.dragging;
      if (running) this.advance(seconds);
      if (this.stale) this.draw();
      this.move();
      const working = this.visible && this.panels.pictures?.resume(this.view, (host) => this.box(host));
      if (running || working || this.stale) this.wake();
      else this.last = undefined;
    }

    box(host, under = 5) {
      const em = parseFloat(getComputedStyle(host).fontSize);
      const width = host.clientWidth;
      // On the wall a plot takes what is left of the height; below it, its slider and notes.
      const wall = Math.max(this.below(host) - under * em, 11 * em);
      return { width, height: this.wall ? wall : Math.min(20 * em, 0.62 * width + 4 * em), em };
    }

      // The cradle's box; on the wall, what the rest of its column leaves.
    stageBox(host) {
      const { width, em } = this.box(host);
      const others = this.panels.run.node.offsetHeight + this.panels.words.node.offsetHeight;
      const wall = Math.max(this.below(host) - others - 2 * em, 12 * em);
      return { width, em, height: this.wall ? wall : Math.min((this.page ? 24 : 15) * em, 0.72 * width) };
    }

    // On the wall: the height from the top of an element down to the settings.
    below(host) {
      const top = host.getBoundingClientRect().top - this.host.getBoundingClientRect().top;
      return innerHeight - top - this.panels.settings.node.offsetHeight;
    }

    state() {
      const { setting, clock, view, swing, record } = this;
      const hit = swing.hit(view.number);
      this.first ??= swing.hit(0);
      const firstAfter = this.first.status === "finished" ? this.first.after : null;
      const now = hit.status !== "finished" ? null : record ? explorer.during(record, view.part).velocities : hit.after;
      const words = view.notice || explorer.outcomeInWords(setting, hit, view.number, record);
      return { ...view, setting, clock, hit, record, firstAfter, now, words };
    }

    // Bring everything up to date with the state.
    draw() {
      this.stale = false;
      const box = (host, under) => this.box(host, under);
      const state = this.state();
      const host = this.stage.svg.parentElement;
      for (const panel of Object.values(this.panels)) panel?.show(state, box);
      this.stage.lay(this.setting, this.stageBox(host));
      const link = this.host.querySelector(".more a");
      if (link) link.href = `explorer.html#${explorer.toFragment(this.setting, this.view.picture)}`;
      this.writeAddress();
    }

    // Move what moves between two changes: balls, and what travels through a hit.
    move() {
      const { clock, swing, setting, view, record } = this;
      const positions = swing.positions(Math.max(clock.time, 0)) ?? setting.masses.map(() => 0);
      const first = swing.hit(0);
      this.stage.scale(Math.max(...setting.speeds.map(Math.abs), ...(first.status === "finished" ? first.after.map(Math.abs) : [])));
      const pressed = record && clock.time > 0 && view.part < 1 ? explorer.during(record, view.part).pressed : [];
      this.stage.show(positions, { held: clock.time <= 0, speeds: setting.speeds, pressed });
      if (clock.inside !== null) this.panels.outcome.show(this.state(), (host) => this.box(host));
      this.panels.pictures?.move(this.state(), (host) => this.box(host));
    }
  }

  function start() {
    explorer.live = [...document.querySelectorAll(".cradle-explorer")].map((host) => new Explorer(host));
  }

  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", start);
  else start();
})(globalThis.cradleExplorer);
