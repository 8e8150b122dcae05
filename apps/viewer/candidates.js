// The table of candidates as a list to choose from.

/** Makes each row of the table choose its candidate: by click, or up and down on its button. `chosen` is told the index. */
export function makeChoosable(table, chosen) {
  const rows = [...table.querySelectorAll('tr[data-row]')];
  const buttons = rows.map((row, index) => {
    const cell = row.firstElementChild, button = document.createElement('button');
    button.type = 'button';
    button.textContent = cell.textContent;
    button.setAttribute('aria-label', `Show the candidate of rank ${index + 1}`);
    cell.replaceChildren(button);
    row.addEventListener('click', () => choose(index));
    button.addEventListener('keydown', (event) => {
      const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
      if (!step || !rows[index + step]) return;
      event.preventDefault();
      buttons[index + step].focus();
      choose(index + step);
    });
    return button;
  });
  function choose(index) {
    rows.forEach((row, i) => {
      row.classList.toggle('chosen', i === index);
      buttons[i].setAttribute('aria-pressed', String(i === index));
    });
    chosen(index);
  }
  choose(0);
}
