// Numbers in words, for the report and for the map to plan on. A unit is its symbol, or a row of the table of units:
// the symbol, its size in SI, and the decimals more than in SI.
const GAP = '\u202f', THIN = '\u202f';

function num(value, decimals, unit) {
  if (value === null || value === undefined || !isFinite(value)) return '–';
  if (Array.isArray(unit)) return num(value / unit[1], Math.max(0, decimals + unit[2]), unit[0]);
  let text = value.toFixed(decimals);
  if (Number(text) === 0) text = text.replace('-', '');
  text = text.replace(/\B(?=(\d{3})+(?!\d))/g, (m, g, at) => (text.indexOf('.') >= 0 && at > text.indexOf('.') ? '' : THIN));
  return text + (unit ? (unit === '°' ? '' : GAP) + unit : '');
}

// Room is rounded down, as everywhere on the page.
function least(v, d, unit) {
  if (Array.isArray(unit) && v !== null) return least(v / unit[1], Math.max(0, d + unit[2]), unit[0]);
  return num(v === null ? null : Math.floor(v * 10 ** d + 1e-3) / 10 ** d, d, unit);
}

// h:mm:ss, with decimals of a second on request.
function duration(s, decimals = 0) {
  if (s === null || s === undefined || !isFinite(s)) return '–';
  const parts = Math.round(Math.abs(s) * 10 ** decimals), whole = Math.floor(parts / 10 ** decimals);
  const two = (v) => String(v).padStart(2, '0');
  const text = `${Math.floor(whole / 3600)}:${two(Math.floor(whole / 60) % 60)}:${two(whole % 60)}`;
  const rest = decimals ? `.${String(parts % 10 ** decimals).padStart(decimals, '0')}` : '';
  return (s < 0 && parts ? '-' : '') + text + rest;
}

// An energy, given in kJ: with Wh, and mAh where the battery's voltage is known.
function energy(kj, decimals, volts) {
  const parts = [num(kj, decimals, 'kJ'), num(kj / 3.6, decimals, 'Wh')];
  if (volts) parts.push(num(kj / 0.0036 / volts, 0, 'mAh'));
  return parts.join(' · ');
}

// The steps of a scale: 1, 2 or 5 times a power of ten, at least `least`.
function niceStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((m) => m * power).find((s) => s >= least * (1 - 1e-9));
}
