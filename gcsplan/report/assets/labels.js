// Labels of a figure's marks: each beside its own symbol, on no other symbol and on no other label; otherwise it waits for
// more room. Pixels, y down.

// `things`: {x, y, r, w, h, inside}, the best first: a symbol of radius r (0: none) with a label of w by h, which lies over
// its place if `inside`. `taken`: boxes [left, top, right, bottom] that are no place for a label; placed ones join them.
// The answer holds [left, top] of each label, or null where there is no room.
function layLabels(things, width, height, taken) {
  for (const t of things) if (t.r > 0) taken.push([t.x - t.r, t.y - t.r, t.x + t.r, t.y + t.r]);
  return things.map((t) => {
    if (!t.w) return null;
    const { x, y, w, h } = t, beside = reachOf(t, things) + 2, aside = 0.75 * beside;
    const spots = t.inside ? [0, -1.2, 1.2, -2.2, 2.2].map((k) => [x - 0.5 * w, y + (k - 0.5) * h]) : [
      [x - 0.5 * w, y - beside - h], [x - 0.5 * w, y + beside], [x + beside + 1, y - 0.5 * h], [x - beside - 1 - w, y - 0.5 * h],
      [x + aside, y - aside - h], [x - aside - w, y - aside - h], [x + aside, y + aside], [x - aside - w, y + aside]];
    const found = spots.find(([left, top]) => left >= 0 && left + w <= width && top >= 0 && top + h <= height
      && !taken.some((b) => left < b[2] && b[0] < left + w && top < b[3] && b[1] < top + h));
    if (found) taken.push([found[0] - 2, found[1], found[0] + w + 2, found[1] + h]);
    return found || null;
  });
}

// How far symbols reach around a place: larger ones may lie over its own.
function reachOf(t, things) {
  let reach = t.r;
  for (const o of things) {
    if (Math.abs(o.x - t.x) >= o.r) continue;
    const away = Math.hypot(o.x - t.x, o.y - t.y);
    if (away < o.r) reach = Math.max(reach, away + o.r);
  }
  return reach;
}

// The marks of a figure, the best first.
function marksOf(figure) {
  const marks = [...figure.querySelectorAll('.mark')].map((el) => {
    const words = el.title;
    el.removeAttribute('title'); // the tip tells it, and a browser's own would cover it
    const inside = el.classList.contains('name') && !el.classList.contains('beside');
    return { el, label: el.querySelector('b'), u: +el.dataset.x, v: +el.dataset.y, rank: +el.dataset.rank, words, inside };
  });
  return marks.sort((a, b) => a.rank - b.rank);
}

// Moves a figure's marks to their places in `view`, the shown part of it, and their labels to where there is room. The
// boxes that are taken then are the answer.
function layMarks(figure, marks, view) {
  const width = figure.clientWidth, height = figure.clientHeight, frame = figure.getBoundingClientRect();
  const shown = [];
  for (const m of marks) {
    const u = (m.u - view.x) / view.w, v = (m.v - view.y) / view.h, out = u < 0 || u > 1 || v < 0 || v > 1;
    m.el.classList.toggle('out', out);
    if (out) continue;
    m.el.style.left = `${100 * u}%`;
    m.el.style.top = `${100 * v}%`;
    shown.push(m);
    m.x = u * width;
    m.y = v * height;
  }
  for (const m of shown) {
    if (m.w) continue;
    m.w = m.label.offsetWidth;
    m.h = m.label.offsetHeight;
    const symbol = getComputedStyle(m.el, '::before');
    m.r = symbol.display === 'none' ? 0 : 0.5 * parseFloat(symbol.width) * (m.el.classList.contains('rally') ? 1.42 : 1);
  }
  const taken = [...figure.querySelectorAll('.north, .scale, .scale b')].map((el) => {
    const box = el.getBoundingClientRect();
    return [box.left - frame.left, box.top - frame.top, box.right - frame.left, box.bottom - frame.top];
  });
  const places = layLabels(shown, width, height, taken);
  shown.forEach((m, i) => {
    m.el.classList.toggle('mute', !places[i]);
    if (places[i]) {
      m.label.style.cssText = `left:${places[i][0] - m.x}px;top:${places[i][1] - m.y}px;bottom:auto;transform:none;margin:0`;
    }
  });
  return taken;
}
