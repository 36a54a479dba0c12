// Puts the page together.

import { Track } from 'report/decode';
import { Stage } from 'report/stage';
import { Player } from 'report/player';
import { showCharts } from 'report/charts';

const payload = JSON.parse(document.getElementById('payload').textContent);

function failure(error) {
  const text = document.createElement('p');
  text.className = 'failure';
  text.textContent = `The replay needs WebGL 2, which this browser does not give: ${error.message}`;
  document.getElementById('stage').replaceChildren(text);
  document.querySelector('.controls').hidden = true;
  return null;
}

const { frames, count } = payload;
const tracks = await Promise.all(payload.tracks.map((packed) => Track.of(packed, frames, count)));
let player = null;
try {
  player = new Player(payload, tracks, new Stage(document.getElementById('stage'), payload));
} catch (error) {
  player = failure(error);
}
const charts = showCharts(document.getElementById('charts'), payload.charts, player);
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
  player?.stage.theme();
  player?.paint();
  charts.redraw();
});
window.report = { player, payload };  // for the console, and for tests
document.documentElement.dataset.ready = 'yes';
