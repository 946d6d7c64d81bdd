// Every key of the mission, section by section, and the mission's text beside them: what changes on one side changes on the other.
import { button, byId, el } from './dom.js';
import { fillField, removal, rowOf } from './fields.js';
import { known, on } from './hub.js';
import { change, send, step } from './link.js';
import { across_m, middle } from './map.js';
import { enter } from './modes.js';
import { add } from './zones.js';

const MOST_BYTES = 240000, MOST_ENTRIES = 500;
const OFTEN = [['', 'Mission'], ['terrain', 'Terrain'], ['limits', 'Limits of all'], ['planner', 'Planner'], ['wind', 'Wind'], ['arrival', 'Arrival'], ['frame', 'Local frame']];
let sheet = null, section = 'limits', drawn = '', asked = 0, text = null, base = '';

export function startKeys() {
  sheet = el('section', { id: 'sheet', 'aria-label': 'All keys and the text of the mission', hidden: true },
    el('header', {}, el('h2', {}, 'All keys'), el('label', {}, el('span', {}, 'Section '), el('select', { id: 'section', onchange: (event) => { section = event.target.value; ask(); } })),
      button('✕', close, { id: 'keys-close', class: 'close', 'aria-label': 'Close all keys', title: 'Escape' })),
    el('div', { id: 'fields' }), yamlPart());
  byId('place').after(sheet);
  sheet.addEventListener('keydown', (event) => { if (event.key === 'Escape') { event.stopPropagation(); close(); } });
  on('state', (state) => {
    if (state.stage !== 'mission') { close(); return; }
    if (!sheet.hidden) ask();
  });
  on('section', fill);
  on('text', take);
  on('error', mistakes);
  return el('section', { id: 'keys', 'aria-label': 'All keys' }, button('All keys and the text', open, { id: 'keys-open', class: 'wide', 'aria-expanded': 'false' }));
}

function open() {
  sheet.hidden = false;
  byId('keys-open')?.setAttribute('aria-expanded', 'true');
  ask();
  byId('section').focus();
}

function close() {
  if (sheet.hidden) return;
  sheet.hidden = true;
  const opener = byId('keys-open');
  opener?.setAttribute('aria-expanded', 'false');
  opener?.focus();
}

// The form and the text as they are now.
function ask() {
  const { vehicles, zones, counts } = known.state, named = new Map(zones.features.map((f) => [f.properties.key, f.properties]));
  const entries = Object.entries(counts).flatMap(([list, count]) => Array.from({ length: Math.min(count, MOST_ENTRIES) }, (_, k) => {
    const key = `${list}[${k}]`, zone = named.get(key);
    return [key, zone && zone.shape !== 'file' ? `Zone ${zone.name}` : `Zones of ${key}`];
  }));
  const all = [...OFTEN, ...vehicles.flatMap((v) => [[v.key, `Vehicle ${v.name}`], [`${v.key}.limits`, `Limits of ${v.name}`], [`${v.key}.energy`, `Energy of ${v.name}`]]), ...entries];
  if (!all.some(([key]) => key === section)) section = 'limits';
  const choice = byId('section');
  choice.replaceChildren(...all.map(([key, words]) => el('option', { value: key, selected: key === section }, words)));
  send({ type: 'section', section });
  asked = send({ type: 'text' });
}

function fill(message) {
  if (message.section !== section) return;
  const keys = JSON.stringify([section, message.may_go, message.there, known.state.counts, known.state.vehicles.length, message.fields.map((f) => [f.key, f.kind, Boolean(f.list)]), known.state.units.name]), box = byId('fields');
  if (keys !== drawn) {
    drawn = keys;
    box.replaceChildren(listActs(), ...(message.there ? [] : [el('p', { class: 'note' }, 'The mission does not have this section: the first value adds it.')]), ...message.fields.map((f) => rowOf(f, 'key', true)), ...(message.may_go ? [removal(section)] : []));
  }
  for (const field of message.fields) fillField(box, field, 'key');
}

// What the lists of vehicles, zones and areas gain, lose and reorder.
function listActs() {
  const { counts, vehicles } = known.state, found = /^(vehicles|no_fly|keep_in)\[(\d+)\]/.exec(section), list = found && found[1], k = found && Number(found[2]);
  const count = { ...counts, vehicles: vehicles.length }[list];
  const move = (to) => { step({ type: 'arrange', list, from: k, to }); section = `${list}[${to}]`; };
  const area = (where, part, word) => { section = add({ center: middle(), radius_m: Math.max(1, Math.round(across_m() / part)) }, where, word); };
  return el('div', { class: 'buttons', id: 'list-acts', role: 'toolbar', 'aria-label': 'Lists of the mission' },
    ...(found ? [button('↑ Earlier', () => move(k - 1), { id: 'entry-up', disabled: k === 0 }), button('↓ Later', () => move(k + 1), { id: 'entry-down', disabled: k === count - 1 }),
      button('Remove it', () => change({ [`${list}[${k}]`]: null }), { id: 'entry-remove', disabled: list === 'vehicles' && count < 2 })] : []),
    button('Add a vehicle', () => { close(); enter('crew-start'); }, { id: 'add-vehicle', title: 'Click its start, then its goal' }),
    button('Add a no-fly zone', () => area('no_fly', 16, 'zone'), { id: 'add-no-fly', title: 'A circle in the middle of the map' }),
    button('Add an area to stay inside', () => area('keep_in', 2, 'area'), { id: 'add-keep-in', title: 'A circle as wide as the map' }));
}

// -- the text ---------------------------------------------------------------------------------------------------------

function yamlPart() {
  text = el('textarea', { id: 'yaml', 'aria-label': 'The text of the mission, YAML', 'aria-describedby': 'yaml-problems yaml-note', spellcheck: 'false', autocomplete: 'off', wrap: 'off', oninput: typed, onkeydown: (event) => { if (event.key === 'Enter' && (event.ctrlKey || event.metaKey)) { event.preventDefault(); write(); } } });
  return el('div', { id: 'yaml-part' }, el('ul', { id: 'yaml-problems', class: 'problems', role: 'alert', hidden: true }), text,
    el('p', { id: 'yaml-note', class: 'note' }, ''),
    el('p', { class: 'buttons' }, button('Take the text', write, { id: 'yaml-take', class: 'main', disabled: true, title: 'Ctrl-Enter' }), button('Back to the mission’s own', () => { base = ''; text.value = ''; ask(); }, { id: 'yaml-back', disabled: true })));
}

const dirty = () => text.value !== base;

function typed() {
  byId('yaml-take').disabled = byId('yaml-back').disabled = !dirty();
}

function take(message) {
  if (message.n !== asked) return;
  const other = message.text !== base;
  if (dirty() && base) { // what is being typed stays
    say(other ? 'The mission has changed since; taking this text replaces that change.' : '');
    return;
  }
  base = message.text;
  if (text.value !== base) text.value = base;
  list([]);
  say('');
  typed();
}

const say = (words) => { byId('yaml-note').textContent = words; };

function write() {
  if (!dirty()) return;
  if (new TextEncoder().encode(JSON.stringify(text.value)).length > MOST_BYTES) { say(`A text of more than ${MOST_BYTES} bytes is edited in the file itself; the page sees the change.`); return; }
  const sent = text.value;
  list([]);
  say('');
  writing = { n: step({ type: 'set_text', text: sent }), sent };
}

let writing = null;

function mistakes(message) {
  if (!writing || message.n !== writing.n) {
    if (message.n === asked && message.code === 'bad_text') say(message.message);
    return;
  }
  if (message.code === 'bad_text') list(message.problems.length ? message.problems : [message]);
  writing = null;
}

on('state', (state) => {
  if (!writing || state.n !== writing.n) return;
  base = writing.sent; // it is the mission's own now
  writing = null;
});

// Each mistake is a button that leads to its line.
function list(problems) {
  const box = byId('yaml-problems') || sheet.querySelector('#yaml-problems');
  box.replaceChildren(...problems.map((p) => el('li', {}, p.line ? button(`Line ${p.line}`, () => goToLine(p.line), { class: 'spot' }) : null, ` ${p.where ? `${p.where}: ` : ''}${p.message}`)));
  box.hidden = !problems.length;
  text.setAttribute('aria-invalid', String(problems.length > 0));
  if (problems.length && problems[0].line) goToLine(problems[0].line);
  box.scrollIntoView({ block: 'nearest' });
}

function goToLine(line) {
  const lines = text.value.split('\n'), begin = lines.slice(0, line - 1).reduce((sum, l) => sum + l.length + 1, 0);
  text.focus();
  text.setSelectionRange(begin, begin + (lines[line - 1] || '').length);
  text.scrollTop = Math.max(0, (line - 4) * parseFloat(getComputedStyle(text).lineHeight));
}
