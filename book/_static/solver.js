// The reader's own solver of three balls, in pieces: an editor, a button, single calls and five
// impacts. The lines run in a worker with Brython, which is loaded at the first press
// (book/_ext/reader_solver.py writes it), so an endless loop holds up nothing and can be stopped.
(function (data) {
  "use strict";
  const { texts, calls, checks } = data;
  const PYTHON = document.currentScript.src.replace(/solver\.js.*/, "solver_python.js");
  const SAME = 1e-9; // m/s
  const MOST = 12; // numbers of a row that are shown
  const LONG = 4000; // milliseconds after which a run may be endless
  const LONGEST = 20000; // milliseconds of a run; one without end may fill all memory
  const KEEP = 500; // milliseconds after the last letter

  function make(kind, attributes = {}, ...children) {
    const node = document.createElement(kind);
    for (const [name, value] of Object.entries(attributes)) {
      if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
      else node.setAttribute(name, value);
    }
    node.append(...children);
    return node;
  }

  // Whoever comes back to the page, or loads it again, finds what was written, by the piece; also
  // after a link to a place in it.
  const kept = { ...history.state };
  let keeping = 0;
  const keep = () => history.replaceState({ ...history.state, ...kept }, "");
  addEventListener("hashchange", keep);

  let loading = null;
  const python = () =>
    (loading ??= new Promise((done, refuse) => {
      const script = make("script", { src: PYTHON, onload: done, onerror: refuse });
      document.head.append(script);
    }));

  const shown = (v) => (v === null ? "no number" : Number.isFinite(v) ? String(+v.toPrecision(6) + 0) : "inf");
  const row = (values) =>
    values.slice(0, MOST).map(shown).join(", ").replaceAll("-", "\u2212") + (values.length > MOST ? ", \u2026" : "");
  const rows = (all) => all.map(row).join("; ");
  const numbers = (text) => JSON.parse(text.replace(/-?nan/g, "null").replaceAll("inf", "1e999"));
  const same = (v, w) => v === w || (v !== null && Math.abs(v - w) <= SAME);
  const agrees = (found, expected) =>
    found.length === expected.length &&
    expected.every((w, k) => (Array.isArray(w) ? agrees(found[k], w) : same(found[k], w)));

  function solver(host) {
    const piece = host.dataset.piece ?? "";
    const { own, rest } = texts[piece];
    let worker = null;
    let running = false; // or Python is being loaded for it
    let timers = [];

    // --- the editor -----------------------------------------------------------------------------
    const count = make("pre", { class: "count", "aria-hidden": true });
    const editor = make("textarea", {
      spellcheck: false,
      autocapitalize: "off",
      autocomplete: "off",
      wrap: "off",
      "aria-label": `your ${piece || "solver"}, in Python`,
      oninput: () => {
        number();
        kept[piece] = editor.value;
        clearTimeout(keeping);
        keeping = setTimeout(keep, KEEP);
      },
      onkeydown: (event) => key(event),
    });
    function number() {
      const rows = editor.value.split("\n").length;
      editor.rows = rows;
      count.textContent = Array.from({ length: rows }, (_, k) => k + 1).join("\n");
    }
    function key(event) {
      if (event.key !== "Enter" || event.isComposing) return;
      if (event.ctrlKey || event.metaKey) run();
      else {
        // A new line begins below the one before; after a colon, further in.
        const [above] = editor.value.slice(0, editor.selectionStart).split("\n").slice(-1);
        const inset = /^ */.exec(above)[0] + (/:\s*$/.test(above) ? "    " : "");
        document.execCommand("insertText", false, `\n${inset}`);
      }
      event.preventDefault();
    }
    // --- what comes out -------------------------------------------------------------------------
    const start = make("button", { type: "button", class: "main", onclick: () => run() }, "Run");
    const halt = make("button", { type: "button", onclick: () => worker && stop("Stopped.") }, "Stop");
    const told = make("span", { class: "told", role: "status" });
    const printed = make("pre", { class: "printed", role: "region", "aria-label": "what your lines print" });
    const wrong = make("pre", { class: "wrong", role: "alert" });
    // First single calls of the reader's function, then whole impacts.
    const first = calls[piece] ?? [];
    const asked = [
      ...first,
      ...checks.map(({ given, expected }) => ({
        asked: `[three_balls(${given.map((value) => JSON.stringify(value)).join(", ")})[-1][2]]`,
        expected: [expected],
        unit: " m/s",
      })),
    ];
    const results = asked.map(() => make("p", {}));
    const single = make(
      "ul",
      { hidden: "" },
      ...first.map(({ asked }, k) => make("li", {}, make("code", {}, asked), results[k])),
    );
    const list = make(
      "ol",
      { hidden: "" },
      ...checks.map(({ title, given: [masses, velocities, restitution, ratio] }, k) => {
        const words =
          `masses ${row(masses)} kg; velocities ${row(velocities)} m/s; ` +
          `restitution ${row(restitution)}; ratio ${ratio}`;
        return make("li", {}, make("b", {}, `${title}. `), words, results[first.length + k]);
      }),
    );

    function show(number, text) {
      const { expected, unit = "" } = asked[number];
      const found = numbers(text);
      const passed = agrees(found, expected);
      results[number].className = passed ? "passed" : "missed";
      results[number].textContent = passed
        ? `\u2713 passed: ${rows(expected)}${unit}`
        : `not yet: ${rows(found)}${unit} came out; ${unit ? "cradle has" : "expected"} ${rows(expected)}${unit}`;
    }
    function reveal(is) {
      single.hidden = !is || !first.length;
      list.hidden = !is;
    }
    // A button that may not be pressed keeps the focus of who has pressed it.
    function may(run, stop) {
      start.setAttribute("aria-disabled", !run);
      halt.setAttribute("aria-disabled", !stop);
    }
    function stop(words) {
      worker?.terminate();
      worker = null;
      running = false;
      timers.forEach(clearTimeout);
      may(true, false);
      told.textContent = words;
    }
    function hear(code, { printed: text, number: check, found, broken, error, line, done }) {
      if (text) printed.textContent += text;
      printed.tabIndex = 0; // it scrolls; the theme takes no key to what was empty
      if (found) show(check, found);
      if (broken) results[check].textContent = "an error: no answer";
      const empty = line && error?.includes("NotImplementedError");
      if (error && !empty) wrong.textContent = error.trim();
      if (error && line && editor.value === code) mark(line);
      if (!done) return;
      const passed = list.querySelectorAll(".passed").length;
      const missed = single.querySelectorAll(".missed").length;
      const but = missed ? `, but ${missed} of ${first.length} calls failed` : "";
      if (empty) {
        reveal(false);
        stop(`Write your lines at line ${line}.`);
      } else stop(error ? `An error${line ? ` in line ${line}` : ""}.` : `${passed} of ${checks.length} checks passed${but}.`);
    }
    // The line of an error is selected, so that it is seen.
    function mark(line) {
      const rows = editor.value.split("\n");
      const from = rows.slice(0, line - 1).reduce((sum, text) => sum + text.length + 1, 0);
      editor.setSelectionRange(from, from + (rows[line - 1] ?? "").length);
      editor.focus({ preventScroll: true });
    }
    async function run() {
      if (running) return;
      running = true;
      may(false, false);
      told.textContent = "Python is being loaded \u2026";
      printed.textContent = wrong.textContent = "";
      results.forEach((result) => Object.assign(result, { className: "", textContent: "" }));
      try {
        await python();
      } catch {
        loading = null;
        stop("Python could not be loaded.");
        return;
      }
      const code = new Blob([globalThis.cradlePython], { type: "text/javascript" });
      const address = URL.createObjectURL(code);
      const own = (worker = new Worker(address));
      URL.revokeObjectURL(address);
      const written = editor.value;
      const listen = (said) => own === worker && hear(written, said); // not to one that was stopped
      own.onmessage = ({ data }) => listen(data);
      own.onerror = ({ message }) => listen({ error: message, done: true });
      own.postMessage({ code: written, rest, asked: asked.map(({ asked }) => asked) });
      reveal(true);
      may(false, true);
      told.textContent = "running \u2026";
      const bound = "bound it: for k in range(100).";
      timers = [
        setTimeout(() => (told.textContent = `Still running. If a loop has no end, press Stop and ${bound}`), LONG),
        setTimeout(() => stop(`Stopped after ${LONGEST / 1000} s. If a loop has no end, ${bound}`), LONGEST),
      ];
    }

    host.replaceChildren(
      piece ? make("p", { class: "turn" }, "Your turn: ", make("code", {}, piece)) : "",
      make("div", { class: "editor" }, count, editor),
      make("div", { class: "run" }, start, halt, told),
      wrong,
      printed,
      single,
      list,
    );
    host.classList.add("live");
    may(true, false);
    editor.value = kept[piece] ?? own;
    number();
  }

  document.querySelectorAll(".reader-solver").forEach(solver);
})(globalThis.cradleSolver);
