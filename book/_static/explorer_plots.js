// Pictures of one hit as SVG text: bars, energy, and the diagrams of cradle/pictures/impacts.py. Each takes
// what it draws and the size of its box in pixels, and returns the whole picture; nothing is kept.
(function (explorer) {
  "use strict";
  const { fixed, kinetic, sum } = explorer;
  const MARKS = {
    maximum_compression: (x, y, r) => `<circle cx="${x}" cy="${y}" r="${r}"/>`,
    end: (x, y, r) => `<rect x="${x - r}" y="${y - r}" width="${2 * r}" height="${2 * r}"/>`,
    close: (x, y, r) => `<path d="M${x} ${y - r}l${r} ${1.8 * r}h${-2 * r}z"/>`,
    collapse: (x, y, r) =>
      `<path d="M${x} ${y - 1.3 * r}l${r} ${1.3 * r} ${-r} ${1.3 * r} ${-r} ${-1.3 * r}z"/>`,
    repetition: (x, y, r) =>
      `<path d="M${x} ${y - 1.3 * r}l${0.4 * r} ${0.9 * r} ${0.9 * r} ${0.4 * r} ${-0.9 * r} ${0.4 * r} ${-0.4 * r} ${0.9 * r} ${-0.4 * r} ${-0.9 * r} ${-0.9 * r} ${-0.4 * r} ${0.9 * r} ${-0.4 * r}z"/>`,
  };

  const px = (value) => Math.round(value * 100) / 100;
  const percent = (share) => `${fixed(100 * share, 0)}\u00a0%`;
  const colour = (ball) => `var(--ball-${ball})`;

  // WCAG 2: relative luminance.
  function luminance(code) {
    const parts = [1, 3, 5].map((k) => parseInt(code.slice(k, k + 2), 16) / 255);
    const linear = parts.map((p) => (p <= 0.04045 ? p / 12.92 : ((p + 0.055) / 1.055) ** 2.4));
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
  }

  // Letters on a ball's colour: black or white, whichever has more contrast. A black ball has the
  // colour of the text.
  function letters(ball) {
    const code = explorer.data.palette[ball];
    if (code === "#000000") return "var(--ground)";
    return (luminance(code) + 0.05) ** 2 > 0.05 * 1.05 ? "#000" : "#fff";
  }

  function stroke(ball, width = 2.2) {
    const dashes = explorer.data.dashes[ball].map((length) => px(length * width));
    return `stroke="${colour(ball)}" stroke-width="${width}" stroke-dasharray="${dashes.join(" ")}"`;
  }

  function text(x, y, words, how = "") {
    return `<text x="${px(x)}" y="${px(y)}" ${how}>${words}</text>`;
  }

  // Round numbers from low to high, about `count` of them.
  function ticks(low, high, count) {
    const rough = (high - low) / count;
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((k) => k * power).find((size) => size >= rough * 0.999);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    const found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1)
      found.push({ value: k * step, label: fixed(k * step, digits) });
    return found;
  }

  // A little more than the numbers need, so that no line lies on an edge.
  function span(values, least = 0.1) {
    const low = values.reduce((least, value) => Math.min(least, value), 0); // of too many for arguments
    const high = values.reduce((most, value) => Math.max(most, value), 0);
    const margin = 0.06 * Math.max(high - low, least);
    return [low - margin, high + margin];
  }

  // Axes with a grid. `box`: {width, height, em}.
  function axes(box, xs, ys, labels) {
    const { width, height, em } = box;
    const top = 0.7 * em;
    const bottom = height - 3.1 * em;
    const levels = ticks(ys[0], ys[1], (bottom - top) / (2.6 * em));
    const left = (1.9 + 0.5 * Math.max(...levels.map(({ label }) => label.length))) * em;
    const right = width - 1.7 * em;
    const x = (value) => px(left + ((value - xs[0]) / (xs[1] - xs[0])) * (right - left));
    const y = (value) => px(bottom - ((value - ys[0]) / (ys[1] - ys[0])) * (bottom - top));
    const parts = [];
    for (const { value, label } of ticks(xs[0], xs[1], (right - left) / (4.5 * em))) {
      parts.push(`<path class="grid" d="M${x(value)} ${top}V${bottom}"/>`);
      parts.push(text(x(value), bottom + 1.15 * em, label, 'text-anchor="middle"'));
    }
    for (const { value, label } of levels) {
      parts.push(
        `<path class="${+label === 0 ? "zero" : "grid"}" d="M${left} ${y(value)}H${right}"/>`,
      );
      parts.push(text(left - 0.4 * em, y(value) + 0.35 * em, label, 'text-anchor="end"'));
    }
    parts.push(`<path class="frame" d="M${left} ${top}V${bottom}H${right}"/>`);
    parts.push(text((left + right) / 2, bottom + 2.6 * em, labels[0], 'text-anchor="middle"'));
    const middle = (top + bottom) / 2;
    const turned = `text-anchor="middle" transform="rotate(-90 ${px(0.9 * em)} ${px(middle)})"`;
    parts.push(text(0.9 * em, middle, labels[1], turned));
    return { x, y, left, right, top, bottom, drawn: parts.join("") };
  }

  // The number of each ball at the right end of its line, moved apart where lines end together.
  function names(plot, balls, values, em) {
    const places = balls
      .map((ball, k) => ({ ball, y: plot.y(values[k]) }))
      .sort((a, b) => a.y - b.y);
    const least = 0.95 * em;
    places.forEach((place, k) => {
      if (k > 0) place.y = Math.max(place.y, places[k - 1].y + least);
    });
    for (let k = places.length - 1; k >= 0; k -= 1) {
      const lowest = k + 1 < places.length ? places[k + 1].y - least : plot.bottom;
      places[k].y = Math.min(places[k].y, lowest);
    }
    return places
      .map(({ ball, y }) =>
        text(plot.right + 0.6 * em, y + 0.35 * em, ball + 1, `style="--ball: ${colour(ball)}" class="name"`),
      )
      .join("");
  }

  function picture(box, words, content, role = "img") {
    return (
      `<svg viewBox="0 0 ${px(box.width)} ${px(box.height)}" role="${role}" aria-label="${words}" ` +
      `width="${px(box.width)}" height="${px(box.height)}">${content}</svg>`
    );
  }

  const polyline = (points, how) =>
    `<polyline fill="none" ${how} points="${points.map(([x, y]) => `${x},${y}`).join(" ")}"/>`;

  // Where bars of velocities stand: a row for each ball, and room for its name and its number.
  // `span`: the velocities that must have room.
  function barPlaces({ width, em, row }, span) {
    const name = 3.2 * em;
    const number = 3.4 * em;
    const largest = Math.max(...span.map(Math.abs), 1e-9);
    const low = Math.min(0, ...span) / largest;
    const high = Math.max(0, ...span) / largest;
    // Room for a number beyond a bar that goes to the left.
    const left = name + (low < 0 ? number : 0);
    const scale = (width - number - left) / Math.max(high - low, 1e-9);
    return { row, x: (value) => px(left + (value / largest - low) * scale) };
  }

  // Velocities as bars, to the left and to the right as the balls move. Dashed outlines show the
  // velocities before, and the longest one says so where it has room; `guess` is what the reader has
  // drawn.
  function bars(box, setting, before, now, { guess = [], span, gap = 0.35 } = {}) {
    const { width, em } = box;
    const count = now.length;
    const { row, x } = barPlaces(box, span ?? [...before, ...now, ...guess]);
    const parts = [];
    const longest = before.findIndex((v) => Math.abs(v) === Math.max(...before.map(Math.abs)));
    for (let ball = 0; ball < count; ball += 1) {
      const top = px((ball + 0.5) * row - 0.625 * em);
      const bar = (value, how) =>
        `<rect x="${Math.min(x(0), x(value))}" y="${top}" width="${px(Math.abs(x(value) - x(0)))}" ` +
        `height="${px(1.2 * em)}" rx="2" ${how}/>`;
      const letter = setting.letters[ball] === explorer.NONE ? "" : ` ${setting.letters[ball]}`;
      parts.push(
        `<circle cx="${px(0.6 * em)}" cy="${px(top + 0.6 * em)}" r="${px(0.4 * em)}" fill="${colour(ball)}"/>`,
      );
      parts.push(text(1.3 * em, top + em, `${ball + 1}${letter}`));
      parts.push(bar(before[ball], 'class="before"'), bar(now[ball], `fill="${colour(ball)}"`));
      if (guess.length) parts.push(bar(guess[ball], 'class="guess"'));
      const leftwards = +now[ball].toFixed(2) < 0;
      const side = leftwards ? -1 : 1;
      // A number stands beyond an outline that would run through it.
      const beyond = (value) => side * (x(value) - x(0));
      let tip = beyond(now[ball]);
      for (const edge of [before[ball], guess[ball] ?? 0].map(beyond).sort((a, b) => a - b))
        if (edge > tip && edge < tip + 2.8 * em) tip = edge;
      const at = px(x(0) + side * (tip + gap * em));
      const end = leftwards ? 'text-anchor="end" class="number"' : 'class="number"';
      parts.push(text(at, top + em, fixed(now[ball]), end));
      const way = Math.sign(before[ball]);
      const far = (value) => way * (x(value) - x(0));
      const taken = Math.max(0, far(now[ball]) + (leftwards === way < 0 ? 3 * em : 0), far(guess[ball] ?? 0));
      if (ball === longest && far(before[ball]) - taken > 4 * em)
        parts.push(text(x(before[ball]) - 2.2 * way * em, top + 0.9 * em, "before", 'text-anchor="middle" class="small"'));
    }
    parts.push(`<path class="zero" d="M${x(0)} 0V${px(count * row)}"/>`);
    const words = `Velocities in m/s: ${now.map((v, ball) => `ball ${ball + 1} ${fixed(v)}`).join(", ")}`;
    return picture({ width, height: count * row + 0.2 * em }, words, parts.join(""));
  }

  // Momentum as arrows, end to end: from zero those of balls that go to the right, then, in the row
  // below, back by those that go to the left. They have to end at the mark of the momentum before.
  function momentum(box, setting, before, now) {
    const { width, em } = box;
    const of = (row) => row.map((v, ball) => setting.masses[ball] * v);
    const parts = of(now).map((p, ball) => ({ p, ball }));
    const [right, left] = [parts.filter(({ p }) => p > 0), parts.filter(({ p }) => p < 0)];
    const [total, last, most] = [of(before), of(now), right.map(({ p }) => p)].map(sum);
    const [low, high] = [Math.min(0, total, last), Math.max(0, total, most)];
    // Where it is kept, rounding alone may change its last digit.
    const told = Math.abs(last - total) > 1e-4 * sum(of(before).map(Math.abs)) ? last : total;
    const x = (p) => px(1.7 * em + ((p - low) / Math.max(high - low, 1e-9)) * (width - 3.4 * em));
    const thick = 0.6 * em;
    let end = 0;
    const pieces = [...right, ...left].map(({ p, ball }) => {
      const from = x(end);
      const to = x((end += p));
      const tip = px(to - Math.sign(p) * Math.min(Math.abs(to - from), 0.4 * em));
      const y = px(0.4 * em + (p < 0 ? thick : 0));
      const half = px(thick / 2);
      return `<path d="M${from} ${y}H${tip}L${to} ${y + half}L${tip} ${y + 2 * half}H${from}z" fill="${colour(ball)}"/>`;
    });
    const below = em + 2 * thick;
    const height = below + 1.1 * em;
    const tick = (p, how) => `<path class="${how}" d="M${x(p)} 0V${px(below)}"/>`;
    const name = (p, words) => text(p, below + 0.85 * em, words, 'text-anchor="middle" class="small"');
    const apart = Math.abs(x(total) - x(0)) > 2.4 * em;
    const names = apart ? name(x(0), "0") + name(x(total), "before") : name(x(0), "0, before");
    return picture(
      { width, height },
      `Momentum: ${fixed(told)}, before the hit ${fixed(total)} kg m/s`,
      tick(0, "zero") + pieces.join("") + tick(total, "cursor") + names,
    );
  }

  // Where the energy is: one share for each ball, and hatched what the contacts hold, J. A dashed
  // outline holds the energy before; a guess may have more.
  function energy(box, setting, before, now, held = 0) {
    const { width, em } = box;
    const total = sum(kinetic(setting.masses, before));
    const shares = kinetic(setting.masses, now).map((share) => (total > 0 ? share / total : 0));
    const height = 1.5 * em;
    const unit = width / Math.max(1, sum(shares) - 1e-9);
    let x = 0;
    const named = shares.map((share, ball) => `ball ${ball + 1}: ${percent(share)}`);
    const parts = shares.map((share, ball) => {
      const wide = share * unit;
      const label = [named[ball], named[ball].slice(5)].find((words) => wide > 0.5 * em * (words.length + 1));
      const how = `text-anchor="middle" fill="${letters(ball)}"`;
      const part =
        `<rect x="${px(x)}" y="0" width="${px(wide)}" height="${px(height)}" fill="${colour(ball)}" class="part"/>` +
        (label ? text(x + wide / 2, 1.1 * em, label, how) : "");
      x += wide;
      return part;
    });
    const words = `Kinetic energy: ${named.join(", ")}; in all ${percent(sum(shares))} of that before the hit`;
    const share = percent(held / total);
    if (held > 0) {
      const wide = (held / total) * unit;
      const line = `d="M${px(x)} ${px(height / 2)}h${px(wide)}" stroke-width="${px(height)}"`;
      const label = [`in the contacts: ${share}`, `contacts: ${share}`, share].find((said) => wide > 0.5 * em * (said.length + 1));
      parts.push(`<path class="stored" ${line}/>`);
      if (label) parts.push(text(x + wide / 2, 1.1 * em, label, 'text-anchor="middle" class="on-stored"'));
    }
    parts.push(`<rect class="before" width="${px(unit)}" height="${px(height)}"/>`);
    return picture({ width, height }, words + (held > 0 ? `; in the contacts ${share}` : ""), parts.join(""));
  }

  // Sum of all impulses at each row of a record's path.
  const progress = (record) => record.pathImpulses.map(sum);

  // The rows of a record by rule between which all goes straight. At a maximum of compression no line
  // bends; where two runs overlap, the record alone has one maximum after the other.
  function straight(record) {
    const { path, pathImpulses, events } = record;
    if (record.stored) return record; // of forces: lines are curved
    const kept = (rows) => rows.filter((_, row) => events[row - 1]?.kind !== "maximum_compression");
    const [, ...bends] = kept([null, ...events]);
    return { path: kept(path), pathImpulses: kept(pathImpulses), events: bends };
  }

  // Velocities and impulses when the hit has come so far, from 0 to 1.
  function during(whole, part) {
    const record = straight(whole);
    const along = progress(record);
    const end = along[along.length - 1];
    const target = part * end;
    let row = 1;
    while (row < along.length - 1 && along[row] < target) row += 1;
    if (along.length < 2 || part >= 1) row = along.length - 1;
    const from = Math.max(row - 1, 0);
    const step = along[row] - along[from];
    const share = part >= 1 ? 1 : step > 0 ? (target - along[from]) / step : 0;
    const between = (rows) =>
      rows[row].map((value, k) => rows[from][k] + share * (value - rows[from][k]));
    const pressed = record.pathImpulses[row].map((p, c) => p > record.pathImpulses[from][c]);
    return {
      velocities: share === 1 ? record.path[row] : between(record.path),
      impulses: between(record.pathImpulses),
      pressed: part >= 1 ? pressed.map(() => false) : pressed,
      row,
      share,
      place: row - 1 + share, // how many events have come, with the fraction of the way to the next
    };
  }

  // The energy that the contacts hold by then, J: of the work that it takes each one can give back
  // e^2, and loses the rest. Work is impulse times mean closing speed; where that speed changes its
  // sign, its squares share out the work.
  function stored({ restitution }, whole, part) {
    const record = straight(whole);
    const { velocities, impulses, row, share } = during(whole, part);
    if (whole.stored) return whole.stored[row - 1] + share * (whole.stored[row] - whole.stored[row - 1]);
    const path = [...record.path.slice(0, row), velocities];
    const along = [...record.pathImpulses.slice(0, row), impulses];
    const held = restitution.map(() => 0);
    for (let k = 1; k <= row; k += 1)
      restitution.forEach((e, c) => {
        const [u, now] = [path[k - 1], path[k]].map((v) => v[c] - v[c + 1]);
        const push = along[k][c] - along[k - 1][c];
        const work = (push * (u + now)) / 2;
        const taken = u * now < 0 ? (push * Math.max(u, now) ** 2) / (2 * Math.abs(u - now)) : Math.max(work, 0);
        held[c] = Math.max(held[c] + e * e * taken + work - taken, 0);
      });
    return sum(held);
  }

  // The part of the hit where so many events have come, with a fraction of the way to the next one.
  function partBy(record, place) {
    const along = progress(straight(record));
    const [row, last] = [Math.floor(place), along.length - 1];
    return row >= last ? 1 : (along[row] + (place - row) * (along[row + 1] - along[row])) / along[last];
  }

  // Where the diagram has its lines: of all balls over the sum of all impulses, of a contact's two
  // balls over its own impulse, or with all events at `equal` distances.
  function lines(record, contact, equal) {
    const all = contact === "all";
    const { path, pathImpulses } = straight(record);
    const impulses = all ? progress({ pathImpulses }) : pathImpulses.map((row) => row[contact]);
    return {
      path,
      along: equal ? path.map((_, row) => row) : impulses,
      balls: all ? path[0].map((_, ball) => ball) : [contact, contact + 1],
    };
  }

  // Beyond this many events of a contact, marks hide the lines.
  const MARKED = 60;

  // On the axis of events a maximum is between two of them.
  function eventPlace(record, contact, row) {
    const bends = record.events.flatMap(({ kind }, k) => (kind === "maximum_compression" ? [] : [k + 1]));
    const before = bends.filter((bend) => bend <= row);
    const [from, to] = [before.at(-1) ?? 0, bends[before.length] ?? row];
    const [low, now, high] = [from, row, to].map((at) => record.pathImpulses[at][contact]);
    return before.length + (high > low ? (now - low) / (high - low) : 0);
  }

  function marks(record, contact, plot, em, equal) {
    const events = record.events
      .map((event, k) => ({ row: k + 1, ...event }))
      .filter((event) => event.contact === contact);
    if (events.length > MARKED) return "";
    const several = events.filter((event) => event.kind === "end").length > 1;
    let collision = 1;
    let taken = -Infinity;
    return events
      .map(({ kind, row }, k) => {
        if (kind === "close" && k > 0) collision += 1;
        const x = plot.x(equal ? eventPlace(record, contact, row) : record.pathImpulses[row][contact]);
        const drawn = [contact, contact + 1].map((ball) =>
          MARKS[kind](x, plot.y(record.path[row][ball]), px(0.28 * em)),
        );
        const letter = explorer.data.events[kind][0] + (several ? collision : "");
        const room = x > taken;
        if (room) taken = x + 0.75 * em * letter.length;
        return (
          `<path class="event" d="M${x} ${plot.top}V${plot.bottom}"/><g class="mark">${drawn.join("")}</g>` +
          (room ? text(x + 0.15 * em, plot.bottom - 0.3 * em, letter, 'class="small"') : "")
        );
      })
      .join("");
  }

  // The hit from the inside.
  function diagram(box, record, contact, equal) {
    const { path, along, balls } = lines(record, contact, equal);
    const { em } = box;
    const shown = balls.flatMap((ball) => path.map((row) => row[ball]));
    const end = along[along.length - 1];
    const impulse =
      contact === "all" ? "sum of all impulses (N s)" : `impulse <tspan font-style="italic">τ</tspan>${sub(contact + 2)} (N s)`;
    const plot = axes(box, [0, end > 0 ? end : 1], span(shown), [
      equal ? "event, at equal distances" : impulse,
      "velocity (m/s)",
    ]);
    const drawn = balls.map((ball) =>
      polyline(
        along.map((at, row) => [plot.x(at), plot.y(path[row][ball])]),
        stroke(ball),
      ),
    );
    const last = path[path.length - 1];
    drawn.push(
      names(
        plot,
        balls,
        balls.map((ball) => last[ball]),
        em,
      ),
    );
    const marked = contact === "all" ? "" : marks(record, contact, plot, em, equal);
    const words = `Velocities of balls ${balls.map((ball) => ball + 1).join(", ")} during the hit`;
    return {
      plot,
      svg: picture(box, words, plot.drawn + marked + drawn.join("") + '<g class="now"></g>'),
    };
  }

  // Subscripts as Unicode: they need no markup.
  const sub = (number) =>
    [...String(number)].map((digit) => String.fromCharCode(0x2080 + +digit)).join("");

  // The dots that travel along the diagram's lines.
  function dots(plot, record, contact, part, em, equal) {
    const { velocities, impulses, place } = during(record, part);
    const { balls } = lines(record, contact);
    const impulse = contact === "all" ? sum(impulses) : impulses[contact];
    const x = plot.x(equal ? place : impulse);
    return (
      `<path class="cursor" d="M${x} ${plot.top}V${plot.bottom}"/>` +
      balls
        .map(
          (ball) =>
            `<circle class="dot" cx="${x}" cy="${plot.y(velocities[ball])}" r="${px(0.36 * em)}" stroke="${colour(ball)}"/>`,
        )
        .join("")
    );
  }

  Object.assign(explorer, {
    axes,
    barPlaces,
    bars,
    colour,
    diagram,
    dots,
    during,
    energy,
    luminance,
    momentum,
    names,
    partBy,
    percent,
    picture,
    polyline,
    progress,
    px,
    span,
    stored,
    stroke,
    sub,
    text,
  });
})(globalThis.cradleExplorer);
