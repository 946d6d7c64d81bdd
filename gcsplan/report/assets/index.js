const box = document.getElementById('filter');
const rows = Array.from(document.querySelectorAll('#results tbody tr'));
const texts = rows.map((row) => row.textContent.toLowerCase());
const lines = new Map();
for (const line of document.querySelectorAll('#tracks [data-row]')) lines.set(line.dataset.row, line);
const count = document.getElementById('count');
function show() {
  const words = box.value.toLowerCase().split(/\s+/).filter(Boolean);
  let shown = 0;
  rows.forEach((row, i) => {
    const fits = words.every((word) => texts[i].includes(word));
    row.hidden = !fits;
    const line = lines.get(row.dataset.row);
    if (line) line.style.display = fits ? '' : 'none';
    shown += fits ? 1 : 0;
  });
  count.textContent = `${shown} of ${rows.length}`;
}
box.closest('label').hidden = false;
box.addEventListener('input', show);
rows.forEach((row) => {
  const line = lines.get(row.dataset.row);
  if (!line) return;
  row.addEventListener('pointerenter', () => line.classList.add('on'));
  row.addEventListener('pointerleave', () => line.classList.remove('on'));
});
show();
