// Elements made from data. Texts become text, never HTML.
const SVG = 'http://www.w3.org/2000/svg';

export const byId = (id) => document.getElementById(id);

// `given`: class, aria-…, on… (a listener), other attributes; false and null leave one out.
export function el(tag, given = {}, ...children) {
  return filled(document.createElement(tag), given, children);
}

export function svg(tag, given = {}, ...children) {
  return filled(document.createElementNS(SVG, tag), given, children);
}

function filled(made, given, children) {
  for (const [name, value] of Object.entries(given)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith('on')) made.addEventListener(name.slice(2), value);
    else made.setAttribute(name, value === true ? '' : value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined && child !== false));
  return made;
}

export function button(words, press, given = {}) {
  return el('button', { type: 'button', onclick: press, ...given }, words);
}

// What is pressed stays until it is let go: a click on an element that was replaced meanwhile would be lost.
let pressed = null;
const later = new Map();
document.addEventListener('pointerdown', (event) => { pressed = event.target; }, true);
for (const kind of ['pointerup', 'pointercancel']) {
  document.addEventListener(kind, () => {
    pressed = null;
    setTimeout(() => { for (const [box, children] of later) if (!box.contains(pressed)) refill(box, ...children); });
  }, true);
}

// Replaces the children, and gives the focus back to the element of the same id.
export function refill(box, ...children) {
  later.delete(box);
  if (pressed && box.contains(pressed)) { later.set(box, children); return; }
  const active = document.activeElement, id = active && box.contains(active) ? active.id : '';
  box.replaceChildren(...children.filter((child) => child));
  if (id && byId(id)) byId(id).focus({ preventScroll: true });
}

export const degrees = ([lat, lon]) => `${lat.toFixed(6)}, ${lon.toFixed(6)}`;
