// The panel with one of three pictures: a hit from the inside, its outcome for each ratio, or which
// balls go back for any two quotients of masses.
(function (explorer) {
  "use strict";
  const { RegionMap, Sweep, controls, panels } = explorer;
  const { button, choice, make, select } = controls;
  const TABS = {
    inside: ["Inside the hit", "velocities from its start to its end"],
    sweep: ["Each ratio", "the outcome for each ratio from 0 to 1"],
    map: ["Who goes back", "of three balls, for any two quotients of their masses"],
  };
  // Milliseconds of each frame for sweeps and maps.
  const BUDGET = 7;
  const LISTED = 12; // events as buttons

  // --- a hit from the inside ------------------------------------------------------------------------

  // Whether a contact that closes gets no push yet: a neighbour drives it, at the ratio zero.
  function waits({ forward, backward }, { pathImpulses }, contact, row) {
    const now = pathImpulses[row];
    const next = pathImpulses.slice(row + 1).find((later) => later.some((p, c) => p > now[c]));
    const grows = (c) => next?.[c] > now[c];
    const idle = (neighbour, ratio) => grows(neighbour) && ratio === 0;
    return !grows(contact) && (idle(contact - 1, forward[contact - 1]) || idle(contact + 1, backward[contact]));
  }

  // The events of a hit as buttons, numbered as in chapter 4: contacts that end, and that begin anew.
  function eventList(act) {
    const node = make("ol", { class: "events" });
    let listed = null;
    let events = [];
    const words = ({ kind, contact, pending }) =>
      `contact ${contact + 1}\u2011${contact + 2} ${kind === "end" ? "ends" : pending ? "waits" : "closes"}`;
    function list(setting, record) {
      listed = record;
      const total = record ? explorer.progress(record) : [0];
      const end = total[total.length - 1];
      events = (record?.events ?? []).flatMap((event, k) => {
        if (event.kind === "maximum_compression") return [];
        const row = event.row ?? k + 1;
        const pending = event.kind === "close" && waits(setting, record, event.contact, row);
        return [{ ...event, at: total[row] / end, pending }];
      });
      node.replaceChildren(
        ...events.slice(0, LISTED).map((event) => make("li", {}, button(words(event), () => act.part(event.at)))),
      );
    }
    function show({ setting, record, part }) {
      if (record !== listed) list(setting, record); // each frame comes here
      // The last ones that have come: several may share an instant.
      const last = events.filter(({ at }) => at <= part + 1e-9).at(-1)?.at;
      [...node.children].forEach(({ firstChild }, k) =>
        firstChild.setAttribute("aria-pressed", Math.abs(events[k].at - last) < 1e-9),
      );
    }
    return { node, show };
  }

  function insidePicture(act, parts) {
    const events = parts.has("events") ? eventList(act) : null;
    const equal = parts.has("events"); // distances of events: the last ones of a hit are close together
    const contact = select({ words: "velocities of", options: [], choose: act.contact });
    const plot = make("div", { class: "plot" });
    const part = make("input", {
      type: "range",
      min: 0,
      max: 1,
      step: 0.005,
      "aria-label": "how far the hit has come",
      oninput: () => act.part(equal ? explorer.partBy(shown, +part.value) : +part.value),
    });
    const scrub = make(
      "label",
      { class: "scrub" },
      make("span", {}, "start"),
      part,
      make("span", {}, "end"),
    );
    const note = make("p", { class: "note" });
    let offered = 0;
    let drawn = null;
    let shown = null; // the record
    function offer(count) {
      const pairs = Array.from({ length: count - 1 }, (_, c) => ({
        value: String(c),
        text: `balls ${c + 1} and ${c + 2}`,
      }));
      contact.offer([{ entries: [{ value: "all", text: "all balls" }, ...pairs] }]);
      offered = count;
    }
    function legend(record, chosen) {
      if (chosen === "all" && equal) return "The events of the list, at equal distances. Dashed: now; all bars follow.";
      if (chosen === "all")
        return "Impulse (force times time) is the clock here. Dashed: the instant that all bars show.";
      const kinds = new Set(
        record.events.filter((event) => event.contact === chosen).map(({ kind }) => kind),
      );
      return [...kinds].map((kind) => explorer.data.events[kind].join(": ")).join("; ");
    }
    function show({ setting, record, hit, contact: chosen }, box) {
      const count = setting.masses.length;
      if (offered !== count) offer(count);
      contact.show(String(chosen));
      scrub.hidden = !record;
      shown = record;
      if (record && equal) part.max = explorer.during(record, 1).place;
      drawn = record && explorer.diagram(box(plot, 6.5), record, chosen, equal);
      plot.innerHTML = drawn ? drawn.svg : "";
      if (record) note.textContent = legend(record, chosen);
      else
        note.textContent = hit.happened
          ? "There is no answer to draw."
          : "There is no hit to draw.";
    }
    function move(state, box) {
      const { record, contact: chosen, part: now } = state;
      if (!drawn || !record) return;
      events?.show(state);
      const at = equal ? explorer.during(record, now).place : now;
      if (document.activeElement !== part || +part.value !== at) part.value = at;
      if (drawn.now === now) return;
      drawn.now = now;
      part.setAttribute("aria-valuetext", `${Math.round(100 * now)}\u00a0%`);
      const { em } = box(plot);
      plot.querySelector(".now").innerHTML = explorer.dots(drawn.plot, record, chosen, now, em, equal);
    }
    return {
      node: make("div", {}, contact.node, plot, scrub, events?.node ?? "", note),
      show,
      move,
      resume: () => false,
    };
  }

  // --- the outcome for each ratio -----------------------------------------------------------------------------------

  function sweepPicture(act) {
    const plot = make("div", { class: "plot drags-x" });
    const note = make("p", { class: "note" });
    let sweep = null;
    let shown = null;
    const ratioAt = (event) => {
      const svg = plot.querySelector("svg");
      if (!svg || !sweep) return;
      const { left, width } = svg.getBoundingClientRect();
      const x = ((event.clientX - left) * svg.viewBox.baseVal.width) / width;
      const share = (x - sweep.plot.left) / (sweep.plot.right - sweep.plot.left);
      act.ratio(
        Math.round(100 * Math.min(Math.max(share, 0), 1)) / 100,
        ["forward", "backward"],
        sweep.inner,
      );
    };
    drag(plot, ratioAt, act);
    function draw(box) {
      const { setting, firstAfter } = shown;
      plot.innerHTML = sweep.svg(box(plot), setting, firstAfter);
    }
    function show(state, box) {
      const { setting, scope } = state;
      const chosen = panels.concerned(setting, scope).inner;
      const inner = chosen.length ? chosen : explorer.all(setting.forward);
      shown = state;
      const forces = explorer.law(setting) !== "rule";
      if (!inner.length || forces) {
        sweep = null;
        plot.replaceChildren();
        note.textContent = forces
          ? "There is no ratio here: how the contacts push says it all. Choose the paper's law to see this picture."
          : "Two balls have no ratio: it belongs to a ball with two neighbours.";
        return;
      }
      if (!sweep || sweep.key !== Sweep.key(setting, inner)) sweep = new Sweep(setting, inner);
      draw(box);
      tell();
    }
    function tell() {
      const held = sweep.points.values.some((answer) => answer.saturated?.length);
      const refused = sweep.points.values.filter((answer) => answer.status !== "finished").length;
      note.textContent =
        (explorer.presentRatio(shown.setting, sweep.inner) === null
          ? "Level lines: the present outcome, whose ratios differ from ball to ball."
          : "Dashed line: the present ratio. Drag it.") +
        (held ? " Grey: above its bound; the bound is used." : "") +
        (refused ? ` At ${refused} ratios the hit takes more events than the page computes.` : "");
    }
    function resume(box) {
      if (!sweep || sweep.points.finished) return false;
      sweep.points.resume(performance.now() + BUDGET);
      draw(box);
      if (sweep.points.finished) tell();
      return !sweep.points.finished;
    }
    return { node: make("div", {}, plot, note), show, move: () => {}, resume };
  }

  // --- all mass ratios of three balls ---------------------------------------------------------------

  const PATTERNS = ["none", "ball 1", "balls 1 and 2", "all"];

  function mapPicture(act) {
    const canvas = make("canvas", { class: "cells", "aria-hidden": true });
    const plot = make("div", { class: "plot" });
    const host = make("div", { class: "map" }, canvas, plot);
    const patterns = PATTERNS.map((words, k) =>
      make("span", { class: `pattern pattern-${k}` }, words),
    );
    const legend = make("p", { class: "patterns" }, ...patterns);
    const note = make("p", { class: "note" });
    const three = button("Take three balls", () => act.count(3));
    let map = null;
    let painted = "";
    const pointAt = (event) => {
      const svg = plot.querySelector("svg");
      if (!svg || !map) return;
      const { left, top, width } = svg.getBoundingClientRect();
      const unit = svg.viewBox.baseVal.width / width;
      const { plot: p } = map;
      const at = [
        ((event.clientX - left) * unit - p.left) / (p.right - p.left),
        (p.bottom - (event.clientY - top) * unit) / (p.bottom - p.top),
      ];
      act.masses(...at.map((share) => explorer.LARGEST * Math.min(Math.max(share, 0.004), 1)));
    };
    drag(plot, pointAt, act);
    plot.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[
        event.key
      ];
      if (!way || !event.target.closest(".point")) return;
      event.preventDefault();
      const step = event.shiftKey ? 0.01 : 0.1;
      act.moveMasses(step * way[0], step * way[1]);
    });
    function paint() {
      const style = getComputedStyle(host);
      map.paint(
        canvas,
        [0, 1, 2, 3, "odd"].map((k) => style.getPropertyValue(`--pattern-${k}`)),
      );
      patterns.forEach(
        (pattern, k) => (pattern.hidden = !map.points.values.some((cell) => cell.pattern === k)),
      );
      painted = document.documentElement.dataset.theme + map.key + map.points.finished;
    }
    function show({ setting, firstAfter }, box) {
      const fits = setting.masses.length === 3;
      host.hidden = !fits;
      three.hidden = fits;
      legend.hidden = !fits;
      if (!fits) {
        map = null;
        note.textContent = "This map is for three balls.";
        return;
      }
      if (!map || map.key !== RegionMap.key(setting)) map = new RegionMap(setting);
      const focused = plot.contains(document.activeElement);
      const space = box(plot, 7);
      space.width = Math.min(space.width, 1.25 * space.height);
      const back = firstAfter?.filter((v) => v < -1e-9).length;
      plot.innerHTML = map.svg(space, setting, PATTERNS[back] ?? "no answer");
      if (focused) plot.querySelector(".point").focus({ preventScroll: true });
      const { left, right, top, bottom } = map.plot;
      Object.assign(canvas.style, {
        left: `${left}px`,
        top: `${top}px`,
        width: `${right - left}px`,
        height: `${bottom - top}px`,
      });
      const at = explorer.ratios(setting);
      const beyond =
        Math.max(at.left, at.right) > explorer.LARGEST
          ? " The present masses lie beyond its edge."
          : "";
      note.textContent = `Which balls go back. Each change of shade is one collision more or less. Drag the point.${beyond}`;
      if (painted !== document.documentElement.dataset.theme + map.key + map.points.finished)
        paint();
    }
    function resume() {
      if (!map || map.points.finished) return false;
      map.points.resume(performance.now() + BUDGET);
      paint();
      return !map.points.finished;
    }
    return { node: make("div", {}, host, legend, note, three), show, move: () => {}, resume };
  }

  // Follow a pointer: a mouse from its first press on; a finger once it goes to a side, or where it
  // taps. A finger that scrolls the page, which the browser then takes, has changed nothing.
  const STILL = 6;
  function drag(node, follow, act) {
    let active = null;
    node.addEventListener("pointerdown", (event) => {
      if (active || event.button || !event.target.closest("svg")) return;
      const { pointerId, pointerType, clientX, clientY } = event;
      const waits = pointerType === "touch";
      active = { pointerId, waits, from: [clientX, clientY], restore: act.snapshot() };
      node.setPointerCapture(pointerId);
      if (!waits) follow(event);
    });
    const own = (event) => active && event.pointerId === active.pointerId;
    node.addEventListener("pointermove", (event) => {
      if (!own(event)) return;
      const [x, y] = active.from;
      active.waits &&= Math.hypot(event.clientX - x, event.clientY - y) < STILL;
      if (!active.waits) follow(event);
    });
    node.addEventListener("pointerup", (event) => {
      if (!own(event)) return;
      if (active.waits) follow(event);
      active = null;
    });
    node.addEventListener("pointercancel", (event) => {
      if (!own(event)) return;
      act.restore(active.restore);
      active = null;
    });
  }

  // --- the panel ------------------------------------------------------------------------------------

  function picturesPanel(act, parts) {
    const makers = { inside: insidePicture, sweep: sweepPicture, map: mapPicture };
    const names = Object.keys(makers).filter((name) => parts.has(name));
    if (!names.length) return null;
    const pictures = Object.fromEntries(names.map((name) => [name, makers[name](act, parts)]));
    const options = names.map((value) => ({ value, text: TABS[value][0], title: TABS[value][1] }));
    const tabs = choice({ words: "picture", options, choose: act.picture, hidden: true });
    tabs.node.classList.add("tabs");
    tabs.node.hidden = names.length < 2;
    const bodies = names.map((name) => pictures[name].node);
    const chosen = (state) => pictures[state.picture] ?? pictures[names[0]];
    return {
      node: make("div", { class: "pictures" }, tabs.node, ...bodies),
      show(state, box) {
        tabs.show(names.includes(state.picture) ? state.picture : names[0]);
        for (const name of names) pictures[name].node.hidden = pictures[name] !== chosen(state);
        chosen(state).show(state, box);
      },
      move: (state, box) => chosen(state).move(state, box),
      resume: (state, box) => chosen(state).resume(box),
    };
  }

  panels.picturesPanel = picturesPanel;
})(globalThis.cradleExplorer);
