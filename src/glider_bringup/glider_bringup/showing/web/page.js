// Draws the panels, zooms into all of them, and puts them on paper.

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
