// What is said of a dropped file, by its kind, and what may be done with it.
import { button, byId, el } from './dom.js';
import { known } from './hub.js';
import { drawBounds, drawFileZones, drawFlight, showPlace, zonePlace } from './filemap.js';
import { numberOf } from './fields.js';

const LOOK = { safe: ['safe', '✓'], violations: ['unsafe', '✕'], 'not judged': ['unjudged', '?'] };
const MOST_LISTED = 200;

export function fileParts(file, settings, act) {
  return { mission: flight, zones, ground }[file.kind](file, settings, act).filter((part) => part);
}

const problem = (file) => (file.error ? el('p', { class: 'problem', id: 'file-error', role: 'alert' }, file.error) : null);
const many = (count, one, several) => `${count} ${count === 1 ? one : several}`;
const notes = (name, list, open = false) => (list && list.length ? el('details', { open }, el('summary', {}, `${name} (${list.length})`), el('ul', {}, ...list.map((words) => el('li', {}, words)))) : null);

// -- a mission for a vehicle ------------------------------------------------------------------------------------------

function flight(file, settings, act) {
  const parts = [];
  if (file.vehicles.length > 1) {
    parts.push(el('div', { class: 'row' }, el('label', { for: 'file-vehicle' }, 'As'),
      el('select', { id: 'file-vehicle', onchange: (event) => act.look({ vehicle: Number(event.target.value) }) }, ...file.vehicles.map((name, k) => el('option', { value: k, selected: k === file.vehicle }, name)))));
  }
  parts.push(problem(file));
  if (file.verdict) {
    const returns = file.return_safe === true, path = file.verdict === 'safe' && !returns; // safe is one with all its returns
    const [look, sign] = path ? ['unjudged', '!'] : LOOK[file.verdict];
    parts.push(el('div', { class: `verdict ${look}`, id: 'file-verdict', role: 'status' }, el('span', { class: 'sign', 'aria-hidden': 'true' }, sign),
      el('div', {}, el('strong', {}, path ? 'path safe' : file.verdict), el('p', {}, file.headline))));
    const go = (finding) => { if (finding.at) showPlace(finding.at, `item ${finding.item}`); };
    drawFlight(file, go);
    if (file.findings.length) {
      parts.push(el('h3', {}, `Findings (${file.findings_count})`), el('ol', { class: 'list', id: 'file-findings' }, ...file.findings.map((f) =>
        el('li', {}, f.at ? button(`Item ${f.item}`, () => go(f), { class: 'spot', title: 'Show the place on the map' }) : el('b', {}, `Item ${f.item}`), el('span', {}, f.text)))));
    }
    if (file.findings_count > file.findings.length) parts.push(el('p', { class: 'note' }, `${file.findings_count - file.findings.length} more are not shown.`));
    parts.push(notes('Not judged', file.not_judged.map((n) => (n.item === null ? n.text : n.text)), true), notes('Way home', file.way_home), notes('Notes', file.notes));
  }
  if (file.fence) parts.push(el('p', { class: 'buttons' }, button('Its fence as zones', () => act.look({ kind: 'zones', as: 'keep_in' }), { id: 'file-fence' })));
  return [...parts, ...anew(file, act)];
}

function anew(file, act) {
  const { route } = file;
  if (!route) return [];
  const between = route.via ? `, ${many(route.via, 'place', 'places')} between` : '';
  const left = route.left_out.length ? ` Left out: ${route.left_out.join(', ')}.` : '';
  return [el('h3', {}, 'Plan it anew from here'),
    el('p', { class: 'note' }, `Its start${between} and its goal become the mission’s own; heights, limits and the vehicle stay those of the mission.${left}`),
    el('p', { class: 'buttons' }, button('Plan it anew', () => act.take({ vehicle: file.vehicle, through: true }), { id: 'file-anew', class: 'main', disabled: known.state.stage === 'empty' }),
      route.via ? button('Only its start and goal', () => act.take({ vehicle: file.vehicle, through: false }), { id: 'file-ends', disabled: known.state.stage === 'empty' }) : null),
    known.state.stage === 'empty' ? el('p', { class: 'note' }, 'Choose the ground below first.') : null].filter((part) => part);
}

// -- zones ------------------------------------------------------------------------------------------------------------

const ON_BAD = [['', 'by the file’s kind'], ['refuse', 'refuse the file'], ['strict', 'count as far as they are known'], ['skip', 'leave them out by name']];
const IGNORE = [['points', 'points without a radius'], ['lines', 'lines without a width'], ['empty', 'empty shapes']];

function zones(file, settings, act) {
  const found = file.zones ? file.zones.features : [];
  drawFileZones(found);
  const ready = known.state.stage === 'mission' && !file.error && file.count > 0;
  return [
    problem(file),
    file.error ? null : el('p', { id: 'file-count' }, el('b', {}, `${many(file.count, 'zone', 'zones')} understood`), file.count > found.length ? `, ${found.length} are drawn` : ''),
    found.length ? el('ul', { class: 'list', id: 'file-zones' }, ...found.slice(0, MOST_LISTED).map((f) => el('li', {}, button(f.properties.name, () => showPlace(zonePlace(f), f.properties.name), { class: 'item' }), el('small', {}, f.properties.levels)))) : null,
    found.length > MOST_LISTED ? el('p', { class: 'note' }, `${found.length - MOST_LISTED} more are not listed.`) : null,
    notes('Left out, and read so', file.notes, true),
    zoneSettings(file, settings, act),
    el('p', { class: 'buttons' }, button(file.there ? 'Replace the file of this name, and add' : 'Add to the mission', () => act.take({ as: file.as, over: file.there }), { id: 'file-add', class: 'main', disabled: !ready })),
    el('p', { class: 'note' }, known.state.stage === 'mission' ? `The file is copied as ${file.name} into the folder of the mission.` : 'Zones belong to a mission: choose start and goal first.'),
  ];
}

function zoneSettings(file, settings, act) {
  const again = () => {
    const ignore = IGNORE.map(([key]) => key).filter((key) => byId(`file-ignore-${key}`).checked);
    const size = (id) => { const text = byId(id).value.trim(); return text ? numberOf(text).value ?? text : null; };
    act.look({ kind: 'zones', as: byId('file-as').value, settings: { radius_m: size('file-radius'), buffer_m: size('file-buffer'), on_bad: byId('file-bad').value, ignore } });
  };
  const text = (id, label, value) => el('div', { class: 'row' }, el('label', { for: id }, label), el('input', { id, type: 'text', inputmode: 'decimal', class: 'number', value: value ?? '', onchange: again }), el('span', { class: 'unit' }, 'm'));
  const choice = (id, label, value, options) => el('div', { class: 'row' }, el('label', { for: id }, label), el('select', { id, onchange: again }, ...options.map(([v, words]) => el('option', { value: v, selected: v === (value ?? '') }, words))));
  return el('details', { class: 'settings', open: Boolean(file.error) || Boolean(document.querySelector('#file .settings')?.open) }, el('summary', {}, 'How the file is read'),
    choice('file-as', 'They are', file.as ?? 'no_fly', [['no_fly', 'no-fly zones'], ['keep_in', 'areas to stay inside']]),
    text('file-radius', 'Radius of points', settings.radius_m), text('file-buffer', 'Half-width of lines', settings.buffer_m),
    choice('file-bad', 'Not understood', settings.on_bad, ON_BAD),
    ...IGNORE.map(([key, words]) => el('label', { class: 'choice' }, el('input', { type: 'checkbox', id: `file-ignore-${key}`, checked: (settings.ignore || []).includes(key), onchange: again }), el('span', {}, `Leave out ${words}`))));
}

// -- terrain ----------------------------------------------------------------------------------------------------------

function ground(file, settings, act) {
  if (file.bounds) drawBounds(file.bounds);
  const again = () => act.look({ settings: { vertical_datum: byId('file-datum').value.trim(), height_unit: byId('file-unit').value, crs: byId('file-crs').value.trim() } });
  const rows = file.files ? [...(file.files.length > 1 ? [['Files', file.files.join(', ')]] : []), ...(file.cells.length ? [['Cells', file.cells.map(([cols, rows_]) => `${cols} × ${rows_}`).join(', ')]] : []), ['Heights', `${file.height_unit}, above ${file.vertical_datum || 'an unnamed zero'}`],
    ...(file.places ? [['The mission', file.beside ? `${many(file.beside, 'place lies', 'places lie')} beside it` : 'lies on it']] : [])] : [];
  return [
    problem(file),
    rows.length ? el('dl', { id: 'file-facts' }, ...rows.map(([name, words]) => el('div', {}, el('dt', {}, name), el('dd', {}, words)))) : null,
    notes('Notes', file.notes, true),
    el('div', { class: 'row' }, el('label', { for: 'file-datum' }, 'Heights count from'), el('input', { id: 'file-datum', type: 'text', placeholder: 'EGM96, NAVD88, …', value: settings.vertical_datum ?? '', onchange: again })),
    el('div', { class: 'row' }, el('label', { for: 'file-unit' }, 'Unit of heights'), el('select', { id: 'file-unit', onchange: again }, ...[['', 'as the file says'], ['m', 'm'], ['ft', 'ft'], ['us_ft', 'US survey ft']].map(([v, words]) => el('option', { value: v, selected: v === (settings.height_unit ?? '') }, words)))),
    el('div', { class: 'row' }, el('label', { for: 'file-crs' }, 'Coordinate system'), el('input', { id: 'file-crs', type: 'text', placeholder: 'as the file says', value: settings.crs ?? '', onchange: again })),
    el('p', { class: 'buttons' }, button(known.state.stage === 'mission' ? 'Use as the ground' : 'Copy into the folder', () => act.take({ over: file.there }), { id: 'file-add', class: 'main', disabled: Boolean(file.error) })),
    el('p', { class: 'note' }, file.there ? `Another ${file.name} lies in the folder of the mission, and is replaced.` : `The file is copied as ${file.name} into the folder of the mission.`),
  ];
}
