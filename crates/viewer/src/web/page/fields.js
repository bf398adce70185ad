// Colours and lists as form fields show them.
const linear = v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
const curved = v => v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055;

/** A colour field's value as linear RGB, and back. */
export const toLinear = hex => [1, 3, 5].map(i => linear(parseInt(hex.slice(i, i + 2), 16) / 255));
export const toHex = rgb => '#' + rgb.map(v => Math.round(255 * curved(Math.max(0, Math.min(1, v)))).toString(16).padStart(2, '0')).join('');

/** Fills a list of choices, only when they have changed. */
export function options(id, list, value) {
  const element = document.getElementById(id), mark = JSON.stringify(list);
  if (element.dataset.mark !== mark) {
    element.dataset.mark = mark;
    element.replaceChildren(...list.map(([value, text]) => new Option(text, value)));
  }
  if (element.value !== String(value)) element.value = String(value);
}
