// What every figure shares: the numbers of the page, their wording, the tip beside the pointer, and who is pointed at.
const block = document.getElementById('data'); // the map to plan on has none
const data = block ? JSON.parse(block.textContent) : globalThis.data;

// The units of the page: by kind (path, leg, far, distance, height, amsl, speed, climb_rate) the symbol, the size in SI,
// and the decimals more than in SI. All data are in SI; a unit of this table converts them where they are worded.
let units = data.units;

// -- the ground -------------------------------------------------------------------------------------------------------
function groundOf(g) {
  const [west, south, east, north] = g.box;
  const bytes = Uint8Array.from(atob(g.heights), (c) => c.charCodeAt(0));
  const z = new Float32Array(g.cols * g.rows);
  for (let i = 0; i < z.length; i++) {
    const whole = bytes[2 * i] + 256 * bytes[2 * i + 1];
    z[i] = whole === g.unknown ? NaN : g.base + g.step * whole;
  }
  const mix = (values, cols, rows, e, n) => {
    const c = ((e - west) / (east - west)) * (cols - 1), r = ((north - n) / (north - south)) * (rows - 1);
    if (!(c >= 0 && c <= cols - 1 && r >= 0 && r <= rows - 1)) return NaN;
    const i = Math.min(Math.floor(c), cols - 2), j = Math.min(Math.floor(r), rows - 2), u = c - i, v = r - j;
    const at = (a, b) => values[b * cols + a];
    return (1 - v) * ((1 - u) * at(i, j) + u * at(i + 1, j)) + v * ((1 - u) * at(i, j + 1) + u * at(i + 1, j + 1));
  };
  return {
    z, cols: g.cols, rows: g.rows, west, south, east, north, width: east - west, height: north - south,
    at: (e, n) => mix(z, g.cols, g.rows, e, n),
    degrees: (e, n) => [mix(g.lat, g.lattice, g.lattice, e, n), mix(g.lon, g.lattice, g.lattice, e, n)],
  };
}
let ground = groundOf(data.grid);

// Other numbers, of the same mission after an edit; whoever draws them is called after that.
function takeNumbers(fresh) {
  Object.assign(data, fresh);
  units = data.units;
  ground = groundOf(data.grid);
}

function placeWords(e, n) {
  const [lat, lon] = ground.degrees(e, n);
  return isNaN(lat) ? '' : `${lat.toFixed(5)}, ${lon.toFixed(5)}`;
}

// What is known of a place that is on no track: `near` is the nearest one (see nearestTrack), or null.
function groundRows(e, n, near) {
  const z = ground.at(e, n), rows = [['at', placeWords(e, n) || '–'], ['ground about', isNaN(z) ? 'unknown' : num(z, 0, units.amsl)]];
  if (near) {
    const line = data.lines[near.k], far = near.away > 2000;
    rows.push(['nearest track', line.name], ['its distance', far ? num(near.away, 1, units.far) : num(near.away, 0, units.distance)]);
    const [above, metres] = aboveRow(line, near.i);
    rows.push([`its height ${above}`, metres]);
  }
  return rows;
}

const aboveRow = (line, i) => {
  const top = line.o ? line.o[i] : line.g[i];
  return ['above ' + (line.o ? 'trees' : 'ground'), least(top === null ? null : line.z[i] - top, 1, units.height)];
};

// Everything that is known of one sample of one line, a row each.
function sampleRows(k, i) {
  const line = data.lines[k], leg = line.legs[line.leg[i]];
  const rows = [
    [line.name, `to item ${leg.seq}, ${leg.kind}`],
    ['along the track', line.s[line.s.length - 1] > 2000 ? num(line.s[i], 2, units.far) : num(line.s[i], 1, units.distance)],
    ['path', num(line.z[i], 1, units.amsl)],
    aboveRow(line, i),
    ['ground', num(line.g[i], 1, units.amsl)],
  ];
  if (!leg.column && line.f[i] !== null) rows.push(['lowest allowed', num(line.f[i], 1, units.amsl)]);
  if (line.c[i] !== null) rows.push(['highest allowed', num(line.c[i], 1, units.amsl)]);
  rows.push(['climb', num(leg.climb, 1, '°')], ['since take-off', duration(line.t[i])]);
  if (line.j) rows.push(['energy used', energy(line.j[i], 0, line.volts) + (line.battery ? ` · ${num((100 * line.j[i]) / line.battery, 1, '%')}` : '')]);
  rows.push(['at', placeWords(line.e[i], line.n[i])]);
  return rows;
}

// -- the tip ----------------------------------------------------------------------------------------------------------
const tip = (() => {
  const box = document.getElementById('tip');
  const show = (event, fill) => {
    box.textContent = '';
    fill(box);
    box.hidden = false;
    const pad = 14, w = box.offsetWidth, h = box.offsetHeight;
    const vw = document.documentElement.clientWidth, vh = window.innerHeight;
    let x = event.clientX + pad, y = event.clientY + pad;
    if (x + w > vw - 4) x = event.clientX - w - pad;
    if (y + h > vh - 4) y = event.clientY - h - pad;
    box.style.left = `${Math.max(4, Math.min(x, vw - w - 4))}px`;
    box.style.top = `${Math.max(4, y)}px`;
  };
  return {
    words: (event, text) => show(event, (b) => { b.className = ''; b.textContent = text; }),
    rows: (event, rows) => show(event, (b) => {
      b.className = 'rows';
      for (const [name, value] of rows) {
        const left = document.createElement('span'), right = document.createElement('b');
        left.textContent = name;
        right.textContent = value;
        b.append(left, right);
      }
    }),
    hide: () => { box.hidden = true; },
  };
})();

// -- who is pointed at: one sample of one line, shown in every figure --------------------------------------------------
const watchers = [];
function pointAt(k, i) {
  for (const watch of watchers) watch(k, i);
}
const nowhere = () => pointAt(-1, -1);
