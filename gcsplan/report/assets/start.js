// Each figure on its own: what fails in one is told in the console, and the others are there all the same.
document.documentElement.classList.add('live');
const starts = [startMap, ...[...document.querySelectorAll('figure.chart')].map((f) => () => startChart(f)), startScene, startReplay];
for (const start of starts) {
  try { start(); } catch (error) { console.error(error); }
}
// A tap beside every figure puts the tip away.
document.addEventListener('pointerdown', (event) => { if (!event.target.closest('.view')) { tip.hide(); nowhere(); } });
document.documentElement.dataset.ready = 'yes';
