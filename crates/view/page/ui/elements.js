// Small builders of controls. Texts of datasets are only ever set as text, never as markup.

export function element(name, properties = {}, ...children) {
  const made = document.createElement(name);
  const { dataset, ...rest } = properties;
  Object.assign(made, rest);
  Object.assign(made.dataset, dataset ?? {});
  made.append(...children);
  return made;
}

const row = (title, ...controls) => element("label", {}, element("span", { textContent: title }), ...controls);

/** A slider with its value beside it. `show` makes text of the position. */
export function slider(title, { min, max, step, value, show = String }, onInput) {
  const shown = element("span", { className: "value", textContent: show(value) });
  const input = element("input", { type: "range", min, max, step, value, title });
  input.value = value;
  input.oninput = () => {
    shown.textContent = show(Number(input.value));
    onInput(Number(input.value));
  };
  const made = row(title, input, shown);
  made.set = (next) => {
    input.value = next;
    shown.textContent = show(next);
  };
  return made;
}

export function choice(title, options, value, onChange) {
  const select = element("select", { title });
  for (const option of options) {
    const [key, text] = Array.isArray(option) ? option : [option, option];
    select.append(element("option", { value: key, textContent: text, selected: key === value }));
  }
  select.onchange = () => onChange(select.value);
  const made = row(title, select);
  made.set = (next) => (select.value = next);
  return made;
}

export function check(title, value, onChange) {
  const input = element("input", { type: "checkbox", checked: value });
  input.onchange = () => onChange(input.checked);
  const made = row(title, input);
  made.set = (next) => (input.checked = next);
  return made;
}

/** Two numbers that are typed. */
export function range(title, value, onChange) {
  const inputs = [0, 1].map((i) => {
    const input = element("input", { type: "number", step: "any", value: value[i], title: `${title}, ${i ? "end" : "start"}` });
    input.onchange = () => {
      // a field that is empty, or no number, says nothing
      const typed = inputs.map((each) => each.valueAsNumber);
      if (typed.every(Number.isFinite)) onChange(typed);
    };
    return input;
  });
  const made = row(title, ...inputs);
  made.set = (next) => inputs.forEach((input, i) => (input.value = round(next[i])));
  made.set(value);
  return made;
}

/** A slider between two numbers, and the number itself, which can be typed to any digit. */
export function place(title, { min, max, value }, onInput) {
  const extent = max - min || 1;
  // a thousandth of the extent is told, whatever the size of the coordinates
  const digits = Math.min(Math.max(Math.ceil(3 - Math.log10(extent)), 0), 9);
  const slide = element("input", { type: "range", min: 0, max: 1, step: 0.001, title: `${title}, slider` });
  const typed = element("input", { type: "number", step: "any", title });
  const made = row(title, slide, typed);
  made.className = "place";
  made.set = (next) => {
    slide.value = (next - min) / extent;
    typed.value = next.toFixed(digits);
  };
  slide.oninput = () => {
    const next = Number(slide.value) === 1 ? max : min + Number(slide.value) * extent; // the very end, without rounding
    typed.value = next.toFixed(digits);
    onInput(next);
  };
  typed.onchange = () => {
    const next = typed.valueAsNumber;
    if (!Number.isFinite(next)) return;
    slide.value = (next - min) / extent;
    onInput(next);
  };
  made.set(value);
  return made;
}

const round = (x) => Number(Number(x).toPrecision(9));

export function button(text, title, onClick) {
  return element("button", { type: "button", textContent: text, title, onclick: onClick });
}

export function section(title, isOpen, ...children) {
  return element("details", { open: isOpen }, element("summary", { textContent: title }), ...children);
}
