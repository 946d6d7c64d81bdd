// Start, vias and goal as text: typed or pasted in any form of the mission file, moved up and down by their buttons.
import { button, degrees, el, refill } from './dom.js';
import { known, on } from './hub.js';
import { change } from './link.js';
import { canvas, goTo } from './map.js';
import { enter } from './modes.js';
import { changeVia } from './route.js';

let box = null, waiting = null;

export function startPlaces() {
  box = el('section', { id: 'places', 'aria-label': 'Start, vias and goal' });
  on('state', show);
  on('asked', (n) => { if (waiting && !waiting.n) waiting.n = n; });
  on('error', (message) => {
    if (!waiting || message.n !== waiting.n) return;
    const problem = document.getElementById(`${waiting.id}-problem`);
    if (!problem) return;
    problem.textContent = message.message;
    problem.hidden = false;
    document.getElementById(waiting.id)?.setAttribute('aria-invalid', 'true');
  });
  on('plan', () => { waiting = null; });
  return box;
}

function show(state) {
  if (box.contains(document.activeElement) && document.activeElement.dataset.dirty) return;
  refill(box, ...state.vehicles.filter((v) => v.editable).flatMap((v, i) => ofVehicle(v, i, state.vehicles.length > 1)));
}

function ofVehicle(v, i, many) {
  const via = (k, text) => changeVia(v, v.via.map((old, j) => (j === k ? text : old)));
  const rows = [row(`place-${i}-start`, 'Start', v.start, (text) => change({ [`${v.key}.start`]: text }), 'start')];
  v.via.forEach((at, k) => rows.push(row(`place-${i}-via-${k}`, `Via ${k + 1}`, at, (text) => via(k, text), null, () => changeVia(v, v.via.filter((_, j) => j !== k)))));
  rows.push(row(`place-${i}-goal`, 'Goal', v.goal, (text) => change({ [`${v.key}.goal`]: text }), 'goal'));
  return [el('h2', {}, many ? v.name : 'Route'), ...rows];
}

function row(id, label, at, put, mode, remove) {
  const input = el('input', {
    id, type: 'text', value: at ? degrees(at) : '', placeholder: 'latitude, longitude; UTM; MGRS', autocomplete: 'off', spellcheck: 'false', 'aria-describedby': `${id}-problem`,
    oninput: () => { input.dataset.dirty = 'yes'; },
    onchange: () => {
      delete input.dataset.dirty;
      const text = input.value.trim();
      if (!text) return;
      waiting = { id, n: 0 };
      put(text);
    },
    onkeydown: (event) => { if (event.key === 'Escape') { delete input.dataset.dirty; input.value = at ? degrees(at) : ''; } },
  });
  const side = at ? button('◎', () => goTo(at), { 'aria-label': `Show ${label} on the map`, title: 'Show on the map' })
    : mode && known.state.stage === 'draft' ? button('Click', () => { enter(mode); canvas().focus({ preventScroll: true }); }, { 'aria-label': `Click ${label} on the map` }) : null;
  return el('div', { class: 'row' }, el('label', { for: id }, label), input, side,
    remove ? button('✕', remove, { id: `${id}-remove`, 'aria-label': `Remove ${label}`, title: 'Remove' }) : null,
    el('p', { class: 'problem', id: `${id}-problem`, role: 'alert', hidden: true }));
}
