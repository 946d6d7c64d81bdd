// Each figure on its own: an error in one goes to the console, and the others are there all the same.
document.documentElement.classList.add('live');
// The briefing's map is laid out when it is printed, which is the only time it is shown.
function startBriefing() {
  const figure = document.querySelector('.briefing .map'), marks = marksOf(figure);
  window.addEventListener('beforeprint', () => layMarks(figure, marks, { x: 0, y: 0, w: 1, h: 1 }));
}
const starts = [startMap, startBriefing, ...[...document.querySelectorAll('figure.chart')].map((f) => () => startChart(f)), startScene, startReplay, startFilter];
for (const start of starts) {
  try { start(); } catch (error) { console.error(error); }
}
// A tap beside every figure puts the tip away.
document.addEventListener('pointerdown', (event) => { if (!event.target.closest('.view')) { tip.hide(); nowhere(); } });
document.documentElement.dataset.ready = 'yes';
