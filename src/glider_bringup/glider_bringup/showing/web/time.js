// How panels look, and curves over time.

const values = (tag) => getComputedStyle(document.documentElement).getPropertyValue(tag).trim();

const isNarrow = (element) => element.clientWidth < 480;

/** Legend at the top right, or where more says. */
const legendOf = (element, more) => ({
  orientation: 'h', x: 1, xanchor: 'right', y: 1.02, yanchor: 'bottom',
  font: { size: isNarrow(element) ? 10 : 13 }, ...more,
});

/** What panels have in common: colours, fonts, and the size, which is that of their place. */
function look(element) {
  const ink = values('--ink');
  const size = isNarrow(element) ? 11 : 13;
  return {
    width: element.clientWidth,
    height: element.clientHeight,
    paper_bgcolor: 'rgba(0,0,0,0)',
    plot_bgcolor: 'rgba(0,0,0,0)',
    font: { family: getComputedStyle(document.body).fontFamily, size, color: ink },
    hoverlabel: { bgcolor: values('--card'), bordercolor: values('--line'), font: { color: ink } },
    showlegend: true,
    legend: legendOf(element),
    hovermode: 'closest',
  };
}

const react = (element, traces, layout) => Plotly.react(
  element, traces, { ...look(element), ...layout }, { displayModeBar: false });

const axis = (title, more) => ({
  title: { text: title, standoff: 6, font: { size: 12 } },
  exponentformat: 'e',
  minexponent: 5, // below 0.00001 and from a million on: elsewhere digits are read at once
  gridcolor: values('--grid'),
  linecolor: values('--line'),
  zerolinecolor: values('--line'),
  automargin: true,
  ...more,
});

/** A round step (1, 2 or 5 and zeros) of which a span has no more than so many. */
function roundStep(span, most) {
  const power = 10 ** Math.floor(Math.log10(span / most));
  return power * [1, 2, 5, 10].find((one) => one * power * most >= span);
}

/** Round numbers in a range, none of them near its ends, where other axes have their labels. */
function innerTicks(low, high, most) {
  const step = roundStep(high - low, most);
  const margin = 0.08 * (high - low);
  const ticks = [];
  for (let k = Math.ceil((low + margin) / step); k * step <= high - margin; k += 1) ticks.push(k * step);
  return ticks;
}

/** Zero and a round number to either side, for a range from -reach to reach. */
function evenTicks(reach) {
  const step = roundStep(0.4 * reach, 1); // at most 2.5 times as much: inside
  return [-step, 0, step];
}

/** Straight lines, each from a time until another (s) and from a value to another. */
const lines = (ends) => ({
  x: ends.flatMap(([from, until]) => [inUnit(from), inUnit(until), null]),
  y: ends.flatMap(([, , low, high]) => [low, high, null]),
  mode: 'lines',
});

/** Dotted vertical lines at some times (s), over the whole height. */
const markTrace = (times, name) => ({
  ...lines(times.map((time) => [time, time, 0, 1])), yaxis: 'y2', name, hoverinfo: 'skip',
  line: { color: values('--limit'), width: 1, dash: 'dot' },
});

/** A line and words for each fault of a run, where it began; nothing where runs are compared. */
function faultMarks() {
  const { faults } = page.runs[0];
  if (page.runs.length > 1 || !faults) return { shapes: [], annotations: [] };
  const at = (one) => inUnit(one.t_s);
  return {
    shapes: faults.map((one) => ({
      type: 'line', xref: 'x', x0: at(one), x1: at(one), yref: 'paper', y0: 0, y1: 1,
      line: { color: values('--alert'), width: 1.2, dash: 'dash' },
    })),
    annotations: faults.map((one) => ({
      xref: 'x', x: at(one), xanchor: 'left', yref: 'paper', y: 0, yanchor: 'bottom',
      text: one.message.split(',')[0], textangle: -90, showarrow: false,
      font: { size: 10, color: values('--alert') },
    })),
  };
}

/** Level lines, with gaps between them. */
const stepTrace = (steps) => ({
  ...lines(steps.spans.map(([from, until, value]) => [from, until, value, value])),
  name: steps.label,
  line: { color: values(`--${steps.role}`), width: 2.4, dash: steps.dashed ? 'dash' : 'solid' },
});

/** Of runs that lie over each other, the first is broadest, so that all can be seen. */
const lineWidth = (run) => (page.runs.length > 1 ? Math.max(1.4, 3.2 - 0.9 * run) : 1.6);

function drawTime(panel, element, from, to) {
  const traces = panel.curves.map((curve) => ({
    ...thin(curve, from, to, element.clientWidth),
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
  traces.push(...panel.steps.map(stepTrace));
  const reach = extent(traces.map((trace) => trace.y.map(Math.abs)))[1];
  const [least, most] = extent(traces.map((trace) => trace.y));
  const [low, high] = extent(traces.map((trace) => trace.y.filter((value) => value > 0)));
  const decades = panel.log && low > 0 ? Math.max(1, Math.ceil(Math.log10(high / low) / 5)) : 1;
  const limits = panel.limits.filter((value) => reach > 0.5 * Math.abs(value)).map((value) => ({
    type: 'line', xref: 'paper', x0: 0, x1: 1, y0: value, y1: value, layer: 'below',
    line: { color: values('--limit'), width: 1.5, dash: 'longdash' },
  }));
  if (panel.inflections >= 0) {
    traces.push(markTrace(page.runs[panel.inflections].inflections, 'inflection'));
  }
  if (panel.surfacings >= 0) {
    const times = page.runs[panel.surfacings].surfacings.map((one) => one.t_s);
    traces.push(markTrace(times, 'surfacing'));
  }
  const broken = faultMarks();
  return react(element, traces, {
    margin: { l: isNarrow(element) ? 64 : 76, r: 14, t: 24, b: 38 },
    hovermode: 'x unified',
    dragmode: 'zoom',
    shapes: [...limits, ...broken.shapes],
    annotations: broken.annotations,
    xaxis: axis(`time (${page.unit.name})`, {
      range: [from, to].map(inUnit), hoverformat: '.4~f',
    }),
    yaxis: axis(panel.axis, {
      fixedrange: true, automargin: false, nticks: 6, type: panel.log ? 'log' : 'linear',
      autorange: panel.inverted ? 'reversed' : true,
      rangemode: most - least < 1e-6 * reach ? 'tozero' : 'normal', // else it is of rounding
      minexponent: most - least < 3e-5 ? 4 : 5, // or digits run over the title
      ...(panel.log ? { dtick: decades, exponentformat: low < 1e-4 ? 'power' : 'none' } : {}),
    }),
    yaxis2: { overlaying: 'y', range: [0, 1], visible: false, fixedrange: true },
  });
}
