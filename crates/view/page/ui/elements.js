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
    input.onchange = () => onChange(inputs.map((each) => Number(each.value)));
    return input;
  });
  const made = row(title, ...inputs);
  made.set = (next) => inputs.forEach((input, i) => (input.value = round(next[i])));
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
