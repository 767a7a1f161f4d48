// Where it went: from above, in three dimensions, or from the side.

/** Zoomed-in part of a track, as indices of its samples. */
function visible(run, from, to) {
  const last = run.arrays.track_north_m.length - 1;
  const begin = Math.max(0, Math.min(last, Math.floor(from / run.spacing / 2)));
  return [begin, Math.max(begin, Math.min(last, Math.ceil(to / run.spacing / 2)))];
}

/** Scale and unit of a length (m). */
const unitOf = (length) => (length > 2000 ? [1e-3, 'km'] : [1, 'm']);

const marker = (role, symbol) => ({
  color: values(role), size: 9, symbol, line: { color: values('--card'), width: 1.5 },
});

/** Draw a view from above or from the side, with its legend at the top left. */
const reactMap = (element, traces, layout) => react(element, traces, {
  margin: { l: 60, r: 10, t: 46, b: 40 },
  legend: legendOf(element, { x: 0, xanchor: 'left', y: 1.01 }),
  ...layout,
});

const spread = ([low, high], span) => [(low + high - span) / 2, (low + high + span) / 2];

/** What both maps show: scale, unit, and the extent of what was flown. */
function mapFrame() {
  const east = extent(page.runs.map((run) => run.arrays.track_east_m));
  const north = extent(page.runs.map((run) => run.arrays.track_north_m));
  const depth = extent(page.runs.map((run) => run.arrays.track_depth_m));
  const span = Math.max(east[1] - east[0], north[1] - north[0], 20);
  const [scale, unit] = unitOf(span);
  return { east, north, depth, span, scale, unit };
}

/** What is said of the places of a trace: in degrees if there is a chart. */
function hover(run, unit, scale, { x, y }) {
  const { origin } = run;
  if (!origin) return { hovertemplate: `east %{x:.3~f} ${unit}, north %{y:.3~f} ${unit}` };
  const told = (degrees, letters) => `${Math.abs(degrees).toFixed(5)} ${letters[degrees < 0 ? 1 : 0]}`;
  const text = x.map((e, i) => {
    if (e === null) return '';
    const longitude = origin.longitude + e / scale / origin.east;
    return [told(origin.latitude + y[i] / scale / origin.north, 'NS'), told(longitude - 360 * Math.round(longitude / 360), 'EW')].join(', ');
  });
  return { text, hovertemplate: '%{text}' };
}

function pathTrace(run, scale, more) {
  return {
    x: run.path.map((p) => p[1] * scale), y: run.path.map((p) => p[0] * scale), mode: 'lines',
    line: { color: values(page.runs.length > 1 ? '--limit' : '--reference'), width: 2, dash: 'dash' },
    name: 'desired path', hoverinfo: 'skip', ...more,
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
    if (run.own_path) traces.push(pathTrace(run, frame.scale, { showlegend: i === 0 }));
  });
  if (page.runs.length === 1) traces.push(currentTrace(page.runs[0], frame));
  page.runs.forEach((run, i) => {
    const { track_east_m: e, track_north_m: n } = run.arrays;
    const flown = { x: pick(e, 4000, frame.scale), y: pick(n, 4000, frame.scale) };
    traces.push({
      ...flown, mode: 'lines', name: trackName(run),
      line: { color: trackColour(i), width: lineWidth(i) + 0.4 },
      ...hover(run, frame.unit, frame.scale, flown),
    });
    const [begin, end] = visible(run, from, to);
    traces.push({
      x: isZoomed(from, to) ? pick(e, 2000, frame.scale, begin, end) : [],
      y: isZoomed(from, to) ? pick(n, 2000, frame.scale, begin, end) : [],
      mode: 'lines', name: 'zoomed in', hoverinfo: 'skip', showlegend: i === 0 && isZoomed(from, to),
      line: { color: trackColour(i), width: 7 }, opacity: 0.5,
    });
    traces.push({
      x: pick(e, 1, frame.scale, 0, 0), y: pick(n, 1, frame.scale, 0, 0),
      mode: 'markers', name: 'start', showlegend: i === 0, hoverinfo: 'name',
      marker: { color: trackColour(i), size: 10, line: { color: values('--card'), width: 2 } },
    });
  });
  const range = (ends) => spread(ends, 1.2 * frame.span).map((one) => one * frame.scale);
  return reactMap(element, traces, {
    dragmode: 'pan',
    xaxis: axis(`east (${frame.unit})`, {
      range: range(frame.east), nticks: 6, scaleanchor: 'y', constrain: 'range',
    }),
    yaxis: axis(`north (${frame.unit})`, { range: range(frame.north), nticks: 8 }),
  });
}

/** How far away the eye starts: everything with its labels is in view. */
const farOf = (element) => (isNarrow(element) ? 1.75 : 1.15);

/** Traces and layout of the view in three dimensions, turned as the element has it. */
function spaceFigure(panel, element) {
  const frame = mapFrame();
  const traces = [];
  const clip = (p) => p[1] >= frame.east[0] - frame.span && p[1] <= frame.east[1] + frame.span
    && p[0] >= frame.north[0] - 0.05 * frame.span && p[0] <= frame.north[1] + 0.05 * frame.span;
  page.runs.forEach((run, i) => {
    const { track_east_m: e, track_north_m: n, track_depth_m: d } = run.arrays;
    const path = run.path.filter(clip);
    traces.push({
      ...pathTrace({ path }, frame.scale), type: 'scatter3d', z: path.map((p) => p[2]),
      showlegend: i === 0, visible: run.own_path,
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
  const far = farOf(element);
  const paint = { backgroundcolor: values('--card'), showbackground: false, tickfont: { size: 11 } };
  const deepest = Math.max(frame.depth[1], 10) * 1.1;
  const level = (name, range, span) => axis(`${name} (${frame.unit})`, {
    ...paint, range, tickvals: innerTicks(...range, Math.max(2, Math.round((5 * span) / Math.max(width, height)))),
  });
  const camera = element.layout?.scene.camera || {
    eye: { x: 1.5 * far, y: -1.35 * far, z: 0.8 * far }, center: { x: 0, y: 0, z: -0.1 },
  };
  const layout = {
    ...look(element),
    margin: { l: 0, r: 0, t: 0, b: 0 },
    legend: legendOf(element, { x: 0, xanchor: 'left', y: 1, yanchor: 'top' }),
    scene: {
      aspectmode: 'manual',
      aspectratio: { x: width * side, y: height * side, z: 0.75 },
      camera,
      xaxis: level('east', km(frame.east, width), width),
      yaxis: level('north', km(frame.north, height), height),
      zaxis: axis('depth (m)', {
        ...paint, range: [deepest, 0], tickvals: [0, ...innerTicks(0, deepest, 4)],
      }),
    },
  };
  return { data: traces, layout };
}

function drawSpace(panel, element) {
  const { data, layout } = spaceFigure(panel, element);
  return react(element, data, layout);
}

// ------------------------------------------------------------------------------- from the side

/** Whether the browser can draw in three dimensions; plotly asks for the same. */
function hasWebgl() {
  const context = document.createElement('canvas').getContext('webgl');
  if (context) context.getExtension('WEBGL_lose_context')?.loseContext();
  return Boolean(context);
}

/** Make a view in three dimensions one from the side. */
function seenFromTheSide(panel) {
  if (panel.kind !== 'space') return;
  panel.kind = 'side';
  const figure = document.getElementById(panel.id).parentElement;
  figure.querySelector('h3').textContent = 'From the side';
  figure.querySelector('figcaption').textContent = 'Depth over the distance flown; depth is '
    + 'stretched. This browser has no WebGL for the view in three dimensions.';
}

/** Horizontal distance flown until each sample (m). */
function distances(run) {
  const { track_east_m: e, track_north_m: n } = run.arrays;
  const flown = new Float64Array(e.length);
  for (let i = 1; i < e.length; i += 1) {
    flown[i] = flown[i - 1] + (Math.hypot(e[i] - e[i - 1], n[i] - n[i - 1]) || 0);
  }
  return flown;
}

function drawSide(panel, element) {
  const flown = page.runs.map(distances);
  const [scale, unit] = unitOf(extent(flown)[1]);
  const traces = page.runs.map((run, i) => ({
    x: pick(flown[i], 4000, scale), y: pick(run.arrays.track_depth_m, 4000, 1),
    mode: 'lines', name: trackName(run), line: { color: trackColour(i), width: lineWidth(i) + 0.4 },
    hovertemplate: `%{x:.3~f} ${unit}, depth %{y:.1f} m`,
  }));
  return reactMap(element, traces, {
    dragmode: false,
    xaxis: axis(`distance flown (${unit})`, { fixedrange: true, nticks: 6 }),
    yaxis: axis('depth (m)', { fixedrange: true, nticks: 8, autorange: 'reversed' }),
  });
}
