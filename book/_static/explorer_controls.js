// Buttons, sliders and choices as plain form elements, which keyboards and screen readers know.
(function (explorer) {
  "use strict";
  let names = 0;

  // make("p", {class: "words"}, "text", node, ...)
  function make(kind, attributes = {}, ...children) {
    const node = document.createElement(kind);
    for (const [name, value] of Object.entries(attributes)) {
      if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
      else if (value !== false) node.setAttribute(name, value === true ? "" : value);
    }
    node.append(...children);
    return node;
  }

  function button(words, press, attributes = {}) {
    return make("button", { type: "button", onclick: press, ...attributes }, words);
  }

  // A number as people type it: with a point, a comma or a typographic minus; else NaN. A box of
  // type "number" would drop a comma where the browser's language has none, and take 1,5 for 15.
  function typed(words) {
    const text = words.trim().replace(",", ".").replace("\u2212", "-");
    return /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i.test(text) ? Number(text) : NaN;
  }

  // 1,000 is one in some countries and a thousand in others.
  const twofold = (words) => /^[-+]?[1-9]\d{0,2},\d{3}$/.test(words.trim());

  // A slider with a box for exact numbers. A logarithmic one moves in equal factors. What the box
  // cannot take stays in it, marked, with a sentence below, until the setting changes.
  function slider({ words, called = words, low, high, step, logarithmic = false, unit = "", input }) {
    const name = `explorer-${(names += 1)}`;
    const place = (value) => (logarithmic ? Math.log10(value) : value);
    const value = (at) => (logarithmic ? +(10 ** at).toPrecision(2) : at);
    const range = make("input", {
      type: "range",
      id: name,
      min: place(low),
      max: place(high),
      step,
      oninput: () => give(value(+range.value)),
    });
    const box = make("input", {
      type: "text",
      inputmode: low < 0 ? "text" : "decimal", // the decimal keys of some phones have no minus
      autocomplete: "off",
      "aria-label": `${words}, as a number`,
      "aria-describedby": `${name}-refused`,
      onchange: () => {
        refuse(objection());
        if (!refused.textContent) give(typed(box.value));
      },
    });
    const refused = make("p", { class: "refused", id: `${name}-refused`, role: "alert" });
    let shown = {};
    const label = make("label", { for: name }, words);
    const node = make(
      "div",
      { class: "slider" },
      label,
      range,
      box,
      make("span", { class: "unit" }, unit),
      refused,
    );
    const measure = (number) => `${number} ${unit}`.trim();
    function objection() {
      if (twofold(box.value)) {
        const [small, large] = [".", ""].map((point) => Number(box.value.replace(",", point)));
        return `could be ${small} or ${large}: please write one of these`;
      }
      const number = typed(box.value);
      if (Number.isNaN(number)) return "needs a number, such as 0.5";
      if (!(low <= number && number <= high))
        return `must lie between ${low} and ${measure(high)}`;
      return +number.toFixed(6) === number ? "" : "can have six digits after the point";
    }
    function refuse(why) {
      box.setAttribute("aria-invalid", why !== "");
      refused.textContent = why && `${called} ${why}. In force: ${shown.text}.`.replaceAll(" -", " \u2212");
    }
    function give(number) {
      input(Math.min(Math.max(number, low), high));
    }
    // Several values of a setting are shown as such; the slider then stands at the first one.
    // Without any it is hidden.
    function show(values, setting) {
      node.hidden = values.length === 0;
      const one = values.every((v) => v === values[0]);
      const text = one ? measure(values[0]) : `several values, ${values.join(", ")}`;
      if (setting !== shown.setting || text !== shown.text) refuse("");
      shown = { setting, text };
      if (node.hidden) return;
      if (document.activeElement !== range || !one) range.value = place(values[0]);
      else if (value(+range.value) !== values[0]) range.value = place(values[0]);
      if (document.activeElement !== box && !refused.textContent) box.value = one ? values[0] : "";
      box.placeholder = one ? "" : "mixed";
      range.setAttribute("aria-valuetext", text);
      node.classList.toggle("several", !one);
    }
    return { node, show, rename: (other) => (label.textContent = other) };
  }

  // One of several, as a row of radio buttons that look like a switch.
  function choice({ words, options, choose, hidden = false }) {
    const name = `explorer-${(names += 1)}`;
    // No fieldset: engines do not agree where its legend goes in a row.
    const legend = make("span", { class: hidden ? "unseen" : "legend", id: `${name}-legend` }, words);
    // A group of their own: where it does not fit beside the words it goes below them as a whole.
    const group = make("span", { class: "options" });
    const node = make(
      "div",
      { class: "choice", role: "radiogroup", "aria-labelledby": legend.id },
      legend,
      group,
    );
    let inputs = [];
    function offer(list) {
      inputs.forEach(({ label }) => label.remove());
      inputs = list.map(({ value, text, title, colour }) => {
        const input = make("input", { type: "radio", name, value, onchange: () => choose(value) });
        const label = make(
          "label",
          title ? { title } : {},
          input,
          make("span", colour ? { class: "coloured", style: `--ball: ${colour}` } : {}, text),
        );
        group.append(label);
        return { input, label, value };
      });
    }
    function show(value) {
      inputs.forEach(({ input, value: own }) => (input.checked = own === value));
    }
    offer(options);
    return { node, offer, show };
  }

  function select({ words, options, choose, hidden = false }) {
    const name = `explorer-${(names += 1)}`;
    const list = make("select", { id: name, onchange: () => choose(list.value) });
    const label = make("label", { for: name, class: hidden ? "unseen" : "" }, words);
    const node = make("div", { class: "select" }, label, list);
    function offer(groups) {
      list.replaceChildren(
        ...groups.flatMap(({ group, entries }) => {
          const nodes = entries.map(({ value, text }) => make("option", { value }, text));
          return group ? [make("optgroup", { label: group }, ...nodes)] : nodes;
        }),
      );
    }
    offer(options);
    return { node, offer, show: (value) => (list.value = value) };
  }

  explorer.controls = { button, choice, make, select, slider };
})(globalThis.cradleExplorer);
