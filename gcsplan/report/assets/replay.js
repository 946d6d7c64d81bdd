// The replay: a time, moved by the slider or by the clock, and every figure that shows the vehicles at that time.
const tracksNow = () => (data.replay ? data.replay.tracks.map(trackOf) : []);
const replay = { t: 0, tracks: tracksNow(), places: [], shown: false };
// What shows the vehicles; each is called after the time has changed.
const movers = [];

function moveTo(t, shown = true) {
  replay.t = Math.min(Math.max(t, 0), data.replay.end);
  replay.places = replay.tracks.map((track) => placeAt(track, replay.t));
  replay.shown = shown;
  for (const move of movers) move();
}

function startReplay() {
  const box = document.getElementById('replay');
  if (!box) return null;
  const slider = box.querySelector('input'), output = box.querySelector('output'), speed = box.querySelector('select');
  const play = box.querySelector('[data-do="play"]'), closest = box.querySelector('[data-do="closest"]');
  let rows = [], several = false;
  let last = null; // the clock's last tick; null while it stands still
  box.hidden = false;

  // Reads what is there to be moved.
  function take() {
    rows = [...box.querySelectorAll('tbody tr')].map((row) => [...row.querySelectorAll('td')]);
    several = new Set(replay.tracks.map((track) => track.k)).size > 1;
    slider.max = data.replay.end;
  }
  function show() {
    const words = clockWords(replay.t);
    slider.value = replay.t;
    slider.setAttribute('aria-valuetext', words);
    output.textContent = words;
    if (box.querySelector('details').open) fill();
  }
  function fill() {
    rows.forEach((cells, i) => {
      const place = replay.places[i], other = nearestOther(replay.tracks, replay.places, i);
      const words = place ? [place.state, metres(place.z, 'AMSL'), metres(place.agl)] : ['gone', '–', '–'];
      if (several) words.push(other ? `${metres(other[1])}, ${replay.tracks[other[0]].name}` : '–');
      if (rehearsed) words.push(offPlan(i));
      words.forEach((text, c) => { if (cells[c].textContent !== text) cells[c].textContent = text; });
    });
  }
  function offPlan(i) {
    const own = replay.tracks[i], p = own.flown ? replay.tracks.findIndex((t) => !t.flown && t.k === own.k) : -1;
    return p < 0 || !replay.places[p] || !replay.places[i] ? '' : num(apart(replay.places[p], replay.places[i]), 1, units.distance);
  }
  function tick(now) {
    if (last === null) return;
    moveTo(replay.t + (+speed.value * Math.min(now - last, 1000)) / 1000); // a page that was hidden does not jump
    last = now;
    if (replay.t >= data.replay.end) run(false); else requestAnimationFrame(tick);
  }
  function run(on) {
    if (on && replay.t >= data.replay.end) moveTo(0);
    last = on ? performance.now() : null;
    play.textContent = on ? '❚❚' : '▶';
    play.setAttribute('aria-label', on ? 'pause' : 'play');
    if (on) requestAnimationFrame(tick);
  }
  play.addEventListener('click', () => run(last === null));
  slider.addEventListener('input', () => { run(false); moveTo(+slider.value); });
  slider.addEventListener('keydown', (event) => {
    if (event.key !== ' ') return;
    event.preventDefault();
    run(last === null);
  });
  if (closest) closest.addEventListener('click', () => { run(false); moveTo(data.replay.closest); });
  box.querySelector('details').addEventListener('toggle', fill);
  window.addEventListener('beforeprint', () => run(false));
  movers.push(show);
  take();
  moveTo(0, false);
  return take;
}

// The vehicles that the filter hides, by number.
const unwanted = new Set();

// Of more vehicles than this the dots are small and without names.
const MOST_NAMED = 100;

// Dots of the vehicles over the map, with their names where there is room: beside no mark and no label of the map.
function startCrafts(figure, made) {
  const layer = document.createElement('div');
  const many = replay.tracks.length > MOST_NAMED;
  layer.className = many ? 'crafts many' : 'crafts';
  figure.append(layer);
  const crafts = replay.tracks.map((track) => {
    const el = document.createElement('i'), label = document.createElement('b');
    el.className = `craft t${track.k % 8}${hollow(track) ? ' planned' : ''}`;
    label.textContent = many || hollow(track) ? '' : track.name;
    el.append(label);
    layer.append(el);
    return { el, label, r: many ? 4 : 8, k: track.k };
  });
  function move() {
    layer.hidden = !replay.shown;
    if (layer.hidden) return;
    const { view, taken } = made(), width = figure.clientWidth, height = figure.clientHeight, seen = [];
    crafts.forEach((c, i) => {
      const place = replay.places[i];
      const u = place && ((place.e - ground.west) / ground.width - view.x) / view.w;
      const v = place && ((ground.north - place.n) / ground.height - view.y) / view.h;
      c.el.hidden = !place || unwanted.has(c.k) || u < 0 || u > 1 || v < 0 || v > 1;
      if (c.el.hidden) return;
      c.x = u * width;
      c.y = v * height;
      c.el.style.transform = `translate(${c.x}px,${c.y}px)`;
      seen.push(c);
    });
    for (const c of seen) if (c.w === undefined) { c.w = c.label.offsetWidth; c.h = c.label.offsetHeight; }
    layLabels(seen, width, height, [...taken]).forEach((at, i) => {
      const c = seen[i];
      c.label.style.visibility = at ? 'visible' : 'hidden';
      if (at) c.label.style.transform = `translate(${at[0] - c.x}px,${at[1] - c.y}px)`;
    });
  }
  movers.push(move);
  return move;
}

// Where a flight stands beside its plan, the plan is a ring.
const rehearsed = replay.tracks.some((track) => track.flown);
const hollow = (track) => rehearsed && !track.flown;

// The vehicles of one line in its profile, or the time in a chart over time.
// `xs` are the places of a profile's samples across the chart, `x` that of a time, `y` that of a height.
function startChartTime(svg, k, xs, x, y) {
  const paths = (k < 0 ? [null] : replay.tracks.map((track, i) => [track, i]).filter(([t]) => t.k === data.lines[k].index))
    .map((one) => {
      const path = document.createElementNS('http://www.w3.org/2000/svg', 'path');
      path.setAttribute('class', one ? `craft t${one[0].k % 8}${hollow(one[0]) ? ' planned' : ''}` : 'now');
      svg.append(path);
      return [path, one && one[1]];
    });
  movers.push(() => {
    for (const [path, i] of paths) {
      const place = i === null ? null : replay.places[i];
      let d = '';
      if (replay.shown && i === null) d = `M${x(replay.t)} 0V10000`;
      if (replay.shown && place) {
        d = `M${xs[sampleAt(data.lines[k], place, replay.t - replay.tracks[i].begin)]} ${y(place.z)}h0`;
      }
      path.setAttribute('d', d);
    }
  });
}
