// Turns the report's list of candidates into an interactive view. The page works without it: what cannot be shown stays
// a line that says so, above the still pictures.
import { makeChoosable } from './candidates.js';
import { makePlayer } from './player.js';
import { openStage } from './stage.js';
import css from './viewer.css';
import html from './viewer.html';

function fillLegend(list, stage) {
  const entry = (...parts) => {
    const item = document.createElement('li');
    item.append(...parts);
    list.append(item);
  };
  const coloured = (colour, text) => {
    const swatch = document.createElement('i');
    swatch.style.background = colour;
    entry(swatch, text);
  };
  const isUnseen = ({ name }) => name.endsWith('(not seen)');
  const materials = stage.materials();
  for (const { name, colour } of materials.filter((material) => !isUnseen(material))) coloured(colour, name);
  const unseen = materials.find(isUnseen);
  if (unseen) coloured(unseen.colour, 'paler: no reading shows that face');
  const box = document.createElement('input'), label = document.createElement('label');
  box.type = 'checkbox';
  label.append(box, ' depth readings');
  entry(label);
  box.addEventListener('change', () => stage.showPoints(box.checked));
}

async function start() {
  const viewer = document.getElementById('viewer');
  const note = viewer.querySelector('.note');
  const bytes = Uint8Array.from(atob(document.getElementById('scene-glb').textContent.trim()), (c) => c.charCodeAt(0));
  const style = document.createElement('style');
  style.textContent = css;
  document.head.append(style);
  const inside = document.createElement('div');
  inside.innerHTML = html;
  viewer.append(inside);
  viewer.parentElement.classList.add('live');  // the layout, before the canvas is measured
  const stage = await openStage(inside.querySelector('canvas'), bytes).catch(() => null);
  if (!stage) {
    style.remove();
    inside.remove();
    viewer.parentElement.classList.remove('live');
    note.textContent = 'This browser offers no WebGL, so the interactive view is left out; see the still pictures.';
    return;
  }
  note.remove();
  fillLegend(inside.querySelector('.legend'), stage);
  for (const button of inside.querySelectorAll('[data-look]')) {
    button.addEventListener('click', () => stage.lookFrom(button.dataset.look));
  }
  const player = makePlayer(inside, stage);
  makeChoosable(document.getElementById('candidates'), (index) => {
    stage.choose(index);
    player.rewind();
  });
  const stills = document.getElementById('stills');
  stills.open = false;
  window.addEventListener('beforeprint', () => { stills.open = true; });
}

start();
