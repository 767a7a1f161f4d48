// Where a vehicle was and its own estimate, from above.

/** A 95 % ellipse: its radius squared over the variance, of two numbers (chi squared). */
const ELLIPSE_95 = 5.991;
/** Most surfacings that have their number beside them. */
const NUMBERED = 25;

/** Points of the 95 % ellipse around an estimated place, to the east and north of it (m). */
function ellipse({ covariance_m2: [nn, ne, ee] }) {
  const points = [];
  const a = Math.sqrt(ELLIPSE_95 * nn);
  const b = a > 0 ? (ELLIPSE_95 * ne) / a : 0;
  const c = Math.sqrt(Math.max(0, ELLIPSE_95 * ee - b * b));
  for (let i = 0; i <= 48; i += 1) {
    const turned = (2 * Math.PI * i) / 48;
    const [cos, sin] = [Math.cos(turned), Math.sin(turned)];
    points.push([b * cos + c * sin, a * cos]);
  }
  return points;
}

/** A trace through points, east and north (m); null makes a gap. */
const through = (points, scale, more) => ({
  x: points.map((p) => p && p[0] * scale), y: points.map((p) => p && p[1] * scale), ...more,
});

const eastNorth = ([north, east]) => [east, north];

/** Two tracks and what is known at each surfacing. */
function planTraces(run, scale, unit) {
  const { surfacings } = run;
  const told = (trace) => ({ ...trace, ...hover(run, unit, scale, trace) });
  const track = (name, label, role, dash) => told({
    x: pick(run.arrays[`${name}_east_m`], 6000, scale), y: pick(run.arrays[`${name}_north_m`], 6000, scale),
    mode: 'lines', name: label, line: { color: values(role), width: 1.8, dash },
  });
  const places = (key, name, role, symbol, more) => ({
    ...told(through(surfacings.map((one) => one[key] && eastNorth(one[key])), scale, {})),
    mode: 'markers', name, marker: marker(role, symbol), ...more,
  });
  const every = Math.ceil(surfacings.length / NUMBERED);
  return [
    pathTrace(run, scale, { line: { color: values('--limit'), width: 1.5, dash: 'dash' } }),
    track('track', 'true track', '--measured', 'solid'),
    track('believed', 'estimated track', '--reference', 'dash'),
    places('true_ned_m', 'true place at surfacing', '--measured', 'circle'),
    through(surfacings.map((one) => eastNorth(one.true_ned_m)), scale, {
      mode: 'text', textposition: 'bottom left', hoverinfo: 'skip', showlegend: false,
      text: surfacings.map((_, i) => (i % every ? '' : `${i + 1} `)),
    }),
    places('believed_ned_m', 'estimated position at surfacing', '--reference', 'diamond'),
    places('fix_ned_m', 'first fix', '--third', 'cross-thin', {
      marker: { size: 15, symbol: 'cross-thin', line: { color: values('--third'), width: 2 } },
    }),
  ];
}

/** What a plan shows of a span of time: extents of both tracks to the east or north (m). */
function planRange(run, name, from, to) {
  const [begin, end] = visible(run, from, to);
  const [low, high] = extent(['track', 'believed'].map(
    (track) => run.arrays[`${track}_${name}_m`].slice(begin, end + 1)));
  return spread([low, high], 1.15 * Math.max(high - low, 50));
}

function drawPlan(panel, element, from, to) {
  const run = page.runs[0];
  const [east, north] = ['east', 'north'].map((name) => planRange(run, name, from, to));
  const longest = Math.max(east[1] - east[0], north[1] - north[0]);
  const [scale, unit] = unitOf(longest);
  const scaled = (range) => range.map((value) => value * scale);
  return reactMap(element, planTraces(run, scale, unit), {
    dragmode: 'zoom',
    xaxis: axis(`east (${unit})`, { range: scaled(east), nticks: 8 }),
    yaxis: axis(`north (${unit})`, { range: scaled(north), nticks: 8 }),
  });
}

// ------------------------------------------------------------------------------- surfacings

/** Most surfacings that have a map of their own. */
const MAPS = 12;
/** How wide and high a map is, at least; room for legend, numbers and titles; fonts (px). */
const ON_SCREEN = { wide: 170, high: 205, legend: 34, left: 46, right: 8, top: 24, bottom: 30, font: 12 };
const ON_PAPER = { wide: 105, high: 132, legend: 24, left: 32, right: 4, top: 18, bottom: 20, font: 9 };

/** Those surfacings that were farthest off, in the order of time, with their numbers. */
function farthestOff({ surfacings }) {
  const numbered = surfacings.map((one, i) => ({ ...one, number: i + 1 }));
  const far = [...numbered].sort((a, b) => b.error_m - a.error_m).slice(0, MAPS);
  return numbered.filter((one) => far.includes(one));
}

/** Where the vehicle came up, around its own estimate: a small map for each, to scale. */
function drawPlaces(panel, element) {
  const shown = farthestOff(page.runs[0]);
  const room = root.classList.contains('paper') ? ON_PAPER : ON_SCREEN;
  const columns = Math.min(shown.length, Math.max(2, Math.floor(element.clientWidth / room.wide)));
  const rows = Math.ceil(shown.length / columns);
  element.style.height = `${room.legend + rows * room.high}px`;
  const [width, height] = [element.clientWidth, element.clientHeight];
  const cell = Math.min(width / columns, 1.6 * room.high);
  const traces = [];
  const layout = {};
  const annotations = [];
  shown.forEach((one, i) => {
    const [column, row] = [i % columns, Math.floor(i / columns)];
    const id = i ? `${i + 1}` : '';
    const off = [0, 1].map((k) => one.true_ned_m[k] - one.believed_ned_m[k]);
    const ring = ellipse(one);
    const reach = 1.15 * Math.max(1, ...off.map(Math.abs), ...ring.flat().map(Math.abs));
    const top = room.legend + row * room.high;
    const x = [column * cell + room.left, (column + 1) * cell - room.right].map((px) => px / width);
    const y = [top + room.high - room.bottom, top + room.top].map((px) => 1 - px / height);
    const common = { xaxis: `x${id}`, yaxis: `y${id}`, showlegend: i === 0 };
    const at = 'east %{x:,.1f} m, north %{y:,.1f} m';
    const place = (name, point, role, symbol) => through([point], 1, {
      ...common, mode: 'markers', name, hovertemplate: at, marker: marker(role, symbol),
    });
    traces.push(
      through(ring, 1, {
        ...common, mode: 'lines', hoverinfo: 'skip', name: '95 % ellipse', fill: 'toself', fillcolor: `${values('--reference')}22`,
        line: { color: values('--reference'), width: 1.2 },
      }),
      place('estimated position', [0, 0], '--reference', 'diamond'),
      place('true place', eastNorth(off), '--measured', 'circle'),
    );
    const ticks = { tickmode: 'array', tickvals: evenTicks(reach), tickformat: ',~r', tickfont: { size: room.font - 2 } };
    const more = { range: [-reach, reach], automargin: false, fixedrange: true, ...ticks };
    layout[`xaxis${id}`] = axis('', { ...more, domain: x, anchor: `y${id}`, scaleanchor: `y${id}` });
    layout[`yaxis${id}`] = axis('', { ...more, domain: y, anchor: `x${id}` });
    annotations.push({
      text: `<b>${one.number}</b> off by ${Number(one.error_m.toPrecision(3)).toLocaleString('en')} m`,
      xref: 'paper', yref: 'paper', x: x[0], y: y[1], xanchor: 'left', yanchor: 'bottom',
      showarrow: false, font: { size: room.font },
    });
  });
  return react(element, traces, {
    ...layout,
    annotations,
    margin: { l: 0, r: 0, t: 0, b: 0 },
    legend: legendOf(element, { x: 0, xanchor: 'left', y: 1, yanchor: 'top' }),
    dragmode: false,
  });
}
