// A figure that can be moved and enlarged: an SVG whose viewBox moves, and marks over it that keep their size.
function makeView(figure, options) {
  const svg = figure.querySelector('svg'), [, , W, H] = svg.getAttribute('viewBox').split(' ').map(Number);
  const marks = [...figure.querySelectorAll('.mark')].map((el) => {
    const words = el.title;
    el.removeAttribute('title'); // the tip tells it, and a browser's own would cover it
    return { el, label: el.querySelector('b'), x: +el.dataset.x, y: +el.dataset.y, rank: +el.dataset.rank, words };
  });
  for (const title of svg.querySelectorAll('title')) {
    title.parentNode.dataset.words = title.textContent;
    title.remove();
  }
  marks.sort((a, b) => a.rank - b.rank);
  const view = { x: 0, y: 0, w: 1, h: 1 }, most = options.most || 40;

  function arrange() {
    const width = figure.clientWidth, height = figure.clientHeight, taken = [];
    for (const m of marks) {
      const u = (m.x - view.x) / view.w, v = (m.y - view.y) / view.h, out = u < 0 || u > 1 || v < 0 || v > 1;
      m.el.classList.toggle('out', out);
      if (out) continue;
      m.el.style.left = `${100 * u}%`;
      m.el.style.top = `${100 * v}%`;
    }
    for (const m of marks) m.size = m.size || [m.label.offsetWidth, m.label.offsetHeight];
    const shown = marks.filter((m) => !m.el.classList.contains('out'));
    for (const m of shown) {
      m.px = ((m.x - view.x) / view.w) * width;
      m.py = ((m.y - view.y) / view.h) * height;
      if (!m.el.classList.contains('name') && !m.el.classList.contains('tag')) taken.push([m.px - 3, m.py - 3, m.px + 3, m.py + 3]);
    }
    // Above its place, below, to the right, to the left: the first that is free; otherwise a label waits for more room.
    for (const m of shown) {
      const [w, h] = m.size, { px, py } = m, near = m.el.classList.contains('beside') || m.el.classList.contains('tag') ? 2 : 5;
      const inside = m.el.classList.contains('name') && !m.el.classList.contains('beside');
      const places = inside ? [0, -1.2, 1.2, -2.2, 2.2].map((k) => ['', px - 0.5 * w, py + (k - 0.5) * h, k]) : [
        ['', px - 0.5 * w, py - h - near], ['d', px - 0.5 * w, py + near], ['l', px + near + 3, py - 0.5 * h], ['r', px - near - 3 - w, py - 0.5 * h]];
      const found = places.find(([, x, y]) => {
        if (x < 0 || x + w > width || y < 0 || y + h > height) return false;
        return !taken.some((b) => x < b[2] && b[0] < x + w && y + 1 < b[3] && b[1] < y + h - 1);
      });
      for (const side of ['d', 'l', 'r']) m.el.classList.toggle(side, !!found && found[0] === side);
      m.el.classList.toggle('mute', !found);
      if (inside && found) m.label.style.marginTop = `${found[3] * h}px`;
      if (found) taken.push([found[1] - 2, found[2], found[1] + w + 2, found[2] + h]);
    }
  }

  function apply() {
    view.w = Math.min(1, Math.max(1 / most, view.w));
    view.h = options.across ? 1 : view.w;
    view.x = Math.min(1 - view.w, Math.max(0, view.x));
    view.y = Math.min(1 - view.h, Math.max(0, view.y));
    svg.setAttribute('viewBox', `${view.x * W} ${view.y * H} ${view.w * W} ${view.h * H}`);
    figure.classList.toggle('zoomed', view.w < 0.999);
    arrange();
    if (options.changed) options.changed(view);
  }

  function zoom(factor, u = 0.5, v = 0.5) {
    const w = Math.min(1, Math.max(1 / most, view.w / factor)), h = options.across ? 1 : w;
    view.x += u * (view.w - w);
    view.y += v * (view.h - h);
    view.w = w;
    apply();
  }

  const part = (event) => {
    const box = svg.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  };
  const where = (event) => {
    const [u, v] = part(event);
    return [view.x + u * view.w, view.y + v * view.h];
  };

  gestures(figure, {
    drag: (dx, dy) => {
      view.x -= (dx / figure.clientWidth) * view.w;
      view.y -= (dy / figure.clientHeight) * view.h;
      apply();
    },
    pinch: (factor, event) => zoom(factor, ...part(event)),
    point: (event) => {
      const mark = event.target.closest && event.target.closest('.mark');
      const found = mark && marks.find((m) => m.el === mark);
      if (found) tip.words(event, found.words);
      else options.point(event, where(event));
    },
    leave: () => { tip.hide(); nowhere(); },
    movable: () => view.w < 0.999,
  });
  if (options.tools) {
    options.tools.hidden = false;
    options.tools.addEventListener('click', (event) => {
      const what = event.target.dataset.do;
      if (what === 'in') zoom(1.6);
      else if (what === 'out') zoom(1 / 1.6);
      else if (what === 'home') zoom(1e-6);
    });
  }
  new ResizeObserver(() => { for (const m of marks) m.size = null; arrange(); }).observe(figure);
  apply();
  return { view, where, pixel: () => [view.w / figure.clientWidth, view.h / figure.clientHeight] };
}

// Mouse, finger and wheel on one element. A page that is being read is never caught: the wheel enlarges with Ctrl, or once
// the figure was clicked; one finger moves a figure only where that cannot be meant for the page.
function gestures(el, on) {
  const down = new Map();
  let awake = false, spread = 0;
  el.addEventListener('wheel', (event) => {
    if (!awake && !event.ctrlKey) return;
    event.preventDefault();
    on.pinch(Math.exp(-event.deltaY * (event.ctrlKey ? 0.01 : 0.0015)), event);
  }, { passive: false });
  el.addEventListener('dblclick', (event) => on.pinch(2, event));
  el.addEventListener('pointerdown', (event) => {
    down.set(event.pointerId, event);
    if (event.pointerType === 'mouse') { awake = true; event.preventDefault(); }
    spread = 0;
    if (down.size === 1 && !(event.pointerType === 'mouse')) on.point(event);
    try { el.setPointerCapture(event.pointerId); } catch (e) { /* the pointer is gone already */ }
  });
  el.addEventListener('pointermove', (event) => {
    const last = down.get(event.pointerId);
    if (!last) { if (event.pointerType === 'mouse') on.point(event); return; }
    down.set(event.pointerId, event);
    const dx = event.clientX - last.clientX, dy = event.clientY - last.clientY;
    if (down.size === 2) {
      const [a, b] = [...down.values()], now = Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
      const middle = { clientX: 0.5 * (a.clientX + b.clientX), clientY: 0.5 * (a.clientY + b.clientY), target: el };
      if (spread > 0) on.pinch(now / spread, middle);
      spread = now;
      (on.slide || on.drag)(0.5 * dx, 0.5 * dy, event);
    } else if (on.movable()) { tip.hide(); on.drag(dx, dy, event); } else on.point(event);
  });
  const up = (event) => { down.delete(event.pointerId); spread = 0; };
  el.addEventListener('pointerup', up);
  el.addEventListener('pointercancel', up);
  el.addEventListener('pointerleave', (event) => { if (event.pointerType === 'mouse') { awake = false; on.leave(); } });
}
