// The zones as a list, and the chosen one's name, size, floor and ceiling as fields.
import { button, el, refill } from './dom.js';
import { numberOf } from './fields.js';
import { known, on } from './hub.js';
import { change } from './link.js';
import { goTo } from './map.js';
import { chosenZone, remove, select } from './zones.js';
import { zones } from './shapes.js';

const LEVELS = [['agl', 'AGL'], ['amsl', 'AMSL']];
let box = null, open = false;

export function startZoneList() {
  box = el('section', { id: 'zones', 'aria-label': 'Zones' });
  on('state', show);
  on('chosen', (key) => {
    if (key) open = true;
    show();
    const editor = box.querySelector('.editor');
    if (editor && matchMedia('(min-width: 800px)').matches) editor.scrollIntoView({ block: 'nearest' });
  });
  return box;
}

function show() {
  if (!known.state || known.state.stage === 'empty') { box.replaceChildren(); return; }
  const chosen = chosenZone(), list = zones();
  const items = list.map((feature, i) => {
    const z = feature.properties, at = z.center || (z.polygon ? z.polygon[0] : null);
    const mine = chosen && z.key === chosen.key;
    return el('li', { class: mine ? 'chosen' : null },
      button(z.name, () => { select(mine ? '' : z.key); if (!mine && at) goTo(at); }, { id: `zone-item-${i}`, 'aria-expanded': String(Boolean(mine)), class: 'item', disabled: z.key === '' }),
      el('small', {}, [z.kind === 'keep_in' ? 'stay inside' : '', z.levels, z.editable ? '' : 'from a file'].filter((w) => w).join(', ')),
      mine ? editor(z) : null);
  });
  refill(box, el('details', { open, id: 'zone-list', ontoggle: (event) => { open = event.target.open; } }, el('summary', { id: 'zone-summary' }, `Zones (${list.length})`),
    list.length ? el('ul', { class: 'list' }, ...items) : el('p', { class: 'note' }, 'None. Draw one with Circle or Polygon on the map.')));
}

// Whether a text is a number; if not, its field says why.
function said(input, found) {
  input.setCustomValidity(found.why || '');
  input.setAttribute('aria-invalid', String(Boolean(found.why)));
  if (found.why) input.reportValidity();
  return !found.why;
}

function editor(z) {
  if (!z.editable) return null;
  const name = el('input', { id: 'zone-name', type: 'text', value: z.name, onchange: () => { if (name.value.trim()) change({ [`${z.key}.name`]: name.value.trim() }); } });
  const parts = [el('div', { class: 'row' }, el('label', { for: 'zone-name' }, 'Name'), name)];
  if (z.shape === 'circle') {
    const radius = el('input', { id: 'zone-radius', type: 'text', inputmode: 'decimal', class: 'number', value: z.radius_m, onchange: () => { const found = numberOf(radius.value); if (said(radius, found)) change({ [`${z.key}.radius_m`]: found.value }); } });
    parts.push(el('div', { class: 'row' }, el('label', { for: 'zone-radius' }, 'Radius, m'), radius));
  }
  parts.push(level(z, 'floor'), level(z, 'ceiling'));
  parts.push(el('p', { class: 'note' }, z.shape === 'circle' ? 'Drag its centre and its edge on the map.' : 'Drag its corners on the map; a small dot makes a new one.'),
    button('Delete the zone', () => remove(z), { id: 'zone-delete', class: 'wide' }));
  return el('div', { class: 'editor' }, ...parts);
}

// A floor or a ceiling: a number and what it counts from. Without a floor a zone begins at the ground; without a ceiling it has no top.
function level(z, which) {
  const [key, value] = Object.entries(z[which] || {})[0] || ['', ''], [, from, own] = key.split('_');
  const unit = own || known.state.units.kinds.height[0];
  const input = el('input', { id: `zone-${which}`, type: 'text', inputmode: 'decimal', class: 'number', value, 'aria-label': `${which}, number`, onchange: put });
  const kind = el('select', { id: `zone-${which}-from`, 'aria-label': `${which}, counted from`, onchange: put }, el('option', { value: '' }, 'none'),
    ...LEVELS.map(([v, words]) => el('option', { value: v, selected: v === from }, `${unit} ${words}`)));
  function put(event) {
    if (event.target === input && kind.value === '') kind.value = 'agl';
    if (kind.value !== '' && input.value === '') { input.focus(); return; }
    const found = numberOf(input.value);
    if (kind.value !== '' && !said(input, found)) return;
    const now = kind.value ? `${which}_${kind.value}_${unit}` : '', changes = {};
    if (key && key !== now) changes[`${z.key}.${key}`] = null;
    if (now) changes[`${z.key}.${now}`] = found.value;
    if (Object.keys(changes).length) change(changes);
  }
  return el('div', { class: 'row' }, el('label', { for: `zone-${which}` }, which === 'floor' ? 'Floor' : 'Ceiling'), input, kind);
}
