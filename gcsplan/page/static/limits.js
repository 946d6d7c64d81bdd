// The limits in a short form: each field with its unit, its default and, beside it, what is wrong with it.
import { el } from './dom.js';
import { known, on } from './hub.js';
import { change } from './link.js';

let box = null, shown = '';

export function startLimits() {
  box = el('section', { id: 'limits', 'aria-label': 'Limits' });
  on('state', show);
  return box;
}

function show(state) {
  const { form } = state, keys = JSON.stringify([form.map((f) => [f.key, f.label, f.choices]), state.units.name]);
  if (keys !== shown) {
    shown = keys;
    const open = box.querySelector('details')?.open || false;
    box.replaceChildren(...(form.length ? [el('details', { open, id: 'limit-list' }, el('summary', {}, 'Limits and vehicle'), ...groups(form))] : []));
  }
  for (const field of form) fill(field);
  for (const field of form) if (field.error) { box.querySelector('details').open = true; break; }
  problems(state.problems, form);
}

const GROUPS = { limits: 'Limits', vehicle: 'Vehicle', planner: 'Search' };
function groups(form) {
  const names = [...new Set(form.map((f) => f.group))];
  return names.map((name) => el('fieldset', {}, el('legend', {}, GROUPS[name]), ...form.filter((f) => f.group === name).map(row)));
}

const size = (field) => (field.quantity ? known.state.units.kinds[field.quantity][1] : 1);
const unit = (field) => (field.quantity ? known.state.units.kinds[field.quantity][0] : field.unit);
const id = (field) => `field-${field.key.replace(/[^\w]+/g, '-')}`;
const number = (value, by) => String(Number((value / by).toPrecision(7)));

function row(field) {
  const name = id(field), about = { id: name, 'aria-describedby': `${name}-problem ${name}-help`, title: field.help, oninput: (event) => { event.target.dataset.typed = 'yes'; }, onchange: (event) => put(field, event.target) };
  const input = field.kind === 'choice'
    ? el('select', about, ...field.choices.map((c) => el('option', { value: c }, c)))
    : el('input', { ...about, type: field.kind === 'number' ? 'number' : 'text', step: 'any', autocomplete: 'off' });
  return el('div', { class: 'row' }, el('label', { for: name }, field.label), input, el('span', { class: 'unit' }, unit(field)),
    el('span', { id: `${name}-help`, hidden: true }, field.help),
    el('p', { class: 'problem', id: `${name}-problem`, role: 'alert', hidden: true }));
}

function fill(field) {
  const input = document.getElementById(id(field)) || box.querySelector(`#${id(field)}`), problem = box.querySelector(`#${id(field)}-problem`);
  const word = (value) => (value === null || value === undefined ? '' : field.kind === 'number' ? number(value, size(field)) : String(value));
  if (!input.dataset.typed) input.value = word(field.value); // what is being typed stays
  if (field.kind !== 'choice') input.placeholder = field.default === null || field.default === undefined ? 'none' : word(field.default);
  input.setAttribute('aria-invalid', String(Boolean(field.error)));
  problem.textContent = field.error || '';
  problem.hidden = !field.error;
}

function put(field, input) {
  delete input.dataset.typed;
  const text = input.value.trim();
  if (field.kind === 'number' && input.validity.badInput) { input.value = ''; fill({ ...field, error: 'This is no number.' }); return; }
  change({ [field.key]: text === '' ? null : field.kind === 'number' ? Number((Number(text) * size(field)).toPrecision(12)) : text });
}

// Mistakes that have no field here stand below.
function problems(all, form) {
  let list = box.querySelector('.problems');
  if (!list) { list = el('ul', { class: 'problems findings', role: 'alert' }); box.append(list); }
  const fields = new Set(form.filter((f) => f.error).map((f) => f.key));
  list.replaceChildren(...all.filter((p) => !fields.has(p.where)).map((p) => el('li', {}, p.where ? `${p.where}: ${p.message}` : p.message)));
  list.hidden = !list.children.length;
}
