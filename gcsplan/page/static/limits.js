// The limits in a short form: each field with its unit, its default and, beside it, what is wrong with it.
import { el } from './dom.js';
import { fillField, rowOf, startFields } from './fields.js';
import { known, on } from './hub.js';

let box = null, shown = '';

export function startLimits() {
  box = el('section', { id: 'limits', 'aria-label': 'Limits' });
  startFields();
  on('state', show);
  return box;
}

function show(state) {
  const { form } = state, keys = JSON.stringify([form.map((f) => [f.key, f.label, f.choices]), known.state.units.name]);
  if (keys !== shown) {
    shown = keys;
    const open = box.querySelector('details')?.open || false;
    box.replaceChildren(...(form.length ? [el('details', { open, id: 'limit-list' }, el('summary', {}, 'Limits and vehicle'), ...groups(form))] : []));
  }
  for (const field of form) fillField(box, field, 'field');
  for (const field of form) if (field.error) { box.querySelector('details').open = true; break; }
  problems(state.problems, form);
}

const GROUPS = { limits: 'Limits', vehicle: 'Vehicle', planner: 'Search' };
function groups(form) {
  const names = [...new Set(form.map((f) => f.group))];
  return names.map((name) => el('fieldset', {}, el('legend', {}, GROUPS[name]), ...form.filter((f) => f.group === name).map((f) => rowOf(f, 'field'))));
}

// Mistakes that have no field here stand below.
function problems(all, form) {
  let list = box.querySelector('.problems');
  if (!list) { list = el('ul', { class: 'problems findings', role: 'alert' }); box.append(list); }
  const fields = new Set(form.filter((f) => f.error).map((f) => f.key));
  list.replaceChildren(...all.filter((p) => !fields.has(p.where)).map((p) => el('li', {}, p.where ? `${p.where}: ${p.message}` : p.message)));
  list.hidden = !list.children.length;
}
