// Time, controls, and what the spheres look like at a time.

import { GRADIENT, errorShare, islandColours, islands, ramp } from 'report/colours';

const byId = (id) => document.getElementById(id);
const themed = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

function linear(hex) {
  return [1, 3, 5].map((at) => (parseInt(hex.slice(at, at + 2), 16) / 255) ** 2.2);
}

function option(select, value, text) {
  select.append(new Option(text, value));
}

export class Player {
  constructor(payload, tracks, stage) {
    Object.assign(this, { payload, tracks, stage, time: 0, playing: false, listeners: [] });
    const { count, frames, sides } = payload;
    this.last = frames - 1;
    this.positions = sides.map(() => new Float32Array(3 * count));
    this.quaternions = sides.map(() => new Float32Array(4 * count));
    this.values = new Float32Array(count);
    this.colours = new Float32Array(3 * count);
    this.parent = new Int32Array(count);
    this.sizes = new Int32Array(count);
    this.order = new Int32Array(count);
    this.#controls();
    this.#labels();
    this.seek(0);
    requestAnimationFrame((now) => { this.before = now; this.#tick(now); });
  }

  // Go to a time [s] since the start.
  seek(seconds) {
    this.time = Math.min(Math.max(seconds, 0), this.last * this.payload.dt);
    byId('scrubber').value = this.time;
    byId('clock').value = `${this.time.toFixed(2)} / ${(this.last * this.payload.dt).toFixed(1)} s`;
    this.#pose();
    for (const listener of this.listeners) listener(this.time);
  }

  play(playing) {
    if (playing && this.time >= this.last * this.payload.dt) this.seek(0);
    this.playing = playing;
    byId('play').textContent = playing ? '❚❚' : '▶';
  }

  #tick(now) {
    const passed = Math.min((now - this.before) / 1000, 0.25);
    this.before = now;
    if (this.playing) {
      this.seek(this.time + passed * Number(byId('speed').value));
      if (this.time >= this.last * this.payload.dt) this.play(false);
    }
    if (this.stage.stale) this.stage.draw();
    requestAnimationFrame((next) => this.#tick(next));
  }

  #pose() {
    const place = this.time / this.payload.dt;
    this.tracks.forEach((track, side) => {
      track.positionsAt(place, this.positions[side]);
      track.quaternionsAt(place, this.quaternions[side]);
      this.stage.sides[side].place(this.positions[side], this.quaternions[side]);
    });
    this.paint();
  }

  paint() {
    const place = this.time / this.payload.dt;
    const { count, dt, radii, fastest } = this.payload;
    const mode = byId('colour').value;
    this.tracks.forEach((track, side) => {
      if (mode === 'speed') {
        track.speedsAt(place, dt, this.values);
        this.values.forEach((speed, sphere) => ramp(speed / fastest, this.colours, 3 * sphere));
      } else if (mode === 'error') {
        const [one, other] = this.positions;
        for (let at = 0; at < 3 * count; at += 3) {
          const error = Math.hypot(one[at] - other[at], one[at + 1] - other[at + 1], one[at + 2] - other[at + 2]);
          ramp(errorShare(error, radii[at / 3]), this.colours, at);
        }
      } else if (mode === 'island') {
        islands(this.positions[side], radii, this.parent, this.order);
        islandColours(this.parent, this.sizes, this.colours);
      } else {
        const colour = linear(themed(side ? 'ball-reference' : 'ball-predicted'));
        for (let at = 0; at < 3 * count; at += 3) this.colours.set(colour, at);
      }
      this.stage.sides[side].paint(this.colours);
    });
    this.stage.stale = true;
  }

  #controls() {
    const { sides, dt } = this.payload;
    const [view, colour, scrubber] = ['view', 'colour', 'scrubber'].map(byId);
    if (sides.length > 1) {
      option(view, 'overlay', `${sides[0]} and ${sides[1]}`);
      option(view, 'beside', 'side by side');
      option(colour, 'error', 'error');
    }
    sides.forEach((name, index) => option(view, index, name));
    for (const name of ['speed', 'island']) option(colour, name, name);
    option(colour, 'none', 'none');
    colour.value = 'none';
    view.value = sides.length > 1 ? 'beside' : '0';
    this.stage.show(view.value);
    scrubber.max = this.last * dt;
    scrubber.addEventListener('input', () => this.seek(Number(scrubber.value)));
    byId('play').addEventListener('click', () => this.play(!this.playing));
    byId('back').addEventListener('click', () => this.#step(-1));
    byId('forth').addEventListener('click', () => this.#step(1));
    view.addEventListener('change', () => { this.stage.show(view.value); this.#labels(); });
    colour.addEventListener('change', () => { this.paint(); this.#labels(); });
    document.addEventListener('keydown', (event) => {
      if (event.target.matches('input, select, button, summary')) return;
      const act = { ' ': () => this.play(!this.playing), ArrowLeft: () => this.#step(-1), ArrowRight: () => this.#step(1) }[event.key];
      if (act) { event.preventDefault(); act(); }
    });
  }

  #step(frames) {
    this.play(false);
    const place = this.time / this.payload.dt;
    const next = frames > 0 ? Math.floor(place + 1e-6) + 1 : Math.ceil(place - 1e-6) - 1;
    this.seek(next * this.payload.dt);
  }

  // Which side is which, and what the colours mean.
  #labels() {
    const { sides, radii, fastest } = this.payload;
    const view = byId('view').value;
    const mode = byId('colour').value;
    const shown = { overlay: [0, 1], beside: [1, 0] }[view] ?? [Number(view)];
    const labels = shown.map((side) => {
      const label = document.createElement('span');
      label.textContent = `${sides[side]}${view === 'overlay' && side ? ' (translucent)' : ''}`;
      if (mode === 'none') {
        const dot = document.createElement('i');
        dot.style.background = `var(--ball-${side ? 'reference' : 'predicted'})`;
        label.prepend(dot);
      }
      return label;
    });
    byId('labels').replaceChildren(...labels);
    byId('labels').classList.toggle('beside', view === 'beside');
    byId('scale').hidden = !['error', 'speed'].includes(mode);
    byId('scale-bar').style.background = GRADIENT;
    const radius = Math.max(...radii);
    const [low, high] = mode === 'error'
      ? [`${(1e-3 * radius).toPrecision(1)} m`, `${+(10 * radius).toPrecision(2)} m (log)`]
      : ['0', `${fastest.toPrecision(2)} m/s`];
    byId('scale-low').textContent = low;
    byId('scale-high').textContent = high;
  }
}
