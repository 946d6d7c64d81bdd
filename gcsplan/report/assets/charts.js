// The map, the profiles, and the fleet's charts: what the pointer tells there.
function startMap() {
  const figure = document.getElementById('map'), scale = figure.querySelector('.scale'), cursor = figure.querySelector('.cursor');
  const width = +figure.dataset.widthM, height = +figure.dataset.heightM;
  const unit = 10000 / width;
  let laid = null;
  const crafts = startCrafts(figure, () => laid);
  const made = makeView(figure, {
    tools: document.querySelector('.tools[data-for="map"]'), most: 60,
    laid: (view, taken) => { laid = { view, taken }; crafts(); },
    changed: (view) => {
      const about = (width * view.w) / 8, unit = about > 0.5 * units.far[1] ? units.far : units.distance;
      const step = niceStep(about / unit[1]);
      scale.style.width = `${(100 * step * unit[1]) / (width * view.w)}%`;
      scale.firstChild.textContent = num(step, step >= 1 ? 0 : 2, unit[0]);
    },
    point: (event, [x, y]) => {
      const e = ground.west + x * width, n = ground.north - y * height;
      const near = nearestTrack(data.lines, e, n);
      if (near && near.away < 14 * made.pixel()[0] * width) { pointAt(near.k, near.i); tip.rows(event, sampleRows(near.k, near.i)); return; }
      nowhere();
      const zone = event.target.dataset && event.target.dataset.words;
      tip.rows(event, groundRows(e, n, near).concat(zone ? [['here', zone]] : []));
    },
  });
  watchers.push((k, i) => {
    if (k < 0) { cursor.setAttribute('d', ''); return; }
    const line = data.lines[k], x = (line.e[i] - ground.west) * unit, y = (ground.north - line.n[i]) * unit;
    cursor.setAttribute('d', `M${x} ${y}h0`);
  });
}

const timeStep = (least) => [0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600].find((s) => s >= least) ||
  3600 * Math.ceil(least / 3600);

const MOST_ROWS = 12;

function startChart(figure) {
  const plot = figure.querySelector('.plot'), x0 = +figure.dataset.x0, x1 = +figure.dataset.x1;
  const y0 = +figure.dataset.y0, y1 = +figure.dataset.y1;
  const xticks = figure.querySelector('.xticks'), grids = figure.querySelector('.grids'), cursor = figure.querySelector('.cursor');
  const name = figure.id, k = name.startsWith('profile-') ? lineOf(+name.slice(8)) : -1, own = data.charts[name];
  const xs = k >= 0 ? data.lines[k].s : own.x, size = +figure.dataset.size || 0; // of the unit of x; 0 for a time

  function retick(view) {
    const from = x0 + view.x * (x1 - x0), span = view.w * (x1 - x0);
    const roughly = span / Math.max(3, Math.min(9, plot.clientWidth / 90));
    const inUnit = size ? niceStep(roughly / size) : 0, step = size ? size * inUnit : timeStep(roughly);
    const decimals = size ? Math.max(0, -Math.floor(Math.log10(inUnit) + 1e-9)) : step < 1 ? 1 : 0;
    for (const old of grids.querySelectorAll('path:not(.y)')) old.remove();
    xticks.textContent = '';
    for (let i = Math.ceil(from / step - 1e-9); i * step <= from + span * (1 + 1e-9); i++) {
      const label = document.createElement('span'), line = document.createElementNS('http://www.w3.org/2000/svg', 'path');
      label.textContent = size ? num(i * inUnit, decimals) : duration(i * step, decimals);
      label.style.left = `${(100 * (i * step - from)) / span}%`;
      label.classList.toggle('last', i * step > from + 0.95 * span);
      xticks.append(label);
      line.setAttribute('class', 'grid');
      line.setAttribute('d', `M${(10000 * (i * step - x0)) / (x1 - x0)} 0V10000`);
      grids.append(line);
    }
  }

  const nearest = (x) => {
    let low = 0, high = xs.length - 1;
    while (high - low > 1) { const m = (low + high) >> 1; if (xs[m] < x) low = m; else high = m; }
    return x - xs[low] < xs[high] - x ? low : high;
  };
  const mark = (i) => cursor.setAttribute('d', i < 0 ? '' : `M${(10000 * (xs[i] - x0)) / (x1 - x0)} 0V10000`);

  const made = makeView(plot, {
    tools: document.querySelector(`.tools[data-for="${name}"]`), across: true, changed: retick,
    point: (event, [u, v]) => {
      const i = nearest(x0 + u * (x1 - x0)), words = event.target.dataset && event.target.dataset.words;
      if (k >= 0) {
        pointAt(k, i);
        tip.rows(event, sampleRows(k, i).concat(words ? [['here', words]] : []));
        return;
      }
      nowhere();
      mark(i);
      const x = own.xunit === 'time' ? duration(own.x[i], 1) : num(own.x[i], own.xdecimals, units[own.xunit]);
      const rows = [[own.xname || 'time', x]];
      const known = own.series.filter((s) => s.y[i] !== null), y = y1 - v * (y1 - y0);
      if (known.length > MOST_ROWS) known.sort((a, b) => Math.abs(a.y[i] - y) - Math.abs(b.y[i] - y));
      for (const s of known.slice(0, MOST_ROWS)) rows.push([s.name, num(s.y[i], s.decimals, units[s.unit])]);
      if (known.length > MOST_ROWS) rows.push(['farther from the pointer', `${known.length - MOST_ROWS} more`]);
      tip.rows(event, rows);
    },
  });
  watchers.push((which, i) => mark(which === k && k >= 0 ? i : -1));
  const across = (x) => (10000 * (x - x0)) / (x1 - x0);
  if (data.replay && (k >= 0 || !own.xname)) {
    startChartTime(plot.querySelector('svg'), k, xs.map(across), across, (z) => (10000 * (y1 - z)) / (y1 - y0));
  }
  new ResizeObserver(() => retick(made.view)).observe(plot);
}

// Profiles are numbered by vehicle, lines by those that have one.
const lineOf = (index) => data.lines.findIndex((line) => line.index === index);
