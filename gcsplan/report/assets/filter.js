// The filter over the table of all vehicles: it hides the rows of the others in every such table, and their tracks.
function startFilter() {
  const label = document.querySelector('label.filter');
  if (!label) return;
  const box = label.querySelector('input'), count = label.querySelector('span');
  const by = (nodes, key) => {
    const found = new Map();
    for (const node of nodes) found.set(node.dataset[key], [...(found.get(node.dataset[key]) || []), node]);
    return found;
  };
  const rows = by(document.querySelectorAll('tr[data-vehicle]'), 'vehicle');
  const tracks = by(document.querySelectorAll('#map [data-line]'), 'line');
  const texts = new Map([...document.querySelectorAll('#vehicles tr[data-vehicle]')].map((row) => [row.dataset.vehicle, row.textContent.toLowerCase()]));
  function show() {
    const words = box.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const [number, text] of texts) {
      const fits = words.every((word) => text.includes(word));
      for (const row of rows.get(number) || []) row.hidden = !fits;
      for (const track of tracks.get(number) || []) track.style.display = fits ? '' : 'none';
      if (fits) unwanted.delete(+number); else unwanted.add(+number);
      shown += fits ? 1 : 0;
    }
    count.textContent = `${shown} of ${texts.size}`;
    document.getElementById('map').classList.toggle('filtered', shown < texts.size);
    for (const move of movers) move();
  }
  label.hidden = false;
  box.addEventListener('input', show);
  window.addEventListener('beforeprint', () => { box.value = ''; show(); });
  for (const [number, own] of rows) {
    for (const row of own) {
      for (const [event, on] of [['pointerenter', true], ['pointerleave', false]]) {
        row.addEventListener(event, () => { for (const track of tracks.get(number) || []) track.classList.toggle('on', on); });
      }
    }
  }
  count.textContent = `${texts.size} of ${texts.size}`;
}
