// The vehicles: chosen, added by two clicks, renamed, removed; and how they arrive, in words and numbers.
import { button, el, refill } from './dom.js';
import { known, on } from './hub.js';
import { addGrip, removeGrip } from './grips.js';
import { change, send } from './link.js';
import { canvas } from './map.js';
import { addMode, enter, leave } from './modes.js';

// What a second vehicle begins with, shown and changed like all else.
const FIRST_RULE = { 'arrival.mode': 'sequence', 'arrival.interval_s': 30, 'arrival.separation_m': 30 };
const MODES = [['', 'no rule: nothing keeps them apart'], ['sequence', 'one after the other'], ['together', 'all at the same time'], ['none', 'each as soon as it can']];
const WAITS = [['ground', 'on the ground'], ['gate', 'in the air, at its first point'], ['none', 'nowhere']];
export const MOST_SHOWN = 12; // of more vehicles than this, the chosen one alone has points that are dragged
let box = null, begun = null, open = false;

export const many = () => Boolean(known.state) && known.state.vehicles.length > 1;
export const toneOf = (vehicle) => `t${vehicle % 8}`;

export function choose(vehicle) {
  if (known.state && known.state.vehicle !== vehicle && vehicle < known.state.vehicles.length) send({ type: 'vehicle', vehicle });
}

export function startFleet() {
  box = el('section', { id: 'fleet', 'aria-label': 'Vehicles' });
  const next = () => `vehicle ${known.state.vehicles.length + 1}`, end = () => { if (begun) removeGrip(begun); begun = null; };
  addMode({ name: 'crew-start', hint: () => `Click where ${next()} takes off.`, click: (at) => { enter('crew-goal', at); canvas().focus({ preventScroll: true }); } });
  addMode({
    name: 'crew-goal', hint: () => `Click where ${next()} flies to.`, leave: end,
    enter: (at) => { begun = addGrip({ id: 'crew-begun', kind: 'start', tone: toneOf(known.state.vehicles.length), label: `start of ${next()}`, words: next(), at }); },
    click: (goal) => { const start = begun.at; leave(); add(start, goal); },
  });
  on('state', show);
  on('plan', show);
  return box;
}

function add(start, goal) {
  const { vehicles, arrival, vehicle } = known.state;
  change({ [`vehicles[${vehicles.length}]`]: { start, goal, like: vehicle }, ...(vehicles.length === 1 && !arrival ? FIRST_RULE : {}) });
}

function show() {
  const { state } = known;
  if (state.stage !== 'mission') { box.replaceChildren(); return; }
  if (box.querySelector('[data-dirty]')) return; // what is being typed stays
  const adding = button('Add a vehicle', () => { enter('crew-start'); canvas().focus({ preventScroll: true }); }, { id: 'vehicle-add', class: 'wide', title: 'Click its start, then its goal; it has the settings of the chosen vehicle' });
  if (!many()) { refill(box, adding); return; }
  refill(box, el('h2', {}, 'Vehicles'), el('ul', { class: 'list crew' }, ...state.vehicles.map(row)), state.vehicles.length > MOST_SHOWN ? el('p', { class: 'note' }, `Of ${state.vehicles.length} vehicles the chosen one alone has points and a profile; a click on a name chooses another.`) : null, adding, arrivals(state));
}

function row(v, k) {
  const mine = k === known.state.vehicle, fleet = known.plan && known.plan.fleet, slot = fleet && fleet.rows.find((r) => r.vehicle === k && r.name === v.name);
  const out = known.plan && known.plan.left_out.find((l) => l.name === v.name);
  const name = el('input', {
    id: 'vehicle-name', type: 'text', value: v.name, 'aria-label': `Name of ${v.name}`, autocomplete: 'off', spellcheck: 'false', oninput: () => { name.dataset.dirty = 'yes'; },
    onchange: () => { delete name.dataset.dirty; const text = name.value.trim(); if (text && text !== v.name) change({ [`${v.key}.name`]: text }); else name.value = v.name; },
  });
  return el('li', { class: mine ? 'chosen' : null }, el('i', { class: `swatch ${toneOf(k)}`, 'aria-hidden': 'true' }),
    button(v.name, () => choose(k), { id: `vehicle-${k}`, class: 'item', 'aria-pressed': String(mine) }),
    el('small', { class: out ? 'bad' : null, title: out ? out.message : null }, out ? 'left out' : slot ? `arrives ${duration(slot.arrive_s)}` : ''),
    out ? el('p', { class: 'problem' }, out.message) : null,
    mine ? el('div', { class: 'row editor' }, el('label', { for: 'vehicle-name' }, 'Name'), name, button('Remove', () => change({ [v.key]: null }), { id: 'vehicle-remove', 'aria-label': `Remove ${v.name}` })) : null);
}

// -- how they arrive --------------------------------------------------------------------------------------------------

// Seconds, or minutes and seconds with colons; NaN for what is neither.
export function seconds(text) {
  const parts = text.trim().replace(',', '.').split(':');
  return parts.length > 3 || parts.some((p) => !/^\d+(\.\d+)?$/.test(p)) ? NaN : parts.reduce((all, p) => 60 * all + Number(p), 0);
}

function arrivals({ arrival }) {
  const a = arrival || {}, distance = known.state.units.kinds.distance;
  const put = (changes) => change(Object.fromEntries(Object.entries(changes).map(([key, value]) => [`arrival.${key}`, value])));
  const mode = choice('mode', 'They arrive', MODES, a.mode || '', (value) => {
    if (value === '') change({ arrival: null });
    else put({ mode: value, ...(value === 'sequence' && a.interval_s === undefined ? { interval_s: 30 } : {}), ...(a.separation_m === undefined ? { separation_m: 30 } : {}) });
  });
  const rows = [mode];
  if (a.mode === 'sequence') rows.push(field('interval_s', 'Seconds apart', a.interval_s, 's', seconds, (v) => put({ interval_s: v }), true));
  if (a.mode === 'sequence' || a.mode === 'together') {
    rows.push(field('arrive_s', a.mode === 'together' ? 'All after' : 'First after', a.arrive_s, 's', seconds, (v) => put({ arrive_s: v }), false, 'as soon as it can'));
    rows.push(choice('hold', 'Who is early waits', WAITS, a.hold || 'ground', (value) => put({ hold: value })));
  }
  if (a.mode === 'sequence') rows.push(check('best', 'Find the best order', a.order === 'best', (yes) => put({ order: yes ? 'best' : null })));
  if (a.mode) {
    const metres = (text) => (/^\d+([.,]\d+)?$/.test(text.trim()) ? Number((Number(text.trim().replace(',', '.')) * distance[1]).toPrecision(12)) : NaN);
    rows.push(field('separation_m', 'Least distance', a.separation_m === undefined ? undefined : Number((a.separation_m / distance[1]).toPrecision(7)), distance[0], metres, (v) => put({ separation_m: v }), false, '30 m'));
    rows.push(check('leave', 'Leave out who has no mission', a.leave_out === true, (yes) => put({ leave_out: yes ? true : null })));
  }
  return el('details', { id: 'arrival', open, ontoggle: (event) => { open = event.target.open; } }, el('summary', { id: 'arrival-summary' }, 'Arrival'), ...rows);
}

function choice(id, label, list, value, put) {
  const made = el('select', { id: `arrival-${id}`, onchange: () => put(made.value) }, ...list.map(([v, words]) => el('option', { value: v, selected: v === value }, words)));
  return el('div', { class: 'row' }, el('label', { for: `arrival-${id}` }, label), made);
}

function check(id, label, on_, put) {
  return el('label', { class: 'choice' }, el('input', { id: `arrival-${id}`, type: 'checkbox', checked: on_, onchange: (event) => put(event.target.checked) }), el('span', {}, label));
}

function field(id, label, value, unit, read, put, needed, placeholder = '') {
  const problem = el('p', { class: 'problem', id: `arrival-${id}-problem`, role: 'alert', hidden: true });
  const mistake = known.state.problems.find((p) => p.where === `arrival.${id}`);
  const say = (words) => { problem.textContent = words; problem.hidden = !words; input.setAttribute('aria-invalid', String(Boolean(words))); };
  const input = el('input', {
    id: `arrival-${id}`, type: 'text', inputmode: 'decimal', value: value === undefined ? '' : String(value), placeholder, autocomplete: 'off', 'aria-describedby': problem.id, oninput: () => { input.dataset.dirty = 'yes'; },
    onchange: () => {
      const text = input.value.trim(), found = text === '' ? null : read(text);
      if (Number.isNaN(found) || (needed && found === null)) { say('This is no number.'); return; }
      delete input.dataset.dirty;
      say('');
      put(found);
    },
  });
  say(mistake ? mistake.message : '');
  return el('div', { class: 'row' }, el('label', { for: input.id }, label), input, el('span', { class: 'unit' }, unit), problem);
}
