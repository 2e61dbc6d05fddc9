// The state of an explorer, and all that changes it: the setting, the clock, and what is looked at.
// It knows nothing of the page.
(function (explorer) {
  "use strict";
  const { Swing } = explorer;
  const SLOW = 0.25; // of the true speed
  const INSIDE = 3.5; // seconds that a hit takes in slow motion
  const REST = 0.5; // seconds before the balls are let go again
  const LOOK = 1.2; // seconds that the balls wait after a hit that was guessed
  const GUESS = "Guess, or just press Let go. The answer appears at the hit.";

  const { chapters, scenes } = explorer.data;
  const named = (key) => [...scenes, ...chapters].find((scene) => scene.key === key);

  class State {
    // `picture`: which one to show instead of that of a scene; `guessing`: whether the outcome is
    // covered until the reader has seen the balls move, this "once", "always", or not at all ("");
    // `again`: what it is once the balls are pulled back; `first`: whether the pictures stay at the
    // first hit, while the balls swing on, until the reader asks for the next one.
    constructor({ scene, picture, guessing = "", again = "", first = false }) {
      this.picture = picture;
      Object.assign(this, { guessing, again, first });
      this.clock = { time: 0, playing: false, slow: false, inside: null, guessed: false, wait: 0 };
      this.view = {
        scene: "", // a key, or none for a setting of the reader's own
        scope: "all", // or the number of a ball
        picture: "inside",
        contact: "all",
        number: 0, // of the hit that is shown
        part: 1, // how far that hit has come
        notice: "",
        guess: null, // {values, answer, touched, open}
        beside: "", // what swings below: a ratio, or a setting that was kept
      };
      this.take(scene);
    }

    // A setting has the name of the scene from which one came as long as it is that of the scene; no
    // other name comes up because a setting happens to be the same.
    set(setting, scene = this.lastScene) {
      this.setting = setting;
      this.own = true; // the reader's, unless it comes from the list of scenes
      this.swing = new Swing(setting);
      const { view } = this;
      const count = setting.masses.length;
      if (view.scope !== "all" && +view.scope >= count) view.scope = "all";
      if (view.contact !== "all" && view.contact >= count - 1) view.contact = "all";
      this.lastScene = scene;
      view.scene = scenes.some(({ key, setting: own }) => key === scene && explorer.equal(own, setting)) ? scene : "";
      view.notice = "";
      if (!this.guessing) view.guess = null;
      else if (!this.covered || view.guess.values.length !== count) this.cover();
      this.lay();
      this.restart(this.clock.playing);
    }

    // Pull balls, [ball, speed] each, from where all of them hang. What has come along with one ball
    // goes back with it, until the balls have moved.
    pull(pulls, from = this.origin(pulls[0][0])) {
      const start = { ...this.setting, speeds: from };
      this.set(pulls.reduce((setting, pull) => explorer.pulled(setting, ...pull), start));
      this.pulled = { ball: pulls.length === 1 ? pulls[0][0] : null, from, to: this.setting.speeds };
    }

    origin(ball) {
      const { speeds } = this.setting;
      return this.pulled?.ball === ball && this.pulled.to === speeds ? this.pulled.from : speeds;
    }

    // What swings below: the same setting with another ratio, or one that was kept.
    lay() {
      const { setting } = this;
      const { beside } = this.view;
      this.other = null;
      if (beside === "") return;
      const { all, withLaw, withRatio } = explorer;
      const spheres = beside === "spheres";
      const other = spheres
        ? { ...withLaw(setting, beside), gap: 0 }
        : withRatio(withLaw(setting, "rule"), all(setting.forward), +beside);
      this.other = new Swing(typeof beside === "object" ? beside : other);
    }

    beside(chosen) {
      this.view.beside = chosen === "kept" ? this.setting : chosen;
      this.lay();
    }

    // --- the reader's guess -----------------------------------------------------------------------

    guess(ball, value) {
      const { guess } = this.view;
      guess.values = guess.values.map((old, k) => (k === ball ? value : old));
      guess.touched = true;
    }

    answer(answer) {
      this.view.guess.answer = answer;
    }

    cover() {
      const values = this.setting.speeds.map(() => 0);
      this.view.guess = { values, answer: "", touched: false, open: false };
    }

    // Hold the balls again. Who has guessed may do so again, from the last guess.
    pullBack() {
      const { guess } = this.view;
      this.guessing ||= this.again;
      if (guess && this.guessing) guess.open = false;
      else if (this.guessing) this.cover();
      this.restart(false);
    }

    // The balls have moved; return whether the outcome was covered until now.
    open() {
      const { guess } = this.view;
      this.pulled = null;
      if (!guess || guess.open) return false;
      guess.open = true;
      if (this.guessing === "once") this.guessing = "";
      return true;
    }

    // Return what brings everything back to where it is now.
    snapshot() {
      const { setting } = this;
      const [clock, view] = [{ ...this.clock }, { ...this.view }];
      return () => {
        this.set(setting);
        Object.assign(this.clock, clock);
        Object.assign(this.view, view);
        this.show(view.number, view.part);
      };
    }

    take(key) {
      const scene = named(key);
      Object.assign(this.view, {
        picture: this.picture ?? scene.picture,
        scope: "all",
        contact: "all",
      });
      this.clock.playing = false; // a lecturer speaks first
      this.set(scene.setting, key);
      this.own = false;
    }

    // To the next scene or back, from the last one that was shown.
    walk(step) {
      const at = scenes.findIndex(({ key }) => key === this.lastScene) + step;
      this.take(scenes[Math.min(Math.max(at, 0), scenes.length - 1)].key);
    }

    // What an address asks for; what cannot be is said, and changes nothing.
    read(fragment) {
      const scene = /^scene=(\w+)$/.exec(fragment)?.[1];
      if (named(scene)) return this.take(scene);
      const { setting, picture, error } = explorer.fromFragment(fragment);
      if (error) {
        this.view.notice = `The address asks for what cannot be: ${error}.`;
        return undefined;
      }
      // The address of a scene that was left open, or sent, leads to it again.
      this.set(setting, scenes.find((one) => explorer.equal(one.setting, setting))?.key);
      if (["inside", "sweep", "map"].includes(picture)) this.view.picture = picture;
      return undefined;
    }

    fragment() {
      return explorer.toFragment(this.setting, this.view.picture);
    }

    // --- the clock --------------------------------------------------------------------------------

    // Hold the balls where they are pulled to; go on by oneself if asked.
    restart(playing) {
      Object.assign(this.clock, { time: playing ? -REST : 0, playing, inside: null });
      this.follow();
      this.show(0);
    }

    // Make a hit the one that all pictures show.
    show(number, part = 1) {
      Object.assign(this.view, { number, part });
      this.record = this.swing.record(number);
    }

    // Let the pictures follow all hits again.
    follow() {
      Object.assign(this.clock, { guessed: false, wait: 0 });
    }

    play() {
      const { clock } = this;
      if (!this.first) this.follow();
      clock.playing = !clock.playing && this.swing.positions(clock.time) !== null;
    }

    step() {
      const { clock, view } = this;
      // The one after that which is shown.
      const number = (clock.guessed ? view.number : this.swing.latest(Math.max(clock.time, 0))) + 1;
      Object.assign(clock, { time: Swing.time(number), playing: false, inside: null });
      this.follow();
      this.open();
      this.show(number);
    }

    // Slow motion, or no longer. Where the first hit is what counts, it is shown again.
    slow() {
      const { clock } = this;
      Object.assign(clock, { slow: !clock.slow, inside: null });
      if (this.first && clock.slow && !this.covered) this.restart(clock.playing);
    }

    // Let time pass; return whether more than positions has changed. In slow motion the clock
    // stands still during a hit, which takes no time. After a hit that was guessed the balls wait
    // a little; then they swing on, and the pictures stay, so that the guess can be compared.
    advance(seconds) {
      const { clock, view, swing } = this;
      if (clock.wait > 0) {
        clock.wait -= seconds;
        return false;
      }
      if (clock.inside !== null) {
        clock.inside += seconds / INSIDE;
        view.part = Math.min(clock.inside, 1);
        if (clock.inside < 1) return false;
        Object.assign(clock, { inside: null, wait: clock.guessed ? LOOK : 0 });
        return true;
      }
      const next = swing.latest(clock.time) + 1;
      clock.time += seconds * (clock.slow ? SLOW : 1);
      if (clock.time < Swing.time(next)) return false;
      const opened = this.open() || (this.first && next === 0);
      clock.guessed = opened || (clock.guessed && (this.first || !clock.slow));
      const { status, happened } = swing.hit(next);
      if (status !== "finished") {
        Object.assign(clock, { time: Swing.time(next), playing: false });
        this.show(next);
        return true;
      }
      if (!happened) return false;
      if (clock.slow && (opened || !clock.guessed)) Object.assign(clock, { time: Swing.time(next), inside: 0 });
      else if (opened) Object.assign(clock, { time: Swing.time(next), wait: LOOK });
      if (opened || !clock.guessed) this.show(next, clock.slow ? 0 : 1);
      return true;
    }

    // Whether time changes anything: some ball is, or will be, in motion.
    get moves() {
      return this.setting.speeds.some((speed) => speed !== 0);
    }

    // --- what is to be seen -----------------------------------------------------------------------

    get covered() {
      return this.view.guess?.open === false;
    }

    // Velocities of all balls at the part of the hit that is shown; null if it has no answer.
    now(hit) {
      if (this.covered) return this.view.guess.values;
      if (hit.status !== "finished") return null;
      return this.record ? explorer.during(this.record, this.view.part).velocities : hit.after;
    }

    scenery() {
      const { setting, clock, view, swing, record } = this;
      const hit = swing.hit(view.number);
      const firstAfter = swing.hit(0).after;
      const { covered, guessing, other, own } = this;
      const again = !covered && Boolean(this.again || guessing);
      const words =
        view.notice ||
        (covered ? GUESS : explorer.outcomeInWords(setting, hit, view.number, record));
      const seen = { again, guessing, covered, other, own, words, now: this.now(hit) };
      return { ...view, setting, clock, hit, record, firstAfter, ...seen };
    }
  }

  explorer.State = State;
})(globalThis.cradleExplorer);
