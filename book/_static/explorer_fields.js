// Many hits at once: the sweep over the ratio and the map of mass ratios. Both are computed from
// coarse to fine, a few milliseconds in each frame, and begin anew when their question changes.
(function (explorer) {
  "use strict";
  const { axes, names, picture, polyline, px, span, stroke, sub } = explorer;

  // The places of a row, or of a square of such rows, from coarse to fine: first every 16th, then
  // those between. Each has the size of what it stands for until finer ones are known.
  function coarseToFine(side, rows = 1) {
    const order = [];
    for (let size = 16; size >= 1; size /= 2)
      for (let row = 0; row < rows; row += size)
        for (let column = 0; column < side; column += size)
          if (size === 16 || row % (2 * size) || column % (2 * size))
            order.push({ k: row * side + column, row, column, size });
    return order;
  }

  // `compute(k)` for all places, in their order.
  class Gradual {
    constructor(order, compute) {
      this.values = new Array(order.length);
      this.order = order;
      this.compute = compute;
      this.done = 0;
    }

    get finished() {
      return this.done === this.order.length;
    }

    resume(deadline) {
      while (!this.finished && performance.now() < deadline) {
        const { k } = this.order[this.done];
        this.values[k] = this.compute(k);
        this.done += 1;
      }
    }
  }

  // --- the sweep ------------------------------------------------------------------------------

  const STEPS = 200;

  // The one ratio of the swept balls, or null if they have several.
  function presentRatio(setting, inner) {
    const ratios = inner.flatMap((k) => [setting.forward[k], setting.backward[k]]);
    return ratios.length && ratios.every((ratio) => ratio === ratios[0]) ? ratios[0] : null;
  }

  // The stretches of a row whose entries pass a test.
  function stretches(row, passes) {
    const parts = [[]];
    row.forEach((entry) => {
      if (passes(entry)) parts[parts.length - 1].push(entry);
      else parts.push([]);
    });
    return parts.filter((part) => part.length > 0);
  }

  class Sweep {
    // `inner`: which balls with two neighbours, from 0, get the ratio of the axis.
    constructor(setting, inner) {
      this.key = Sweep.key(setting, inner);
      this.setting = setting;
      this.inner = inner;
      this.points = new Gradual(coarseToFine(STEPS + 1), (k) =>
        explorer.outcome(explorer.withRatio(setting, inner, k / STEPS)),
      );
    }

    // Two settings with equal keys have the same sweep.
    static key(setting, inner) {
      const { masses, speeds, restitution } = setting;
      const { forward, backward } = explorer.withRatio(setting, inner, 0);
      return JSON.stringify([masses, speeds, restitution, forward, backward, inner]);
    }

    // `after`: velocities of the present setting.
    svg(box, setting, after) {
      const { em } = box;
      const known = this.points.values
        .map((answer, k) => ({ ...answer, ratio: k / STEPS }))
        .filter(Boolean);
      const found = known.filter((answer) => answer.status === "finished");
      const all = found.flatMap(({ velocities }) => [...velocities]);
      const plot = axes(box, [0, 1], span([...all, ...(after || [])]), [
        this.inner.length > 1
          ? "ratio, the same at all inner balls"
          : `ratio at ball ${this.inner[0] + 2}`,
        "velocity after the hit (m/s)",
      ]);
      this.plot = plot;
      const balls = explorer.all(setting.masses);
      const drawn = balls.map((ball) =>
        stretches(known, ({ status }) => status === "finished") // a gap where there is no answer
          .map((part) =>
            polyline(
              part.map(({ ratio, velocities }) => [plot.x(ratio), plot.y(velocities[ball])]),
              stroke(ball),
            ),
          )
          .join(""),
      );
      if (found.length) drawn.push(names(plot, balls, found[found.length - 1].velocities, em));
      const words = "Velocities after the first hit for ratios from 0 to 1";
      return picture(
        box,
        words,
        this.held(found) + plot.drawn + drawn.join("") + this.present(setting, after, em),
      );
    }

    // Where a ratio is above its largest value and has no further effect there.
    held(found) {
      const { x, top, bottom } = this.plot;
      const bands = stretches(found, ({ saturated }) => saturated.length > 0).map((part) => {
        const [from, to] = [x(part[0].ratio), x(part[part.length - 1].ratio)];
        return `<rect class="held" x="${from}" y="${top}" width="${px(to - from)}" height="${px(bottom - top)}"/>`;
      });
      return bands.join("");
    }

    present(setting, after, em) {
      if (!after) return "";
      const { x, y, top, bottom, left, right } = this.plot;
      const ratio = presentRatio(setting, this.inner);
      if (ratio === null)
        return [...after]
          .map(
            (v, ball) =>
              `<path d="M${left} ${y(v)}H${right}" stroke="${explorer.colour(ball)}" class="level"/>`,
          )
          .join("");
      const dots = [...after].map(
        (v, ball) =>
          `<circle class="dot" cx="${x(ratio)}" cy="${y(v)}" r="${px(0.36 * em)}" stroke="${explorer.colour(ball)}"/>`,
      );
      return `<path class="cursor" d="M${x(ratio)} ${top}V${bottom}"/>${dots.join("")}`;
    }
  }

  // --- the map --------------------------------------------------------------------------------

  const CELLS = 240;
  let square; // the order of all maps
  const LARGEST = 3; // of both axes, as in the paper's Fig. 6

  const ratios = ({ masses }) => ({ right: masses[1] / masses[2], left: masses[1] / masses[0] });

  // Three balls of these mass ratios, the middle one unchanged; within what masses may be.
  function withRatios(setting, right, left) {
    const [low, high] = explorer.LIMITS.masses;
    const mass = (value) => +Math.min(Math.max(value, low), high).toPrecision(4);
    const changed = explorer.withMass(setting, [0], mass(setting.masses[1] / left));
    return explorer.withMass(changed, [2], mass(setting.masses[1] / right));
  }

  // Their mass ratios changed by so much.
  function movedRatios(setting, right, left) {
    const at = ratios(setting);
    return withRatios(setting, Math.max(at.right + right, 0.01), Math.max(at.left + left, 0.01));
  }

  // The pixels that a canvas makes of colours: of each but the last, and of it with the last on it.
  function shades(pen, fills) {
    const shade = fills.length - 1;
    for (const [k, fill] of fills.slice(0, shade).entries()) {
      pen.fillStyle = fill;
      pen.fillRect(k, 0, 1, 2);
    }
    pen.fillStyle = fills[shade];
    pen.fillRect(0, 1, shade, 1);
    return [0, 1].map((row) => new Uint32Array(pen.getImageData(0, row, shade, 1).data.buffer));
  }

  class RegionMap {
    constructor(setting) {
      this.key = RegionMap.key(setting);
      const { masses: _, ...others } = setting;
      this.points = new Gradual((square ??= coarseToFine(CELLS, CELLS)), (k) => {
        const left = ((Math.floor(k / CELLS) + 0.5) / CELLS) * LARGEST;
        const right = (((k % CELLS) + 0.5) / CELLS) * LARGEST;
        const masses = [1 / left, 1, 1 / right];
        const asked = { ...others, masses };
        const { status, velocities, collisions, collapsed } = explorer.outcome(asked);
        if (status !== "finished") return { pattern: -1, odd: false };
        // As balls keep their order, the number of those that go back names them.
        const pattern = [...velocities].filter((v) => v < 0).length;
        return { pattern, odd: !collapsed && (collisions[0] + collisions[1]) % 2 === 1 };
      });
    }

    // The map does not change when its own point moves.
    static key({ masses: _, letters: __, ...others }) {
      return JSON.stringify(others);
    }

    // Paint what has become known, in the colours given for 0, 1, 2, 3 balls that go back; the last
    // one shades cells with an odd number of collisions.
    paint(canvas, fills) {
      const pen = canvas.getContext("2d", { willReadFrequently: true });
      if (this.fills !== String(fills)) {
        Object.assign(canvas, { width: CELLS, height: CELLS });
        const image = pen.createImageData(CELLS, CELLS);
        Object.assign(this, { fills: String(fills), shades: shades(pen, fills), image, painted: 0 });
      }
      const { image, points } = this;
      const [plain, shaded] = this.shades;
      const pixels = new Uint32Array(image.data.buffer);
      for (; this.painted < points.done; this.painted += 1) {
        const { k, row, column, size } = points.order[this.painted];
        const { pattern, odd } = points.values[k];
        const [rows, columns] = [row, column].map((at) => Math.min(at + size, CELLS));
        const fill = pattern < 0 ? 0 : (odd ? shaded : plain)[pattern]; // none where there is no answer
        for (let line = row; line < rows; line += 1) {
          const from = (CELLS - 1 - line) * CELLS;
          pixels.fill(fill, from + column, from + columns);
        }
      }
      pen.putImageData(image, 0, 0);
    }

    // `back`: which balls go back, in words.
    svg(box, setting, back) {
      const { em } = box;
      const plot = axes(
        box,
        [0, LARGEST],
        [0, LARGEST],
        [`m${sub(2)} / m${sub(3)} (ball 3 lighter →)`, `m${sub(2)} / m${sub(1)} (ball 1 lighter →)`],
      );
      this.plot = plot;
      const at = ratios(setting);
      const [x, y] = [at.right, at.left].map((value) => Math.min(value, LARGEST));
      const beyond = at.right > LARGEST || at.left > LARGEST;
      const words = `masses ${setting.masses.join(", ")} kg; going back: ${back}`;
      const point =
        `<g class="point" tabindex="0" role="slider" aria-label="mass ratios" aria-valuetext="${words}" ` +
        `aria-valuenow="${px(at.right)}" aria-valuemin="0" aria-valuemax="${LARGEST}">` +
        `<circle class="reach" cx="${plot.x(x)}" cy="${plot.y(y)}" r="${px(1.6 * em)}"/>` +
        `<circle class="${beyond ? "beyond" : "present"}" cx="${plot.x(x)}" cy="${plot.y(y)}" r="${px(0.5 * em)}"/></g>`;
      return picture(
        box,
        "Map of the balls that go back, by two mass ratios",
        plot.drawn + point,
        "group",
      );
    }
  }

  Object.assign(explorer, {
    LARGEST,
    RegionMap,
    Sweep,
    movedRatios,
    presentRatio,
    ratios,
    withRatios,
  });
})(globalThis.cradleExplorer);
