// Rows of controls that there may be any number of.
export function row(text: string, control: HTMLElement, value?: HTMLOutputElement): HTMLLabelElement {
  const label = document.createElement('label');
  label.append(text, ' ', control);
  if (value) label.append(' ', value);
  return label;
}
export function slider(
  text: string,
  [low, high]: readonly [number, number],
  now: number,
  say: (value: number) => string,
  change: (value: number) => void,
): HTMLLabelElement {
  const range = document.createElement('input'),
    value = document.createElement('output');
  Object.assign(range, { type: 'range', min: String(low), max: String(high), step: 'any', value: String(now) });
  range.name = text;
  value.textContent = say(now);
  range.addEventListener('input', () => {
    value.textContent = say(Number(range.value));
    range.setAttribute('aria-valuetext', value.textContent);
    change(Number(range.value));
  });
  return row(text, range, value);
}
export function button(text: string, click: () => void, label = text): HTMLButtonElement {
  const made = document.createElement('button');
  Object.assign(made, { type: 'button', textContent: text });
  if (label !== text) made.setAttribute('aria-label', label);
  made.addEventListener('click', click);
  return made;
}

/** Three digits. */
export const say = (value: number): string => String(Number(value.toPrecision(3))).replace('-', '−');
