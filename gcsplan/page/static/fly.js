// From the plan to files and vehicles: the link, connect, what is on board, upload, files, briefing.
import { button, byId, el, refill } from './dom.js';
import { known, on, tell } from './hub.js';
import { change, send } from './link.js';
import { goTo } from './map.js';
import { enter, leave } from './modes.js';
import { drawOnBoard, drawVehicles } from './vehicles.js';
import { startUpload, upload } from './upload.js';

const KEPT = 'gcsplan-link', LISTENED = 'gcsplan-connected', NEAR = 15;
const OF_A_PLAN = ['fly-board', 'fly-upload', 'fly-write', 'fly-brief'];
let box = null, ready = false, before = false, online = false, connected = '', asked = 0, greeted = false, again = '';

export function startFly() {
  const to = el('input', {
    id: 'fly-to', type: 'text', autocomplete: 'off', spellcheck: 'false', placeholder: 'udpin:0.0.0.0:14550', 'aria-describedby': 'fly-help fly-problem',
    value: sessionStorage.getItem(KEPT) || '', oninput: () => { sessionStorage.setItem(KEPT, to.value); problem(''); },
  });
  box = el('section', { id: 'fly', 'aria-label': 'Fly', hidden: true }, el('h2', {}, 'Fly'),
    el('div', { class: 'row' }, el('label', { for: 'fly-to' }, 'Link'), to, button('Simulated', () => { put(to, 'sim'); }, { id: 'fly-sim', title: 'Try it with simulated vehicles on this machine' }),
      el('p', { class: 'problem', id: 'fly-problem', role: 'alert', hidden: true })),
    el('p', { class: 'note', id: 'fly-help' }, 'Where the vehicles are: a link for all, NAME=LINK for one, or sim.'),
    el('div', { class: 'steps' },
      act('fly-connect', 'Connect', connect, 'Show where the vehicles are; nothing is written to them'),
      act('fly-board', 'On board', () => ask('on_board'), 'Read the missions on board, and show them beside the plan'),
      act('fly-upload', 'Upload …', () => { const where = link(); if (where) upload(where); }, 'Look at the vehicles, then decide', 'main'),
      act('fly-write', 'Write files', () => { asked = 0; ask('write', false); }, 'Write the files of gcsplan plan into the folder of the mission'),
      act('fly-brief', 'Briefing', () => { asked = ask('write', false); }, 'Write the files, and open the report: its first two pages are the briefing')),
    el('p', { class: 'note', id: 'fly-said', role: 'status' }), el('ul', { class: 'list', id: 'fly-live' }));
  on('state', (state) => {
    box.hidden = false;
    if (state.stage !== 'mission') listenAgain();
    for (const id of [...OF_A_PLAN, 'fly-sim']) box.querySelector(`#${id}`).hidden = state.stage !== 'mission';
    box.querySelector('h2').textContent = state.stage === 'mission' ? 'Fly' : 'Vehicles that are there';
    box.querySelector('#fly-help').textContent = state.stage === 'mission' ? 'Where the vehicles are: a link for all, NAME=LINK for one, or sim.' : 'A link such as udpin:0.0.0.0:14550. Connect only listens; Start here begins the mission where a vehicle stands.';
  });
  for (const kind of ['asked', 'dragged', 'refused']) on(kind, () => { before = ready; enable(false); });
  on('plan', () => { enable(true); listenAgain(); });
  on('error', (message) => {
    if (message.code === 'bad_change') enable(before);
    if (message.where === 'to') problem(message.message);
  });
  on('connection', (now) => {
    online = now === 'open';
    greeted = false;
    if (online) names(); else { enable(false); drawVehicles([]); }
  });
  on('steps', steps);
  on('live', (message) => live(connected ? message.vehicles : []));
  on('on_board', onBoard);
  on('written', written);
  startUpload();
  return box;
}

const act = (id, words, press, title, look = '') => button(words, press, { id, title, class: look, disabled: true });

function put(input, text) {
  input.value = text;
  input.dispatchEvent(new Event('input'));
}

function enable(yes) {
  ready = yes;
  for (const id of OF_A_PLAN) { const made = byId(id) || box.querySelector(`#${id}`); made.disabled = !yes; }
  names();
}

function names() {
  const made = byId('fly-connect') || box.querySelector('#fly-connect');
  made.textContent = connected ? 'Disconnect' : 'Connect';
  made.disabled = !online;
}

function problem(words) {
  const made = byId('fly-problem');
  made.textContent = words;
  made.hidden = !words;
}

// What the user typed as a link; empty, with words at the field, if that is nothing.
function link() {
  const where = byId('fly-to').value.trim();
  if (where) return where;
  problem('Type where the vehicles are, or take Simulated.');
  byId('fly-to').focus();
  return '';
}

function connect() {
  if (connected) { send({ type: 'disconnect' }); return; }
  const to = link();
  if (to) send({ type: 'connect', to });
}

// A new server listens to nobody: what this page was connected to is connected again, and nothing else. Simulated vehicles
// stand where a plan begins, so it waits for the plan if there is a mission.
function steps(message) {
  connected = message.where;
  again = greeted || connected ? '' : sessionStorage.getItem(LISTENED) || '';
  greeted = true;
  if (!again) sessionStorage.setItem(LISTENED, connected);
  if (!connected) live([]);
  names();
}

function listenAgain() {
  const to = again;
  again = '';
  if (!to || connected || !send({ type: 'connect', to })) return;
  said(`Connected again to ${to}: it only listens, and nothing was sent.`);
}

function ask(type, needsLink = true) {
  const to = needsLink ? link() : '';
  if (needsLink && !to) return 0;
  said(type === 'write' ? 'The files are being written …' : 'The missions on board are being read …');
  return send({ type, plan: known.plan.plan, ...(needsLink ? { to } : {}) });
}

const said = (...what) => refill(byId('fly-said'), ...what);

function onBoard(message) {
  if (message.code) { said(el('span', { class: 'bad' }, message.message)); return; }
  drawOnBoard(message.vehicles);
  said(el('ul', {}, ...message.vehicles.map((v) => el('li', {}, `${v.name}: ${v.headline}${v.verdict ? ` (${v.verdict})` : ''}`))),
    button('Hide it', () => { drawOnBoard([]); said(''); }, { id: 'fly-hide' }));
}

function written(message) {
  if (message.code) { said(el('span', { class: 'bad' }, message.message)); return; }
  said(el('span', {}, `${message.files.length} files are in ${message.folder}. `), el('a', { href: 'report.html', target: '_blank', id: 'fly-report' }, 'Open the report'),
    ...message.notes.map((words) => el('p', {}, words)));
  if (asked && message.n === asked) open('report.html', '_blank');
  asked = 0;
}

// -- vehicles that are heard ------------------------------------------------------------------------------------------

function live(vehicles) {
  drawVehicles(vehicles);
  const list = byId('fly-live');
  if (list) refill(list, ...vehicles.map(row));
}

function row(v) {
  const own = known.state.vehicles.find((one) => one.name === v.name), id = v.vehicle < 0 ? v.name.replace(' ', '-') : v.vehicle;
  const may = v.at && !v.silent && (known.state.stage === 'mission' ? own && own.editable : v.vehicle < 0);
  return el('li', { class: v.silent ? 'silent' : '' },
    button(v.name, () => { if (v.at) goTo(v.at, known.state.stage === 'empty' ? NEAR : 0); }, { class: 'item', id: `fly-show-${id}`, title: 'Show on the map' }), el('small', {}, v.text),
    may ? button('Start here', () => startAt(v, own), { id: `fly-start-${id}`, title: `The mission starts where ${v.name} is` }) : null,
    v.wind ? el('p', { class: v.beyond ? 'bad' : 'note' }, v.wind) : null);
}

// The start of a vehicle, of the mission that begins, or of the one that is begun next.
function startAt(v, own) {
  if (known.state.stage === 'mission') { change({ [`${own.key}.start`]: v.at }); return; }
  goTo(v.at, NEAR);
  if (known.state.stage === 'empty') { tell('start here', v); return; }
  leave();
  change({ 'vehicles[0].start': v.at });
  if (!known.state.vehicles[0].goal) enter('goal');
}
