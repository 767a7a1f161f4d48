// Draws the panels, zooms into all of them, fits them to their places, and puts them on paper.

const DRAW = { time: drawTime, track: drawTrack, space: drawSpace, side: drawSide, plan: drawPlan, places: drawPlaces };
/** Panels of the whole run, whatever span of it is shown. */
const WHOLE = ['space', 'side', 'places'];
const root = document.documentElement;
/** How far away the eye is on paper; see farOf. How much smaller letters are there. */
const FAR_ON_PAPER = 1.2;
const FINER_ON_PAPER = 1.6;
/** What is shown (s), and how wide each panel was drawn (px). */
let shown = [0, page.duration];
const widths = new Map();
/** Count of the calls to show; timer of the next picture. */
let turn = 0;
let waiting;

const place = (panel) => document.getElementById(panel.id);

/** Time with its unit, to a thousandth of a span or so, without useless digits. */
function clock(seconds, span) {
  const digits = Math.max(0, 2 - Math.floor(Math.log10(inUnit(span))));
  return `${Number(inUnit(seconds).toFixed(Math.min(digits, 9)))} ${page.unit.name}`;
}

function draw(panel) {
  widths.set(panel.id, place(panel).clientWidth);
  return DRAW[panel.kind](panel, place(panel), ...shown);
}

/**
 * Show a span of time in every panel, those in view at once; a newer call ends an older one.
 * Some panels show the whole run; they are drawn again only with everything.
 */
async function show(from, to, everything = false) {
  turn += 1;
  const mine = turn;
  shown = [from, to];
  root.dataset.state = 'busy';
  document.getElementById('shown').textContent = `${clock(from, to - from)} to ${clock(to, to - from)}`;
  document.getElementById('whole').disabled = !isZoomed(from, to);
  const inView = (panel) => {
    const box = place(panel).getBoundingClientRect();
    return box.bottom > 0 && box.top < window.innerHeight;
  };
  const panels = page.panels.filter(({ kind }) => everything || !WHOLE.includes(kind));
  const near = new Set(panels.filter(inView));
  for (const panel of [...near, ...panels.filter((one) => !near.has(one))]) {
    if (!near.has(panel)) await new Promise((resolve) => { setTimeout(resolve); });
    if (mine !== turn) return;
    await draw(panel);
  }
  if (mine === turn) root.dataset.state = 'ready';
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

// ------------------------------------------------------------------------------- sizes, paper

/** Draw again what has become wider or narrower. */
function onResize() {
  const changed = page.panels.some((panel) => place(panel).clientWidth !== widths.get(panel.id));
  if (changed && !root.classList.contains('paper')) show(...shown, true);
}

/**
 * Take a picture of a view in three dimensions, as it is turned now, in the colours of paper:
 * browsers print what WebGL has drawn as a blank, and a picture takes too long once they print.
 */
async function takePicture(panel) {
  const figure = place(panel).parentElement;
  const isPaper = root.classList.contains('paper');
  const farther = FAR_ON_PAPER / farOf(place(panel));
  const isPictured = figure.classList.contains('pictured');
  figure.classList.remove('pictured');
  root.classList.add('paper');
  const { data, layout } = spaceFigure(panel, place(panel));
  root.classList.toggle('paper', isPaper);
  figure.classList.toggle('pictured', isPictured);
  const { eye, ...camera } = layout.scene.camera;
  layout.scene.camera = {
    ...camera, eye: { x: farther * eye.x, y: farther * eye.y, z: farther * eye.z },
  };
  const image = Object.assign(new Image(), { alt: panel.title });
  const [width, height] = [layout.width, layout.height].map((size) => size * FINER_ON_PAPER);
  Object.assign(layout, { width, height });
  image.src = await Plotly.toImage({ data, layout }, { format: 'png', width, height, scale: 2 });
  await image.decode();
  figure.querySelector('img')?.remove();
  figure.append(image);
  figure.classList.add('pictured');
}

/** Draw for a page of paper: its width, dark on white. It has to be done when this returns. */
function beforePrint() {
  turn += 1;
  root.classList.add('paper');
  for (const panel of page.panels) {
    if (!place(panel).closest('.pictured')) draw(panel);
  }
}

function afterPrint() {
  root.classList.remove('paper');
  show(...shown, true);
}

// ------------------------------------------------------------------------------- start

function listen() {
  const whole = () => { show(0, page.duration); return false; };
  for (const panel of page.panels) {
    if (panel.kind === 'time') {
      place(panel).on('plotly_relayout', onZoom);
      place(panel).on('plotly_doubleclick', whole);
    }
    if (panel.kind === 'space') {
      place(panel).on('plotly_relayout', () => { // when it has come to rest: a wheel turns often
        clearTimeout(waiting);
        waiting = setTimeout(() => takePicture(panel), 400);
      });
    }
  }
  document.getElementById('whole').addEventListener('click', whole);
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
    show(...shown, true);
  });
  const observer = new ResizeObserver(onResize);
  for (const panel of page.panels) observer.observe(place(panel));
  window.addEventListener('beforeprint', beforePrint);
  window.addEventListener('afterprint', afterPrint);
}

async function main() {
  const script = document.createElement('script');
  script.textContent = new TextDecoder().decode(
    await unpack(document.getElementById('library').textContent));
  document.head.append(script);
  for (const run of page.runs) run.arrays = await unpackArrays(run.packed);
  if (!hasWebgl()) page.panels.forEach(seenFromTheSide);
  await show(0, page.duration, true);
  root.dataset.state = 'busy';
  listen();
  // should a picture fail, the view itself is printed
  await Promise.allSettled(page.panels.filter(({ kind }) => kind === 'space').map(takePicture));
  root.dataset.state = 'ready';
}

if (page.panels.length) {
  if (typeof DecompressionStream === 'undefined') {
    document.getElementById('shown').textContent = 'This browser is too old for the curves: '
      + 'Chrome 80, Firefox 113, Safari 16.4 or newer show them.';
  } else {
    main();
  }
} else {
  root.dataset.state = 'ready';
}
