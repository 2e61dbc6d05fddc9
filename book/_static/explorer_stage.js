// The cradle itself: balls on strings, which one can pull back with a pointer or with arrow keys.
(function (explorer) {
  "use strict";
  const { FREQUENCY, LENGTH, colour, fixed, px } = explorer;
  const SVG = "http://www.w3.org/2000/svg";
  // Angles up to which a swing is drawn in its true size, and beyond which it is cut off.
  const ROOM = 1.5 / FREQUENCY / LENGTH;
  const MOST = 1.25;
  // A pull is a whole number of these, m/s.
  const STEP = 0.05;
  // Fewer pixels than these are no drag: a finger is never quite still.
  const STILL = 3;

  // Nothing is drawn anew that is there already.
  function set(node, name, value) {
    if (node.getAttribute(name) !== String(value)) node.setAttribute(name, value);
  }

  function make(kind, attributes, parent) {
    const node = document.createElementNS(SVG, kind);
    for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
    if (parent) parent.append(node);
    return node;
  }

  class Stage {
    // `on`: {grab(ball), speed(ball), pull(ball, speed), letGo(ball, moved), giveUp()}; the stage
    // shows and asks, it decides nothing.
    constructor(host, on) {
      this.svg = make("svg", { class: "stage", role: "group", "aria-label": "the cradle" }, host);
      this.on = on;
      this.balls = [];
      this.drags = new Map(); // by pointer: each finger holds a ball of its own
      this.size = 1;
      this.svg.addEventListener("pointerdown", (event) => this.grab(event));
      this.svg.addEventListener("pointermove", (event) => this.move(event));
      this.svg.addEventListener("pointerup", (event) => this.release(event));
      this.svg.addEventListener("pointercancel", (event) => this.cancel(event));
      this.svg.addEventListener("keydown", (event) => this.key(event));
    }

    // Put everything in its place for a setting and the width of the box.
    lay(setting, box) {
      const { masses, letters, speeds } = setting;
      const { width, em } = box;
      this.em = em;
      const count = masses.length;
      if (this.balls.length !== count) this.build(count);
      const heaviest = Math.max(...masses);
      const relative = masses.map((m) => Math.cbrt(m / heaviest));
      const whole = relative.reduce((total, r) => total + 2 * r, 0);
      const unit = Math.min(2.2 * em, (0.5 * width) / whole);
      this.radii = relative.map((r) => Math.max(r * unit, 3));
      const row = this.radii.reduce((total, r) => total + 2 * r, 0);
      const reach = Math.sin(ROOM * LENGTH);
      const free = (width - row) / 2 - 0.4 * em;
      this.length = Math.min(free / reach, box.height - unit - 4.1 * em);
      this.top = 1.2 * em;
      const height = this.top + this.length + unit + 2.6 * em;
      let x = (width - row) / 2;
      this.pivots = this.radii.map((r) => (x += 2 * r) - r);
      this.svg.setAttribute("viewBox", `0 0 ${px(width)} ${px(height)}`);
      this.svg.setAttribute("height", px(height));
      const [first, last] = [this.pivots[0], this.pivots[count - 1]];
      const bar = `M${px(first - 2.2 * em)} ${px(this.top)}H${px(last + 2.2 * em)}`;
      this.bar.setAttribute("d", bar);
      let named = -Infinity; // where the last name below a small ball stands
      this.balls.forEach((ball, k) => {
        const r = this.radii[k];
        ball.disc.setAttribute("r", px(r));
        ball.reach.setAttribute("r", px(Math.max(r + 6, 1.4 * em)));
        ball.name.textContent = letters[k] === explorer.NONE ? k + 1 : letters[k];
        // Names of small balls that would touch are left out.
        const small = r <= 0.7 * em;
        const hidden = small && this.pivots[k] - named < em;
        ball.name.style.display = hidden ? "none" : "";
        if (small && !hidden) named = this.pivots[k];
        ball.name.setAttribute("y", small ? px(r + 1.1 * em) : px(0.36 * em));
        ball.string.setAttribute("x1", px(this.pivots[k]));
        ball.string.setAttribute("y1", px(this.top));
        ball.pull.setAttribute("y", px(r + (small ? 2.2 : 1.2) * em));
        ball.group.setAttribute("aria-valuenow", speeds[k]);
        const pull = speeds[k] === 0 ? "hangs at rest" : `comes in at ${fixed(speeds[k])} m/s`;
        ball.group.setAttribute("aria-valuetext", pull);
      });
      this.stars.forEach((star, c) => {
        const at = this.pivots[c] + this.radii[c];
        star.setAttribute(
          "transform",
          `translate(${px(at)} ${px(this.top + this.length)}) scale(${px(0.6 * em)})`,
        );
      });
    }

    build(count) {
      this.drags.clear(); // the balls that were held are gone
      this.on.giveUp();
      this.svg.replaceChildren();
      this.bar = make("path", { class: "beam" }, this.svg);
      const strings = make("g", {}, this.svg);
      this.balls = Array.from({ length: count }, (_, k) => {
        const [low, high] = explorer.LIMITS.speeds;
        const string = make("line", { class: "string" }, strings);
        const group = make(
          "g",
          {
            class: "ball",
            "data-ball": k,
            tabindex: 0,
            role: "slider",
            "aria-label": `pull of ball ${k + 1}`,
            "aria-valuemin": low,
            "aria-valuemax": high,
          },
          this.svg,
        );
        const reach = make("circle", { class: "reach" }, group);
        const disc = make("circle", { class: "disc", style: `--ball: ${colour(k)}` }, group);
        const name = make("text", { "text-anchor": "middle", class: "name" }, group);
        const pull = make("text", { "text-anchor": "middle", class: "pull" }, group);
        return { string, group, reach, disc, name, pull };
      });
      const points = Array.from({ length: 10 }, (_, k) => {
        const angle = (Math.PI * k) / 5;
        const r = k % 2 ? 0.45 : 1;
        return `${px(r * Math.sin(angle))},${px(-r * Math.cos(angle))}`;
      });
      this.stars = Array.from({ length: count - 1 }, () =>
        make("polygon", { class: "star", points: points.join(" ") }, this.svg),
      );
    }

    // Draw swings smaller if the fastest ball would leave the picture.
    scale(fastest) {
      if (!this.drags.size)
        this.size = Math.min(1, (ROOM * FREQUENCY * LENGTH) / Math.max(fastest, 1e-9));
      return this.size;
    }

    // Move the balls; `held` says that they wait to be let go; `pressed` marks contacts.
    show(positions, { held = false, speeds = [], pressed = [] } = {}) {
      // Balls that are pulled together have one number, below the one nearest to the others.
      const told = (k) => held && speeds[k] && speeds[k] !== speeds[k + Math.sign(speeds[k])];
      const near = (j, k) => Math.abs(this.pivots[j] - this.pivots[k]) < 5 * this.em;
      positions.forEach((s, k) => {
        const angle = Math.min(Math.max((this.size * s) / LENGTH, -MOST), MOST);
        const x = px(this.pivots[k] + this.length * Math.sin(angle));
        const y = px(this.top + this.length * Math.cos(angle));
        const { string, group, pull } = this.balls[k];
        set(string, "x2", x);
        set(string, "y2", y);
        set(group, "transform", `translate(${x} ${y})`);
        const crowded = [k - 1, k + 1].some((j) => told(j) && near(j, k));
        const number = `${fixed(Math.abs(speeds[k]))}${crowded ? "" : " m/s"}`;
        const words = told(k) ? number : "";
        if (pull.textContent !== words) pull.textContent = words;
        // It stays within the picture.
        const half = 2.6 * this.em;
        const middle = Math.min(Math.max(+x, half), this.svg.viewBox.baseVal.width - half);
        set(pull, "x", px(middle - x));
      });
      this.stars.forEach((star, c) => star.classList.toggle("shown", Boolean(pressed[c])));
    }

    // --- pulling ------------------------------------------------------------------------------

    grab(event) {
      if (!event.target.closest(".ball") || event.button) return;
      // Places to touch may overlap: the nearest ball is meant.
      const away = this.balls.map(({ disc }) => {
        const { left, right, top, bottom } = disc.getBoundingClientRect();
        return Math.hypot(event.clientX - (left + right) / 2, event.clientY - (top + bottom) / 2);
      });
      const ball = away.indexOf(Math.min(...away));
      if ([...this.drags.values()].some((drag) => drag.ball === ball)) return;
      event.preventDefault();
      this.balls[ball].group.focus({ preventScroll: true });
      this.svg.setPointerCapture(event.pointerId);
      // A ball that is taken at its edge does not jump to the pointer.
      const offset = this.place(event) - this.balls[ball].string.x2.baseVal.value;
      this.drags.set(event.pointerId, { ball, offset, from: event.clientX, moved: false });
      this.on.grab(ball);
    }

    // Where a pointer is, in the units of the picture.
    place(event) {
      const { left, width } = this.svg.getBoundingClientRect();
      return ((event.clientX - left) * this.svg.viewBox.baseVal.width) / width;
    }

    move(event) {
      const drag = this.drags.get(event.pointerId);
      if (!drag) return;
      drag.moved ||= Math.abs(event.clientX - drag.from) >= STILL;
      if (!drag.moved) return;
      const sine = (this.place(event) - drag.offset - this.pivots[drag.ball]) / this.length;
      const angle = Math.asin(Math.min(Math.max(sine, -0.95), 0.95));
      this.on.pull(drag.ball, this.rounded((-angle / this.size) * LENGTH * FREQUENCY));
    }

    release(event) {
      const drag = this.drags.get(event.pointerId);
      this.drags.delete(event.pointerId);
      if (drag) this.on.letGo(drag.ball, drag.moved);
    }

    // The browser has taken a finger to scroll the page: it has pulled nothing.
    cancel(event) {
      if (!this.drags.delete(event.pointerId)) return;
      this.drags.clear();
      this.on.giveUp(true);
    }

    // The left key pulls to the left, which makes the ball come in to the right.
    key(event) {
      const group = event.target.closest(".ball");
      const way = { ArrowLeft: 1, ArrowRight: -1 }[event.key];
      if (!group || !way) return;
      event.preventDefault();
      const ball = +group.dataset.ball;
      this.on.grab(ball);
      const step = event.shiftKey ? STEP : 2 * STEP;
      this.on.pull(ball, this.rounded(this.on.speed(ball) + way * step));
      this.on.letGo(ball, false);
    }

    rounded(speed) {
      return Math.round(speed / STEP) / Math.round(1 / STEP);
    }
  }

  explorer.Stage = Stage;
})(globalThis.cradleExplorer);
