// Where a vehicle was and where it believed to be, from above.

/** A 95 % ellipse: its radius squared over the variance, of two numbers (chi squared). */
const ELLIPSE_95 = 5.991;
/** Most surfacings that have their number beside them. */
const NUMBERED = 25;

/** Points of the 95 % ellipse around a believed place, east and north (m). */
function ellipse({ believed_ned_m: [north, east], covariance_m2: [nn, ne, ee] }) {
  const points = [];
  const a = Math.sqrt(ELLIPSE_95 * nn);
  const b = a > 0 ? (ELLIPSE_95 * ne) / a : 0;
  const c = Math.sqrt(Math.max(0, ELLIPSE_95 * ee - b * b));
  for (let i = 0; i <= 48; i += 1) {
    const turned = (2 * Math.PI * i) / 48;
    const [cos, sin] = [Math.cos(turned), Math.sin(turned)];
    points.push([east + b * cos + c * sin, north + a * cos]);
  }
  return points;
}

/** A trace of lines between points, east and north (m); null makes a gap. */
const lineOf = (points, scale, more) => ({
  x: points.map((p) => p && p[0] * scale), y: points.map((p) => p && p[1] * scale), mode: 'lines',
  hoverinfo: 'skip', ...more,
});

const eastNorth = ([north, east]) => [east, north];

/** Two tracks and what is known at each surfacing. */
function planTraces(run, scale, unit) {
  const { surfacings } = run;
  const at = `east %{x:.3~f} ${unit}, north %{y:.3~f} ${unit}`;
  const track = (name, label, role, dash) => ({
    x: pick(run.arrays[`${name}_east_m`], 6000, scale), y: pick(run.arrays[`${name}_north_m`], 6000, scale),
    mode: 'lines', name: label, hovertemplate: at, line: { color: values(role), width: 1.8, dash },
  });
  const places = (key, name, role, symbol, more) => {
    const points = surfacings.map((one) => (one[key] ? eastNorth(one[key]) : null));
    return {
      ...lineOf(points, scale, {}), mode: 'markers', name, hoverinfo: 'all', hovertemplate: at,
      marker: { color: values(role), size: 9, symbol, line: { color: values('--card'), width: 1.5 } },
      ...more,
    };
  };
  const every = Math.ceil(surfacings.length / NUMBERED);
  return [
    pathTrace(run, scale, {
      hoverinfo: 'skip', line: { color: values('--limit'), width: 1.5, dash: 'dash' },
    }),
    lineOf(surfacings.flatMap((one) => [...ellipse(one), null]), scale, {
      name: '95 % ellipse of the believed place', fill: 'toself',
      fillcolor: `${values('--reference')}22`, line: { color: values('--reference'), width: 1.2 },
    }),
    track('track', 'true track', '--measured', 'solid'),
    track('believed', 'believed track', '--reference', 'dash'),
    places('true_ned_m', 'true place at surfacing', '--measured', 'circle', {
      mode: 'markers+text', textposition: 'bottom left',
      text: surfacings.map((_, i) => (i % every ? '' : `${i + 1} `)),
    }),
    places('believed_ned_m', 'believed place at surfacing', '--reference', 'diamond'),
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
  const isLong = Math.max(east[1] - east[0], north[1] - north[0]) > 2000;
  const [scale, unit] = isLong ? [1e-3, 'km'] : [1, 'm'];
  const scaled = (range) => range.map((value) => value * scale);
  return Plotly.react(element, planTraces(run, scale, unit), {
    ...look(element),
    margin: { l: 60, r: 10, t: 46, b: 40 },
    showlegend: true,
    legend: { orientation: 'h', x: 0, y: 1.01, yanchor: 'bottom' },
    hovermode: 'closest',
    dragmode: 'zoom',
    xaxis: axis(`east (${unit})`, { range: scaled(east), nticks: 8 }),
    yaxis: axis(`north (${unit})`, { range: scaled(north), nticks: 8 }),
  }, { displayModeBar: false, scrollZoom: false });
}
