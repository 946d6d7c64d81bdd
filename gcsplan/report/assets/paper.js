// Paper is white, whatever the screen is, and what is folded is unfolded there; registered first, so that every figure is
// drawn anew in its colours and its width.
window.addEventListener('beforeprint', () => {
  document.documentElement.classList.add('paper');
  for (const part of document.querySelectorAll('details:not([open])')) { part.open = true; part.dataset.folded = ''; }
});
window.addEventListener('afterprint', () => {
  document.documentElement.classList.remove('paper');
  for (const part of document.querySelectorAll('details[data-folded]')) { part.open = false; delete part.dataset.folded; }
});
