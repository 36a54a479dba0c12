// Curves over time by uPlot, with the replay's time in each of them.

/* global uPlot */

const themed = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

// What a curve looks like by the words of its style.
function looks(style) {
  const [colour, ...ways] = style.split(' ');
  if (colour === 'bound') return { stroke: themed('bound'), dash: [3, 4], width: 1 };
  if (colour === 'floor') return { stroke: themed('chaos'), width: 1.4 };
  return {
    stroke: themed(colour),
    width: ways.includes('thin') ? 0.8 : 1.8,
    dash: ways.includes('dashed') ? [6, 4] : undefined,
  };
}

function number(value) {
  if (value == null) return '';
  const size = Math.abs(value);
  return size !== 0 && (size < 0.01 || size >= 1e5) ? value.toExponential(2) : String(+value.toPrecision(4));
}

function axis(label) {
  return {
    label,
    stroke: themed('faint'),
    grid: { stroke: themed('line'), width: 1 },
    ticks: { stroke: themed('line'), width: 1 },
    font: '12px system-ui, sans-serif',
    labelFont: '12px system-ui, sans-serif',
    labelSize: 22,
  };
}

const tick = (value) => {
  if (value === 0) return '0';
  const size = Math.abs(value);
  return size < 0.001 || size >= 1e6 ? value.toExponential(0) : String(+value.toPrecision(6));
};

function draw(holder, chart, player) {
  const vertical = { ...axis(chart.unit), size: 62, values: (plot, ticks) => ticks.map((v) => (v == null ? '' : tick(v))) };
  if (chart.log) {  // whole decades only
    const decades = (plot, ticks) => ticks.map((v) => (Math.abs(Math.log10(v) % 1) < 1e-9 ? v : null));
    vertical.filter = decades;
    vertical.grid.filter = decades;
    vertical.ticks.filter = decades;
  }
  const options = {
    width: holder.clientWidth,
    height: 250,
    scales: { x: { time: false }, y: chart.log ? { distr: 3 } : {} },
    axes: [axis('time [s]'), vertical],
    series: [
      { label: 'time [s]', value: (plot, value) => number(value) },
      ...chart.curves.map((curve) => ({
        label: curve.label, ...looks(curve.style), points: { show: false }, value: (plot, value) => number(value),
      })),
    ],
    cursor: { sync: { key: chart.apart ? 'recording' : 'time' }, drag: { x: true, y: false } },
    legend: { markers: { width: 2, dash: (plot, index) => (chart.curves[index - 1]?.style.includes('dashed') ? 'dashed' : 'solid') } },
  };
  const plot = new uPlot(options, [chart.times, ...chart.curves.map((curve) => curve.values)], holder);
  if (chart.apart) return { plot };
  const now = document.createElement('div');
  now.className = 'now';
  plot.over.append(now);
  const move = (time) => {
    const place = plot.valToPos(time, 'x');
    now.style.transform = `translateX(${place}px)`;
    const step = chart.times.length > 1 ? chart.times[1] - chart.times[0] : 1;
    plot.setLegend({ idx: Math.min(Math.round((time - chart.times[0]) / step), chart.times.length - 1) });
    now.style.visibility = place >= 0 && place <= plot.over.clientWidth ? 'visible' : 'hidden';
  };
  plot.over.addEventListener('click', (event) => player?.seek(plot.posToVal(event.offsetX, 'x')));
  return { plot, move };
}

// All charts; they follow the player, where there is one, the window and the theme.
export function showCharts(container, charts, player) {
  const holders = charts.map((chart) => {
    const card = document.createElement('div');
    card.className = 'chart';
    card.dataset.key = chart.key;
    const heading = document.createElement('h3');
    heading.textContent = `${chart.title} [${chart.unit}]`;
    const holder = document.createElement('div');
    card.append(heading, holder);
    if (chart.note) {
      const note = document.createElement('p');
      note.textContent = chart.note;
      card.append(note);
    }
    container.append(card);
    return holder;
  });
  let drawn = [];
  const redraw = () => {
    for (const { plot } of drawn) plot.destroy();
    drawn = charts.map((chart, index) => draw(holders[index], chart, player));
    for (const { move } of drawn) move?.(player?.time ?? 0);
  };
  redraw();
  player?.listeners.push((time) => { for (const { move } of drawn) move?.(time); });
  let width = container.clientWidth;
  new ResizeObserver(() => {
    if (container.clientWidth === width) return;
    width = container.clientWidth;
    redraw();
  }).observe(container);
  return { redraw };
}
