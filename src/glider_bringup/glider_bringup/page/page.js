// Draws the panels of a page from the data in it. No request leaves the page.
'use strict';

const page = JSON.parse(document.getElementById('data').textContent);
const values = (tag) => getComputedStyle(document.documentElement).getPropertyValue(tag).trim();

// ------------------------------------------------------------------------------- data

/** Bytes that were deflated and written in base64. */
async function unpack(text) {
  const packed = atob(text);
  const bytes = new Uint8Array(packed.length);
  for (let i = 0; i < packed.length; i += 1) bytes[i] = packed.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Arrays by name: all first bytes of the float32 numbers come first, then all second ones. */
async function unpackArrays(packed) {
  const bytes = await unpack(packed.data);
  const count = bytes.length / 4;
  const ordered = new Uint8Array(bytes.length);
  for (let byte = 0; byte < 4; byte += 1) {
    for (let i = 0; i < count; i += 1) ordered[4 * i + byte] = bytes[byte * count + i];
  }
  const arrays = {};
  let start = 0;
  for (const [name, length] of Object.entries(packed.lengths)) {
    arrays[name] = new Float32Array(ordered.buffer, 4 * start, length);
    start += length;
  }
  return arrays;
}

/**
 * Part of a curve as points to draw: the smallest and the largest value of each of `most` spans,
 * in the order in which they come; everything where there is less than that.
 * With a flag, only the spans in which it is set.
 */
function thin(run, name, flag, from, to, most) {
  const curve = run.arrays[name];
  const marks = flag ? run.arrays[flag] : null;
  const begin = Math.max(0, Math.floor(from / run.spacing) - 2);
  const end = Math.min(curve.length, Math.ceil(to / run.spacing) + 3);
  const group = Math.max(1, Math.ceil((end - begin) / most));
  const x = [];
  const y = [];
  const put = (i, value) => { x.push((i * run.spacing) / page.unit.seconds); y.push(value); };
  for (let start = begin - (begin % group); start < end; start += group) {
    const stop = Math.min(curve.length, start + group);
    let low = -1;
    let high = -1;
    let marked = !marks;
    for (let i = start; i < stop; i += 1) {
      if (curve[i] < curve[low] || (low < 0 && !Number.isNaN(curve[i]))) low = i;
      if (curve[i] > curve[high] || (high < 0 && !Number.isNaN(curve[i]))) high = i;
      if (marks && marks[i] > 0) marked = true;
    }
    if (low < 0 || !marked) {
      put(start, null);
    } else if (marks) {
      put(start, curve[Math.min(low, high)]);
      put(start + group, curve[Math.max(low, high)]);
    } else if (low === high) {
      put(start, curve[low]);
    } else {
      put(start, curve[Math.min(low, high)]);
      put(start + group / 2, curve[Math.max(low, high)]);
    }
  }
  return { x, y };
}

// ------------------------------------------------------------------------------- panels

function look() {
  const ink = values('--ink');
  return {
    paper_bgcolor: 'rgba(0,0,0,0)',
    plot_bgcolor: 'rgba(0,0,0,0)',
    font: { family: getComputedStyle(document.body).fontFamily, size: 13, color: ink },
    hoverlabel: { bgcolor: values('--card'), bordercolor: values('--line'), font: { color: ink } },
    legend: { orientation: 'h', x: 1, xanchor: 'right', y: 1.02, yanchor: 'bottom' },
  };
}

const axis = (title, more) => ({
  title: { text: title, standoff: 6, font: { size: 12 } },
  exponentformat: 'power',
  gridcolor: values('--grid'),
  linecolor: values('--line'),
  zerolinecolor: values('--line'),
  automargin: true,
  ...more,
});

function curveData(panel, curve, from, to, width) {
  return thin(page.runs[curve.run], curve.name, curve.flag, from, to, width);
}

/** Dotted vertical lines at the inflections, over the whole height. */
function inflectionTrace(run) {
  const x = [];
  const y = [];
  for (const time of run.inflections) {
    x.push(time / page.unit.seconds, time / page.unit.seconds, null);
    y.push(0, 1, null);
  }
  return {
    x, y, yaxis: 'y2', mode: 'lines', name: 'inflection', hoverinfo: 'skip',
    line: { color: values('--limit'), width: 1, dash: 'dot' },
  };
}

/** Of runs that lie over each other, the first is broadest, so that all can be seen. */
const lineWidth = (run) => (page.runs.length > 1 ? Math.max(1.4, 3.2 - 0.9 * run) : 1.6);

function drawTime(panel, element, from, to) {
  const traces = panel.curves.map((curve) => ({
    ...curveData(panel, curve, from, to, element.clientWidth),
    mode: 'lines',
    name: curve.label,
    connectgaps: false,
    hoverinfo: curve.flag ? 'skip' : 'all',
    line: {
      color: values(`--${curve.role}`),
      width: curve.flag ? 6 : lineWidth(curve.run),
      dash: curve.dashed ? 'dash' : 'solid',
    },
    opacity: curve.flag ? 0.75 : 1,
  }));
  const reach = extent(traces.map((trace) => trace.y.map(Math.abs)))[1];
  const limits = panel.limits.filter((value) => reach > 0.5 * Math.abs(value)).map((value) => ({
    type: 'line', xref: 'paper', x0: 0, x1: 1, y0: value, y1: value, layer: 'below',
    line: { color: values('--limit'), width: 1.5, dash: 'longdash' },
  }));
  if (panel.inflections >= 0) traces.push(inflectionTrace(page.runs[panel.inflections]));
  return Plotly.react(element, traces, {
    ...look(),
    margin: { l: 64, r: 14, t: 24, b: 38 },
    showlegend: true,
    hovermode: 'x unified',
    dragmode: 'zoom',
    shapes: limits,
    xaxis: axis(`time (${page.unit.name})`, {
      range: [from / page.unit.seconds, to / page.unit.seconds], hoverformat: '.4~f',
    }),
    yaxis: axis(panel.axis, {
      fixedrange: true, automargin: false, nticks: 6, type: panel.log ? 'log' : 'linear',
      autorange: panel.inverted ? 'reversed' : true,
      ...(panel.log ? { dtick: 3 } : {}),
    }),
    yaxis2: { overlaying: 'y', range: [0, 1], visible: false, fixedrange: true },
  }, { responsive: true, displayModeBar: false });
}

/** Zoomed-in part of a track, as indices of its samples. */
function visible(run, from, to) {
  const last = run.arrays.track_north_m.length - 1;
  const begin = Math.max(0, Math.min(last, Math.floor(from / run.spacing / 2)));
  return [begin, Math.max(begin, Math.min(last, Math.ceil(to / run.spacing / 2)))];
}

/** Every so many elements, and the last; scaled. */
function pick(array, most, scale, begin = 0, end = array.length - 1) {
  const step = Math.max(1, Math.ceil((end - begin) / most));
  const out = [];
  for (let i = begin; i < end; i += step) out.push(array[i] * scale);
  if (end >= begin && array.length) out.push(array[end] * scale);
  return out;
}

/** Smallest and largest of some arrays; nothing of them may be finite. */
function extent(arrays) {
  let low = Infinity;
  let high = -Infinity;
  for (const array of arrays) {
    for (const value of array) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  return low <= high ? [low, high] : [0, 0];
}

const spread = ([low, high], span) => [(low + high - span) / 2, (low + high + span) / 2];

/** What both maps show: scale, unit, and the extent of what was flown. */
function mapFrame() {
  const east = extent(page.runs.map((run) => run.arrays.track_east_m));
  const north = extent(page.runs.map((run) => run.arrays.track_north_m));
  const depth = extent(page.runs.map((run) => run.arrays.track_depth_m));
  const span = Math.max(east[1] - east[0], north[1] - north[0], 20);
  const [scale, unit] = span > 2000 ? [1e-3, 'km'] : [1, 'm'];
  return { east, north, depth, span, scale, unit };
}

function pathTrace(run, scale, more) {
  return {
    x: run.path.map((p) => p[1] * scale), y: run.path.map((p) => p[0] * scale), mode: 'lines',
    line: { color: values(page.runs.length > 1 ? '--limit' : '--reference'), width: 2, dash: 'dash' },
    name: 'desired path', ...more,
  };
}

/** Arrows along a track, with the direction and the speed of the water. */
function currentTrace(run, frame) {
  const { track_east_m: e, track_north_m: n, water_east_kn: we, water_north_kn: wn } = run.arrays;
  const fastest = we.reduce((most, v, i) => Math.max(most, Math.hypot(v, wn[i]) || 0), 0);
  const x = [];
  const y = [];
  const size = [];
  const length = (0.09 * frame.span) / fastest;
  for (let k = 0; k < 12 && fastest > 0; k += 1) {
    const i = Math.round((k * (e.length - 1)) / 11);
    x.push(e[i] * frame.scale, (e[i] + we[i] * length) * frame.scale, null);
    y.push(n[i] * frame.scale, (n[i] + wn[i] * length) * frame.scale, null);
    size.push(0, 9, 0);
  }
  return {
    x, y, mode: 'lines+markers', name: `current, up to ${fastest.toFixed(2)} kn`, hoverinfo: 'skip',
    line: { color: values('--third'), width: 1.6 },
    marker: { symbol: 'arrow', angleref: 'previous', size, opacity: 1, color: values('--third') },
  };
}

const trackColour = (i) => values(page.runs.length > 1 ? `--run${i % 8}` : '--measured');
const trackName = (run) => (page.runs.length > 1 ? run.label : 'track');
const isZoomed = (from, to) => from > 0 || to < page.duration;

function drawTrack(panel, element, from, to) {
  const frame = mapFrame();
  const traces = [];
  page.runs.forEach((run, i) => {
    if (run.own_path) {
      traces.push(pathTrace(run, frame.scale, { showlegend: i === 0, hoverinfo: 'skip' }));
    }
  });
  if (page.runs.length === 1) traces.push(currentTrace(page.runs[0], frame));
  page.runs.forEach((run, i) => {
    const { track_east_m: e, track_north_m: n } = run.arrays;
    traces.push({
      x: pick(e, 4000, frame.scale), y: pick(n, 4000, frame.scale), mode: 'lines', name: trackName(run),
      line: { color: trackColour(i), width: lineWidth(i) + 0.4 },
      hovertemplate: `east %{x:.3~f} ${frame.unit}, north %{y:.3~f} ${frame.unit}`,
    });
    const [begin, end] = visible(run, from, to);
    traces.push({
      x: isZoomed(from, to) ? pick(e, 2000, frame.scale, begin, end) : [],
      y: isZoomed(from, to) ? pick(n, 2000, frame.scale, begin, end) : [],
      mode: 'lines', name: 'zoomed in', hoverinfo: 'skip', showlegend: i === 0 && isZoomed(from, to),
      line: { color: trackColour(i), width: 7 }, opacity: 0.5,
    });
    traces.push({
      x: pick(e.slice(0, 1), 1, frame.scale), y: pick(n.slice(0, 1), 1, frame.scale),
      mode: 'markers', name: 'start', showlegend: i === 0, hoverinfo: 'name',
      marker: { color: trackColour(i), size: 10, line: { color: values('--card'), width: 2 } },
    });
  });
  const padded = 1.2 * frame.span * frame.scale;
  const centre = ([low, high]) => [low * frame.scale, high * frame.scale];
  return Plotly.react(element, traces, {
    ...look(),
    margin: { l: 60, r: 10, t: 46, b: 40 },
    showlegend: true,
    legend: { orientation: 'h', x: 0, y: 1.01, yanchor: 'bottom' },
    hovermode: 'closest',
    dragmode: 'pan',
    xaxis: axis(`east (${frame.unit})`, {
      range: spread(centre(frame.east), padded), nticks: 6, scaleanchor: 'y', constrain: 'range',
    }),
    yaxis: axis(`north (${frame.unit})`, { range: spread(centre(frame.north), padded), nticks: 8 }),
  }, { responsive: true, displayModeBar: false, scrollZoom: false });
}

function drawSpace(panel, element) {
  const frame = mapFrame();
  const traces = [];
  const clip = (p) => p[1] >= frame.east[0] - frame.span && p[1] <= frame.east[1] + frame.span
    && p[0] >= frame.north[0] - 0.05 * frame.span && p[0] <= frame.north[1] + 0.05 * frame.span;
  page.runs.forEach((run, i) => {
    const { track_east_m: e, track_north_m: n, track_depth_m: d } = run.arrays;
    const path = run.path.filter(clip);
    traces.push({
      ...pathTrace({ path }, frame.scale), type: 'scatter3d', z: path.map((p) => p[2]),
      hoverinfo: 'skip', showlegend: i === 0, visible: run.own_path,
    });
    traces.push({
      type: 'scatter3d', mode: 'lines', name: trackName(run), line: { color: trackColour(i), width: 4 },
      x: pick(e, 2500, frame.scale), y: pick(n, 2500, frame.scale), z: pick(d, 2500, 1),
      hovertemplate: `east %{x:.3~f}, north %{y:.3~f} ${frame.unit}, depth %{z:.1f} m`,
    });
  });
  // the scales of east and north are one; a thin map is widened, depth is stretched
  const width = Math.max(frame.east[1] - frame.east[0], 0.45 * frame.span) * 1.05;
  const height = Math.max(frame.north[1] - frame.north[0], 0.45 * frame.span) * 1.05;
  const side = 1.25 / Math.max(width, height);
  const km = ([low, high], span) => spread([low * frame.scale, high * frame.scale], span * frame.scale);
  const far = element.clientWidth < 480 ? 1.5 : 1.15;
  const paint = { backgroundcolor: values('--card'), showbackground: false };
  return Plotly.react(element, traces, {
    ...look(),
    margin: { l: 0, r: 0, t: 0, b: 0 },
    showlegend: true,
    legend: { orientation: 'h', x: 0, y: 1, yanchor: 'top' },
    scene: {
      aspectmode: 'manual',
      aspectratio: { x: width * side, y: height * side, z: 0.75 },
      camera: { eye: { x: 1.5 * far, y: -1.35 * far, z: 0.8 * far }, center: { x: 0, y: 0, z: -0.1 } },
      xaxis: axis(`east (${frame.unit})`, { ...paint, range: km(frame.east, width), nticks: 5 }),
      yaxis: axis(`north (${frame.unit})`, { ...paint, range: km(frame.north, height), nticks: 5 }),
      zaxis: axis('depth (m)', { ...paint, range: [Math.max(frame.depth[1], 10) * 1.02, 0], nticks: 5 }),
    },
  }, { responsive: true, displayModeBar: false });
}

// ------------------------------------------------------------------------------- zoom

const DRAW = { time: drawTime, track: drawTrack, space: drawSpace };
let turn = 0;

/** Number without useless digits, with its unit of time. */
const clock = (seconds) => `${Number((seconds / page.unit.seconds).toFixed(4))} ${page.unit.name}`;

function tell(from, to) {
  const zoomed = isZoomed(from, to);
  document.getElementById('shown').textContent = `${clock(from)} to ${clock(to)}`;
  document.getElementById('whole').disabled = !zoomed;
}

/** Show a span of time in every panel, those in view first; a newer call ends an older one. */
async function show(from, to, everything = false) {
  turn += 1;
  const mine = turn;
  document.documentElement.dataset.state = 'busy';
  tell(from, to);
  const inView = (panel) => {
    const box = document.getElementById(panel.id).getBoundingClientRect();
    return box.bottom > 0 && box.top < window.innerHeight;
  };
  const order = [...page.panels].sort((a, b) => inView(b) - inView(a));
  for (const panel of order) {
    if (panel.kind === 'space' && !everything) continue;
    await new Promise((resolve) => { setTimeout(resolve); });
    if (mine !== turn) return;
    await DRAW[panel.kind](panel, document.getElementById(panel.id), from, to);
  }
  document.documentElement.dataset.state = 'ready';
}

function onZoom(event) {
  const low = event['xaxis.range[0]'];
  const high = event['xaxis.range[1]'];
  if (event['xaxis.autorange']) show(0, page.duration);
  if (low === undefined || high === undefined) return;
  const from = Math.max(0, low * page.unit.seconds);
  const to = Math.min(page.duration, high * page.unit.seconds);
  if (to > from) show(from, to);
}

async function main() {
  const script = document.createElement('script');
  script.textContent = new TextDecoder().decode(
    await unpack(document.getElementById('library').textContent));
  document.head.append(script);
  for (const run of page.runs) run.arrays = await unpackArrays(run.packed);
  await show(0, page.duration, true);
  for (const panel of page.panels.filter((one) => one.kind === 'time')) {
    const element = document.getElementById(panel.id);
    element.on('plotly_relayout', onZoom);
    element.on('plotly_doubleclick', () => { show(0, page.duration); return false; });
  }
  document.getElementById('whole').addEventListener('click', () => show(0, page.duration));
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
    show(0, page.duration, true);
  });
}

if (page.panels.length) {
  if (typeof DecompressionStream === 'undefined') {
    document.getElementById('shown').textContent = 'This browser is too old for the curves: '
      + 'Chrome 80, Firefox 113, Safari 16.4 or newer show them.';
  } else {
    main();
  }
} else {
  document.documentElement.dataset.state = 'ready';
}
