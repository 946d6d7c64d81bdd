// Start from nothing: the ground, the vehicle and the legal ceiling are chosen; then start and goal are clicked.
import { button, byId, degrees, el, refill } from './dom.js';
import { numberOf } from './fields.js';
import { known, on } from './hub.js';
import { send, step } from './link.js';
import { canvas, goTo } from './map.js';
import { enter } from './modes.js';

const PRESETS = [['copter', 'Copter, ArduPilot'], ['wing', 'Fixed wing, ArduPilot'], ['px4', 'Copter, PX4']];
const OFTEN = { m: 120, ft: 400 }; // the ceiling above ground that most laws have
const CLOSE = 13; // zoom at which a place is shown that was typed

let form = null, here = null, asking = 0, draft = null, symbol = 'm', unit_m = 1;

export function startFromNothing(panel) {
  on('state', (state) => {
    if (state.stage === 'empty' && (!form || symbol !== state.units.kinds.height[0])) show(panel, state);
    if (state.stage !== 'empty') { form = null; here = null; }
    if (form && byId('start-file')) offer(byId('start-file'), state.files);
    if (state.stage === 'draft' && draft !== state.name) { draft = state.name; begin(state); }
    if (state.stage === 'mission') draft = null;
  });
  on('start here', (vehicle) => { here = vehicle.at; sayHere(vehicle.name); });
  on('place', (message) => { if (message.n === asking) found(message.at); });
  on('error', (message) => {
    if (!form || (message.n !== asking && message.where !== 'place')) return;
    complain('start-place', message.message);
  });
}

// The files of the folder, of which a dropped one may be new.
function offer(choice, files) {
  const before = choice.value;
  choice.replaceChildren(...files.map((f) => el('option', {}, f)));
  choice.value = files.includes(before) ? before : files[0];
}

function begin(state) {
  const vehicle = state.vehicles[0];
  if (!vehicle || !vehicle.start) enter('start'); else if (!vehicle.goal) enter('goal');
  if (!byId('stop')) return;
  canvas().focus({ preventScroll: true });
}

const radio = (group, value, words, on) => el('label', { class: 'choice' },
  el('input', { type: 'radio', name: group, value, onchange: on }), el('span', {}, words));

function show(panel, state) {
  [symbol, unit_m] = state.units.kinds.height;
  const files = state.files.length
    ? el('select', { id: 'start-file', 'aria-label': 'Terrain file', onchange: () => pick('ground', 'file') }, ...state.files.map((f) => el('option', {}, f))) : null;
  form = el('form', { id: 'start', onsubmit: submit, novalidate: true },
    el('h2', {}, 'New mission'),
    el('p', { class: 'note' }, 'Choose, then click start and goal on the map. Nothing leaves this machine.'),
    el('fieldset', {}, el('legend', {}, 'Ground'),
      radio('ground', 'sample', 'Sample: Jacksboro, Tennessee'),
      el('div', { class: 'with' }, radio('ground', 'flat', 'Flat, at'), number('start-flat', '0', `Height of the flat ground, ${symbol} above sea level`, 'ground', 'flat'), el('span', {}, `${symbol} above the sea`)),
      files ? el('div', { class: 'with' }, radio('ground', 'file', 'File'), files)
        : el('p', { class: 'note' }, 'A terrain file (.tif, .vrt, .hgt, .asc) in the folder of the mission appears here.'),
      problem('ground')),
    el('fieldset', {}, el('legend', {}, 'Vehicle'), ...PRESETS.map(([value, words]) => radio('preset', value, words)), problem('preset')),
    el('fieldset', {}, el('legend', {}, 'Legal ceiling above ground'),
      el('div', { class: 'with' }, radio('ceiling', 'metres', 'At most'), number('start-ceiling', String(OFTEN[symbol] || OFTEN.m), `Legal ceiling, ${symbol} above ground`, 'ceiling', 'metres'), el('span', {}, symbol)),
      radio('ceiling', 'none', 'None applies'), problem('ceiling')),
    el('details', {}, el('summary', {}, 'Show a place first'),
      el('div', { class: 'with' }, el('input', { id: 'start-place', type: 'text', 'aria-label': 'Place', 'aria-describedby': 'start-place-problem', placeholder: '36.6175, -84.3892', autocomplete: 'off', onkeydown: enterFinds }),
        button('Show', find, { id: 'start-find' })),
      el('p', { class: 'note' }, 'Degrees, degrees with minutes and seconds, UTM, or MGRS.'), problem('start-place')),
    el('p', { class: 'note', id: 'start-here', role: 'status', hidden: true }),
    el('p', {}, el('button', { type: 'submit', class: 'main wide', id: 'begin' }, 'Click start and goal')));
  refill(panel, form);
  form.querySelector('[value=copter]').checked = true;
}

function sayHere(name) {
  if (!form) return;
  byId('start-here').textContent = here ? `It starts where ${name} is: ${degrees(here)}.` : '';
  byId('start-here').hidden = !here;
  byId('begin').textContent = here ? 'Click the goal' : 'Click start and goal';
}

const number = (id, value, label, group, choice) => el('input', { id, type: 'text', class: 'number', value, inputmode: 'decimal', 'aria-label': label, oninput: () => pick(group, choice), onfocus: () => pick(group, choice) });
const problem = (name) => el('p', { class: 'problem', id: `${name}-problem`, role: 'alert', hidden: true });
const pick = (group, value) => { form.querySelector(`[name=${group}][value=${value}]`).checked = true; };

function complain(name, words) {
  const box = byId(`${name}-problem`);
  box.textContent = words;
  box.hidden = !words;
}

function enterFinds(event) {
  if (event.key !== 'Enter') return;
  event.preventDefault();
  find();
}

function find() {
  complain('start-place', '');
  const text = byId('start-place').value.trim();
  if (text) asking = send({ type: 'place', text });
}

function found(at) {
  goTo(at, CLOSE);
  complain('start-place', '');
}

const onFile = (dem) => ({ dem, ...(known.datums[dem] ? { vertical_datum: known.datums[dem] } : {}) });
const inMetres = (id) => Number(((numberOf(byId(id).value).value ?? NaN) * unit_m).toPrecision(12));

function submit(event) {
  event.preventDefault();
  const chosen = (name) => (form.querySelector(`[name=${name}]:checked`) || {}).value;
  const ground = chosen('ground'), ceiling = chosen('ceiling'), metres = inMetres('start-ceiling'), height = inMetres('start-flat');
  complain('ground', !ground ? 'Choose the ground: it is never assumed.' : ground === 'flat' && Number.isNaN(height) ? 'Give the height of the flat ground.' : '');
  complain('ceiling', !ceiling ? 'Choose: the law of the place decides.' : ceiling === 'metres' && !(metres > 0) ? 'Give a height above 0.' : '');
  const wrong = form.querySelector('.problem:not([hidden])');
  if (wrong) { const field = wrong.closest('fieldset, details').querySelector('input'); field.focus(); return; }
  const terrain = { sample: { dem: 'sample:jacksboro' }, flat: { flat_m: height }, file: onFile((byId('start-file') || {}).value) }[ground];
  step({ type: 'new', terrain, preset: chosen('preset'), max_agl_m: ceiling === 'none' ? null : metres, min_agl_m: Math.min(60, ceiling === 'none' ? 60 : metres / 2), start: here, goal: null });
}
