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

  // A slider with a box for exact numbers. A logarithmic one moves in equal factors.
  function slider({ words, low, high, step, logarithmic = false, unit = "", input }) {
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
      type: "number",
      min: low,
      max: high,
      step: "any",
      "aria-label": `${words}, as a number`,
      onchange: () =>
        box.value !== "" && box.checkValidity()
          ? give(+(+box.value).toFixed(6))
          : box.reportValidity(),
    });
    const label = make("label", { for: name }, words);
    const node = make(
      "div",
      { class: "slider" },
      label,
      range,
      box,
      make("span", { class: "unit" }, unit),
    );
    function give(number) {
      input(Math.min(Math.max(number, low), high));
    }
    // Several values are shown as such; the slider then stands at the first one.
    function show(values) {
      const one = values.every((v) => v === values[0]);
      if (document.activeElement !== range || !one) range.value = place(values[0]);
      else if (value(+range.value) !== values[0]) range.value = place(values[0]);
      if (document.activeElement !== box) box.value = one ? values[0] : "";
      box.placeholder = one ? "" : "mixed";
      const text = one ? `${values[0]} ${unit}`.trim() : `several values, ${values.join(", ")}`;
      range.setAttribute("aria-valuetext", text);
      node.classList.toggle("several", !one);
    }
    return { node, show, rename: (other) => (label.textContent = other) };
  }

  // One of several, as a row of radio buttons that look like a switch.
  function choice({ words, options, choose, hidden = false }) {
    const name = `explorer-${(names += 1)}`;
    const legend = make("legend", { class: hidden ? "unseen" : "" }, words);
    const node = make("fieldset", { class: "choice" }, legend);
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
        node.append(label);
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
