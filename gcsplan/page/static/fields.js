// Fields of a form: a row with its label, its unit and its default, and below it what is wrong with it.
import { button, el, refill } from './dom.js';
import { known, on } from './hub.js';
import { change, step } from './link.js';

const shown = new Map(); // the field of each row that is shown, by the id of its input

// A change that is refused as a whole is explained at its field.
export function startFields() {
  on('error', (message) => {
    if (message.code !== 'bad_change') return;
    for (const [id, field] of shown) if (field.key === message.where && document.getElementById(id)) complain(id, message.message);
  });
}

export const idOf = (field, before) => `${before}-${field.key.replace(/[^\w]+/g, '-')}`;
const size = (field) => (field.quantity ? known.state.units.kinds[field.quantity][1] : 1);
const unit = (field) => (field.quantity ? known.state.units.kinds[field.quantity][0] : field.unit);
const number = (value, by) => String(Number((value / by).toPrecision(7)));
const BOOLEAN = [['true', 'yes'], ['false', 'no']];

// A single number as people type it. A comma is a decimal one, unless it may as well part thousands: that is not guessed.
export function numberOf(text) {
  const plain = text.replace(/[\s\u00a0\u202f]/g, '').replace('\u2212', '-');
  if (/^[+-]?[1-9]\d{0,2}(,\d{3})+$/.test(plain)) return { why: `${text} may be ${plain.replace(/,/, '.')} or ${plain.replace(/,/g, '')}: write one of them.` };
  const point = /^[+-]?\d*,\d+$/.test(plain) ? plain.replace(',', '.') : plain;
  return /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(point) ? { value: Number(point) } : { why: `${text} is no number.` };
}

// `before` begins the ids; `wide`: the key's name and its help are shown.
export function rowOf(field, before, wide = false) {
  const name = idOf(field, before), fixed = field.kind === 'fixed';
  const about = {
    id: name, 'aria-describedby': `${name}-problem ${name}-help`, title: field.help, disabled: fixed, spellcheck: 'false', autocomplete: 'off',
    oninput: (event) => { event.target.dataset.typed = 'yes'; }, onchange: (event) => put(shown.get(name), event.target),
  };
  const options = field.kind === 'boolean' ? BOOLEAN : field.choices.map((c) => [c, c]);
  const none = { choice: field.default, boolean: field.default === null ? null : field.default ? 'yes' : 'no' }[field.kind];
  const input = options.length
    ? el('select', about, el('option', { value: '' }, none ? `${none} (default)` : 'none'), ...options.map(([v, words]) => el('option', { value: v }, words)))
    : el('input', { ...about, type: 'text', inputmode: field.kind === 'number' ? 'decimal' : null, class: field.kind === 'number' ? 'number' : null });
  const help = [field.help, field.kind === 'yaml' ? 'As in the file.' : '', field.reason ? `Not here: ${field.reason}.` : ''].filter((w) => w).join(' ');
  return el('div', { class: `row of-${field.kind}` }, el('label', { for: name }, field.label, wide ? el('code', {}, field.key.split('.').pop()) : null), input,
    el('span', { class: 'unit' }, unit(field)), el('p', { id: `${name}-help`, class: 'help', hidden: !wide }, ...help.split('`').map((part, k) => (k % 2 ? el('code', {}, part) : part))),
    el('p', { class: 'problem', id: `${name}-problem`, role: 'alert', hidden: true }), field.list ? el('ol', { class: 'entries', id: `${name}-entries` }) : null);
}

export function fillField(box, field, before) {
  const name = idOf(field, before), input = box.querySelector(`#${name}`);
  shown.set(name, field);
  const word = (value) => (value === null || value === undefined ? '' : field.kind === 'number' && typeof value === 'number' ? number(value, size(field)) : String(value));
  if (!input.dataset.typed) input.value = word(field.value); // what is being typed stays
  if (input.tagName === 'INPUT') input.placeholder = field.default === null || field.default === undefined ? 'none' : word(field.default);
  complain(name, field.error || '', box);
  if (field.list) fillEntries(box.querySelector(`#${name}-entries`), field, name);
}

// The entries of a list, a row each: changed, moved, removed; and a row for one more.
function fillEntries(rows, field, name) {
  const { entries, most, choices, like } = field.list, drawn = JSON.stringify(entries);
  if (!rows || rows.dataset.drawn === drawn) return; // what is being typed stays
  rows.dataset.drawn = drawn;
  const put = (texts) => { if (texts.length) step({ type: 'change', changes: {}, yaml: { [field.key]: `[${texts.join(', ')}]` } }); else change({ [field.key]: null }); };
  const without = (k) => entries.filter((_, i) => i !== k), moved = (k, to) => [...without(k).slice(0, to), entries[k], ...without(k).slice(to)];
  const typing = (id, value, words, onchange) => (choices.length
    ? el('select', { id, 'aria-label': words, onchange }, ...['', ...choices].map((c) => el('option', { value: c, selected: c === value }, c)))
    : el('input', { id, type: 'text', value, placeholder: like, 'aria-label': words, autocomplete: 'off', spellcheck: 'false', onchange }));
  const act = (k, sign, words, press, off) => button(sign, press, { id: `${name}-${k}-${words.split(' ')[0]}`, 'aria-label': `${words}: ${field.label} ${k + 1}`, title: words, disabled: off });
  const row = (text, k) => el('li', {},
    typing(`${name}-${k}`, text, `${field.label} ${k + 1}`, (event) => { const now = event.target.value.trim(); put(now ? entries.map((old, i) => (i === k ? now : old)) : without(k)); }),
    act(k, '↑', 'Up', () => put(moved(k, k - 1)), k === 0), act(k, '↓', 'Down', () => put(moved(k, k + 1)), k === entries.length - 1), act(k, '✕', 'Remove it', () => put(without(k)), false));
  const more = typing(`${name}-more`, '', `One more of ${field.label}`, null);
  refill(rows, ...entries.map(row), entries.length < most ? el('li', {}, more, button('Add', () => { if (more.value.trim()) put([...entries, more.value.trim()]); else more.focus(); }, { id: `${name}-add` })) : null);
}

function complain(id, words, box = document) {
  const problem = box.querySelector(`#${id}-problem`);
  problem.textContent = words;
  problem.hidden = !words;
  box.querySelector(`#${id}`).setAttribute('aria-invalid', String(Boolean(words)));
}

function put(field, input) {
  delete input.dataset.typed;
  const text = input.value.trim();
  if (text === '') { change({ [field.key]: null }); return; }
  if (field.kind === 'yaml') { step({ type: 'change', changes: {}, yaml: { [field.key]: text } }); return; }
  if (field.kind === 'boolean') { change({ [field.key]: text === 'true' }); return; }
  if (field.kind !== 'number') { change({ [field.key]: text }); return; }
  const found = numberOf(text);
  if (found.why) { complain(input.id, found.why); return; }
  change({ [field.key]: Number((found.value * size(field)).toPrecision(12)) });
}

export const removal = (section) => button('Remove this section', () => change({ [section]: null }), { id: 'section-remove' });
