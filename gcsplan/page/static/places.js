// Start, vias and goal as text: typed or pasted in any form of the mission file, moved up and down by their buttons.
import { button, degrees, el, refill } from './dom.js';
import { known, on } from './hub.js';
import { change, send } from './link.js';
import { canvas, goTo } from './map.js';
import { enter } from './modes.js';
import { changeVia } from './route.js';

let box = null;
let waiting = null; // a text that the server reads as a place before the mission gets it: {id, n, put}

export function startPlaces() {
  box = el('section', { id: 'places', 'aria-label': 'Start, vias and goal' });
  on('state', show);
  on('place', (message) => {
    if (!waiting || message.n !== waiting.n) return;
    const { put } = waiting;
    say('');
    waiting = null;
    put();
  });
  on('error', (message) => { if (waiting && message.n === waiting.n) say(message.message); });
  return box;
}

function say(words) {
  const input = document.getElementById(waiting.id), problem = document.getElementById(`${waiting.id}-problem`);
  if (!input) return;
  problem.textContent = words;
  problem.hidden = !words;
  input.setAttribute('aria-invalid', String(Boolean(words)));
  if (!words) delete input.dataset.dirty;
}

function show(state) {
  if (box.querySelector('[data-dirty]')) return; // what is being typed stays
  refill(box, ...state.vehicles.flatMap((v, i) => (v.editable && i === state.vehicle ? ofVehicle(v, i, state.vehicles.length > 1) : [])));
}

function ofVehicle(v, i, many) {
  const via = (k, text) => changeVia(v, v.via.map((old, j) => (j === k ? text : old)));
  const rows = [row(`place-${i}-start`, 'Start', v.start, (text) => change({ [`${v.key}.start`]: text }), 'start')];
  v.via.forEach((at, k) => rows.push(row(`place-${i}-via-${k}`, `Via ${k + 1}`, at, (text) => via(k, text), null, () => changeVia(v, v.via.filter((_, j) => j !== k)))));
  rows.push(row(`place-${i}-goal`, 'Goal', v.goal, (text) => change({ [`${v.key}.goal`]: text }), 'goal'));
  return [el('h2', {}, many ? `Route of ${v.name}` : 'Route'), ...rows];
}

function row(id, label, at, put, mode, remove) {
  const input = el('input', {
    id, type: 'text', value: at ? degrees(at) : '', placeholder: 'latitude, longitude; UTM; MGRS', autocomplete: 'off', spellcheck: 'false', 'aria-describedby': `${id}-problem`,
    oninput: () => { input.dataset.dirty = 'yes'; },
    onchange: () => {
      const text = input.value.trim();
      if (text) waiting = { id, n: send({ type: 'place', text }), put: () => put(text) };
      else restore();
    },
    onkeydown: (event) => { if (event.key === 'Escape') restore(); },
  });
  const restore = () => {
    waiting = { id };
    say('');
    waiting = null;
    input.value = at ? degrees(at) : '';
  };
  const side = at ? button('◎', () => goTo(at), { 'aria-label': `Show ${label} on the map`, title: 'Show on the map' })
    : mode && known.state.stage === 'draft' ? button('Click', () => { enter(mode); canvas().focus({ preventScroll: true }); }, { 'aria-label': `Click ${label} on the map` }) : null;
  return el('div', { class: 'row' }, el('label', { for: id }, label), input, side,
    remove ? button('✕', remove, { id: `${id}-remove`, 'aria-label': `Remove ${label}`, title: 'Remove' }) : null,
    el('p', { class: 'problem', id: `${id}-problem`, role: 'alert', hidden: true }));
}
