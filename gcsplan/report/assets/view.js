// A figure that can be moved and enlarged: an SVG whose viewBox moves, and marks over it that keep their size.
function makeView(figure, options) {
  const svg = figure.querySelector('svg'), [, , W, H] = svg.getAttribute('viewBox').split(' ').map(Number);
  const marks = marksOf(figure);
  for (const title of svg.querySelectorAll('title')) {
    title.parentNode.dataset.words = title.textContent;
    title.remove();
  }
  const view = { x: 0, y: 0, w: 1, h: 1 }, most = options.most || 40;

  function arrange() {
    const taken = layMarks(figure, marks, view);
    if (options.laid) options.laid(view, taken);
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
  const again = () => { for (const m of marks) m.w = 0; arrange(); };
  new ResizeObserver(again).observe(figure);
  for (const when of ['beforeprint', 'afterprint']) window.addEventListener(when, again); // paper is narrower
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
