# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Reports and comparisons in a real browser: drawn, linked, offline, and with the score's numbers.

Needs Chromium, on Debian and Ubuntu the package ``chromium``.
"""

import json
import os
import re
import shutil
import signal
import time
from contextlib import contextmanager

import pytest
from playwright.sync_api import sync_playwright

BROWSERS = ('chromium', 'chromium-browser', 'google-chrome-stable', 'google-chrome')
#: 3-D views are drawn without a graphics card.
OPTIONS = ['--no-sandbox', '--enable-unsafe-swiftshader']
DEADLINE_MS = 120_000

IS_READY = "document.documentElement.dataset.state === 'ready'"
#: Traces that have nothing to show in some spans of time.
SOMETIMES = ('zoomed in', 'at its limit', 'course cannot be held')
#: What is drawn of every panel.
DRAWN = """() => page.panels.map(({ id, kind }) => {
  const element = document.getElementById(id);
  const box = element.querySelector('.main-svg, canvas').getBoundingClientRect();
  const layout = element._fullLayout;
  return {
    id, kind, width: box.width, height: box.height, place: element.clientWidth,
    ranges: kind === 'time' ? layout.xaxis.range : null,
    lines: element.querySelectorAll('.scatterlayer path.js-line').length,
    canvas: element.querySelectorAll('canvas').length,
    traces: element.data.map((trace) => ({
      name: trace.name, x: Array.from(trace.x), y: Array.from(trace.y), z: trace.z || null,
    })),
  };
})"""


#: Whether the legend of a panel lies above what is drawn.
LEGEND_IS_APART = """(id) => {
  const element = document.getElementById(id);
  const [legend, plot] = ['.legend', '.nsewdrag'].map(
    (part) => element.querySelector(part).getBoundingClientRect());
  return legend.bottom <= plot.top + 1 && legend.top >= element.getBoundingClientRect().top - 1;
}"""
#: How long a metre is drawn in each small map of a panel (px).
METRES = """(id) => {
  const layout = document.getElementById(id)._fullLayout;
  const length = (axis) => axis._length / Math.abs(axis.range[1] - axis.range[0]);
  return Object.keys(layout).filter((key) => /^xaxis/.test(key)).map((key) => ({
    east: length(layout[key]), north: length(layout[key.replace('x', 'y')]),
  }));
}"""
#: What the plan shows from south to north.
PLAN_RANGES = "document.getElementById('plan')._fullLayout.yaxis.range"
#: Whether every chart is as wide as its place.
FILLED = """() => page.panels.every(({ id }) => {
  const element = document.getElementById(id);
  const box = element.querySelector('.main-svg').getBoundingClientRect();
  return Math.abs(box.width - element.clientWidth) < 1;
})"""
#: Width of A4, and of the margin on either side (px of CSS).
A4_PX, MARGIN_PX = 210.0 / 25.4 * 96.0, 12.0 / 25.4 * 96.0
#: Note what is about to be printed, after the page itself has made ready for it.
NOTE_WHAT_IS_PRINTED = """() => window.addEventListener('beforeprint', () => {
  const figures = [...document.querySelectorAll('figure')];
  const boxes = figures.map((figure) => figure.getBoundingClientRect());
  const meet = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom
    && b.top < a.bottom;
  const space = document.getElementById('space').parentElement;
  const image = space.querySelector('img');
  const canvas = new OffscreenCanvas(image.naturalWidth, image.naturalHeight);
  const context = canvas.getContext('2d');
  context.drawImage(image, 0, 0);
  const pixels = context.getImageData(0, 0, canvas.width, canvas.height).data;
  let coloured = 0;
  for (let i = 0; i < pixels.length; i += 4) {
    const [red, green, blue, opaque] = pixels.slice(i, i + 4);
    const grey = Math.max(red, green, blue) - Math.min(red, green, blue) < 60;
    if (opaque > 200 && !grey) coloured += 1;
  }
  window.printed = {
    panels: page.panels.map(({ id, kind }) => {
      const element = document.getElementById(id);
      const drawn = kind === 'space' ? image : element.querySelector('.main-svg');
      return {
        id, width: drawn.getBoundingClientRect().width,
        place: kind === 'space' ? drawn.clientWidth : element.clientWidth,
        ink: kind === 'space' ? '#000000' : element._fullLayout.font.color,
      };
    }),
    overlaps: figures.flatMap((_, i) => figures.slice(i + 1).map((_, j) => [i, i + 1 + j]))
      .filter(([i, j]) => meet(boxes[i], boxes[j])),
    picture: {
      coloured,
      shown: [...space.querySelectorAll('img, .plot')].filter((one) => one.clientHeight)
        .map((one) => one.tagName),
    },
  };
})"""

#: Where pages of paper may end, for what a selector names.
STYLES = """(names) => [...document.querySelectorAll(names)].map((one) => {
  const { breakAfter, breakInside } = getComputedStyle(one);
  return [breakAfter, breakInside];
})"""


#: What is written beside the curves over time.
LABELS = """() => page.panels.filter(({ kind }) => kind === 'time').flatMap(({ id }) =>
  [...document.querySelectorAll(`#${id} .ytick text`)].map((one) => one.textContent))"""


@contextmanager
def browser_at(executable):
    """Chromium, driven from here."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=OPTIONS)
        yield browser
        browser.close()


def open_page(browser, file, **options):
    """Page of a file when everything is drawn, and what it said and asked for meanwhile."""
    page = browser.new_page(**options)
    said, asked = [], []
    page.on('console', lambda message: said.append(message.text) if _is_bad(message) else None)
    page.on('pageerror', lambda error: said.append(str(error)))
    page.on('request', lambda request: asked.append(request.url) if _leaves(request) else None)
    page.set_default_timeout(DEADLINE_MS)
    page.goto(file.as_uri())
    page.wait_for_function(IS_READY)
    return page, said, asked


def _leaves(request):
    """Tell whether a request asks for something outside of the page's own memory."""
    return not request.url.startswith('blob:')


def _is_bad(message):
    """Tell whether a line of the console is an error, or a warning of the page's own."""
    return message.type == 'error' or (message.type == 'warning' and 'WARN' in message.text)


# ---------------------------------------------------------------------------------- fixtures


def browser_executable():
    """Path of Chromium, or None."""
    return next(filter(None, map(shutil.which, BROWSERS)), None)


@pytest.fixture(scope='module')
def browser():
    executable = browser_executable()
    if executable is None:
        missing = 'no Chromium here; on Debian or Ubuntu: apt-get install chromium'
        if os.environ.get('CI') == 'true':
            pytest.fail(missing)
        pytest.skip(missing)
    with browser_at(executable) as running:
        yield running


@pytest.fixture(scope='module')
def without(browser):
    """One that has no WebGL: what is in three dimensions takes it longest to draw."""
    options = ['--no-sandbox', '--disable-gpu', '--disable-3d-apis']
    with browser.browser_type.launch(
        executable_path=browser_executable(), args=options
    ) as running:
        yield running


@pytest.fixture(scope='module')
def default_run(glider, tmp_path_factory):
    """Folder of the default scenario, flown whole."""
    folder = tmp_path_factory.mktemp('report') / 'default'
    done = glider('run', '--engine', 'direct', '--out', folder)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope='module')
def reckoned_run(glider, tmp_path_factory):
    """Folder of a run of an hour that reckons its place, with three surfacings."""
    folder = tmp_path_factory.mktemp('report') / 'reckoned'
    fields = ('navigation.method=dead_reckoned', 'profile.depth_m=100', 'profile.wait_s=200')
    changes = (*fields, 'profile.surface_every_dives=1', 'sensors.gps_first_fix_s=30')
    options = (f'--set={change}' for change in changes)
    done = glider('run', '--engine', 'direct', '--duration', 3600, '--out', folder, *options)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope='module')
def pid_run(glider, tmp_path_factory):
    """The same by the PID law, cut short."""
    folder = tmp_path_factory.mktemp('report') / 'pid'
    options = ('--controller', 'pid', '--duration', 6000, '--out', folder)
    done = glider('run', '--engine', 'direct', *options)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope='module')
def open_report(browser, default_run):
    """Report of the default run for several tests: who zooms in zooms out again."""
    page, said, asked = open_page(browser, default_run / 'report.html')
    yield page
    assert asked == [(default_run / 'report.html').as_uri()]
    assert said == []
    page.close()


@pytest.fixture(scope='module')
def open_reckoned(browser, reckoned_run):
    """The same of the one that reckons its place, in a wide window."""
    how = {'viewport': {'width': 1400, 'height': 900}, 'color_scheme': 'light'}
    page, said, asked = open_page(browser, reckoned_run / 'report.html', **how)
    yield page
    assert (said, len(asked)) == ([], 1)
    page.close()


def finite(values):
    return [value for value in values if isinstance(value, (int, float))]


def check_drawn(panels):
    """Every panel has a size, every curve of it a line with numbers in it."""
    for panel in panels:
        assert panel['width'] > 200, panel['id']
        assert panel['height'] > 100, panel['id']
        if panel['kind'] == 'space':
            assert panel['canvas'] > 0
            track = panel['traces'][-1]
            assert min(map(len, map(finite, (track['x'], track['y'], track['z'])))) > 1
            continue
        assert panel['width'] == pytest.approx(panel['place'], abs=1.0), 'it fills its place'
        drawn = [trace for trace in panel['traces'] if len(finite(trace['y'])) > 1]
        assert drawn, panel['id']
        markers = {'track': 1, 'plan': 4, 'places': 2 * len(drawn) // 3}.get(panel['kind'], 0)
        assert panel['lines'] >= len(drawn) - markers, panel['id']
        for trace in panel['traces']:
            assert len(trace['x']) == len(trace['y']), (panel['id'], trace['name'])
            assert trace['name'] in SOMETIMES or finite(trace['y']), (panel['id'], trace['name'])


def zoom(page, panel, begin, end):
    """Drag with the mouse over a panel, between two shares of its width, and wait."""
    area = page.locator(f'#{panel} .nsewdrag').first
    area.scroll_into_view_if_needed()
    box = area.bounding_box()
    middle = box['y'] + 0.5 * box['height']
    page.mouse.move(box['x'] + begin * box['width'], middle)
    page.mouse.down()
    page.mouse.move(box['x'] + end * box['width'], middle, steps=4)
    page.mouse.up()
    page.wait_for_function("document.getElementById('whole').disabled === false")
    page.wait_for_function(IS_READY)


def zoom_out(page):
    page.click('#whole')
    page.wait_for_function("document.getElementById('whole').disabled === true")
    page.wait_for_function(IS_READY)


# ---------------------------------------------------------------------------------- tests


def test_report_of_the_default_run(open_report, default_run):
    """Drawn whole, no request, no complaint; numbers are those of score.json."""
    page = open_report
    panels = page.evaluate(DRAWN)
    check_drawn(panels)
    assert max(map(len, page.evaluate(LABELS))) <= 8, 'no digits over the title of an axis'
    assert {panel['id'] for panel in panels} == {
        *('track', 'space', 'depth', 'cross_track', 'pitch', 'heading', 'roll'),
        *('buoyancy_engine', 'pitch_mass', 'roll_mass', 'battery'),
        *('current_north', 'current_east'),
        *('learnt_pitch', 'learnt_roll', 'learnt_steering', 'learnt_disturbance'),
    }

    card = json.loads((default_run / 'score.json').read_text())
    tiles = dict(zip(page.locator('.tile dt').all_inner_texts(), _numbers(page), strict=True))
    track, pitch = card['cross_track_m'], card['pitch_error_deg']
    assert tiles['cross-track, steady'] == pytest.approx(track['max_steady'], abs=0.005)
    assert tiles['deepest point'] == pytest.approx(card['depth_m']['max'], abs=0.05)
    assert tiles['pitch error, steady'] == pytest.approx(pitch['rms_steady'], abs=0.005)
    table = page.locator('.table').last.inner_text()
    assert f'{track["max_steady"]:.3f} m' in table
    assert f'{card["actuator_travel"]["roll_mass_deg"]:.0f} deg' in table

    # no peak is lost between the log and the screen
    settle_s = 1800.0
    largest = page.evaluate(
        """(settle) => Math.max(...page.runs[0].arrays.cross_track_m
            .filter((_, i) => i * page.runs[0].spacing > settle).map(Math.abs))""",
        settle_s,
    )
    assert largest == pytest.approx(track['max_all'], rel=1e-6)
    depth = next(panel for panel in panels if panel['id'] == 'depth')['traces'][0]
    assert len(depth['y']) < 3000
    assert max(depth['y']) == pytest.approx(card['depth_m']['max'], rel=1e-6)


def _numbers(page):
    """First number of every tile."""
    texts = page.locator('.tile dd').all_inner_texts()
    return [float(re.search(r'-?[\d,.]+', text)[0].replace(',', '')) for text in texts]


def test_zoom_by_the_mouse_is_linked_and_refines(open_report, default_run):
    page = open_report
    before = page.evaluate(DRAWN)
    zoom(page, 'cross_track', 0.4, 0.5)
    after = page.evaluate(DRAWN)
    check_drawn(after)
    timed = [panel for panel in after if panel['kind'] == 'time']
    begin, end = timed[0]['ranges']
    hours = json.loads((default_run / 'score.json').read_text())['sim_time_s'] / 3600.0
    assert [begin, end] == pytest.approx([0.4 * hours, 0.5 * hours], rel=0.02)
    for panel in timed:
        assert panel['ranges'] == pytest.approx([begin, end]), panel['id']
    for old, new in zip(before, after, strict=True):
        if old['kind'] == 'time':
            assert _in_view(new, begin, end) > 3 * _in_view(old, begin, end), old['id']
        if old['kind'] == 'track':
            assert not _zoomed_in(old)
            assert len(_zoomed_in(new)) > 10

    zoom_out(page)
    whole = page.evaluate(DRAWN)
    assert [panel['ranges'] for panel in whole] == [panel['ranges'] for panel in before]


def _zoomed_in(panel):
    """What is drawn bold of a track."""
    return next(trace['x'] for trace in panel['traces'] if trace['name'] == 'zoomed in')


def _in_view(panel, begin, end):
    """Points of the first curve of a panel within a span of time."""
    return sum(begin <= x <= end for x in panel['traces'][0]['x'])


def test_report_of_a_run_over_nodes_in_a_narrow_dark_window(browser, over_nodes):
    page, said, asked = open_page(
        *(browser, over_nodes.folder / 'report.html'),
        viewport={'width': 390, 'height': 844},
        color_scheme='dark',
    )
    panels = page.evaluate(DRAWN)
    check_drawn(panels)
    assert min(panel['place'] for panel in panels) > 340
    assert page.evaluate('document.documentElement.scrollWidth') == 390, 'nothing sticks out'
    ink = page.evaluate("document.getElementById('depth')._fullLayout.font.color")
    assert int(ink[1:3], 16) > 0xC0, 'light ink on a dark page'
    assert (said, len(asked)) == ([], 1)
    page.close()


def test_report_of_a_run_that_reckons_its_place(open_reckoned, reckoned_run):
    check_reckoned(open_reckoned, reckoned_run, 1400)


def test_the_same_in_a_narrow_dark_window(browser, reckoned_run):
    how = {'viewport': {'width': 390, 'height': 900}, 'color_scheme': 'dark'}
    page, said, asked = open_page(browser, reckoned_run / 'report.html', **how)
    check_reckoned(page, reckoned_run, 390)
    assert (said, len(asked)) == ([], 1)
    page.close()


def check_reckoned(page, reckoned_run, width):
    """Places at surfacings, believed and true, and their ellipses, are those of score.json."""
    panels = page.evaluate(DRAWN)
    check_drawn(panels)
    assert page.evaluate('document.documentElement.scrollWidth') == width, 'nothing sticks out'
    assert {'plan', 'estimated_cross_track', 'place_error'} < {panel['id'] for panel in panels}
    reports = json.loads((reckoned_run / 'score.json').read_text())['navigation']['reports']
    (plan,) = (panel for panel in panels if panel['kind'] == 'plan')
    drawn = {trace['name']: trace for trace in plan['traces']}
    shown = drawn['true place at surfacing']
    assert shown['y'] == pytest.approx([one['true_ned_m'][0] / 1e3 for one in reports])
    assert shown['x'] == pytest.approx([one['true_ned_m'][1] / 1e3 for one in reports])
    (places,) = (panel for panel in panels if panel['kind'] == 'places')
    rings = [trace for trace in places['traces'] if trace['name'] == '95 % ellipse']
    for one, ring in zip(reports, rings, strict=True):
        nn, ne, ee = one['covariance_m2']
        for n, e in zip(ring['y'], ring['x'], strict=True):
            off = (ee * n * n - 2.0 * ne * n * e + nn * e * e) / (nn * ee - ne * ne)
            assert off == pytest.approx(5.991, rel=1e-3)
    for metre in page.evaluate(METRES, 'places'):
        assert metre['east'] == pytest.approx(metre['north'], rel=0.01), 'circles are round'
    assert page.locator('.many').first.locator('tbody tr').count() == len(reports)
    assert page.evaluate(LEGEND_IS_APART, 'plan')


def test_axes_of_a_steady_current_and_of_a_long_drift_can_be_read(without, glider, tmp_path):
    """Ended by the guard in the first dive of a current that no fix told of, then days adrift."""
    told = ('--duration', 120_000, '--set', 'water.bottom_m=60', '--out', tmp_path / 'run')
    done = glider('run', 'slocum_shelf', '--engine', 'direct', *told)
    assert done.returncode == 3, done.stderr
    page, said, _ = open_page(without, tmp_path / 'run' / 'report.html')
    labels = page.evaluate(LABELS)
    assert '10,000' in labels, 'metres off the path'
    assert max(map(len, labels)) <= 8, 'all of it can be seen'
    assert not any('e' in label for label in labels)
    assert said == []
    page.close()


def test_plan_follows_the_zoom(open_reckoned):
    page = open_reckoned
    wide = page.evaluate(PLAN_RANGES)
    zoom(page, 'place_error', 0.4, 0.6)
    near = page.evaluate(PLAN_RANGES)
    assert near[1] - near[0] < 0.6 * 1e3 * (wide[1] - wide[0]), 'now in metres'


def test_charts_follow_the_window(open_report):
    """Made narrow while zoomed in: each chart is as wide as its place, and the zoom stays."""
    page = open_report
    wide = page.viewport_size
    zoom(page, 'cross_track', 0.4, 0.5)
    before = {panel['id']: panel for panel in page.evaluate(DRAWN)}
    page.set_viewport_size({'width': 390, 'height': 844})
    page.wait_for_function(FILLED)
    page.wait_for_function(IS_READY)
    after = page.evaluate(DRAWN)
    check_drawn(after)
    for panel in after:
        assert panel['ranges'] == before[panel['id']]['ranges']
        assert panel['place'] < before[panel['id']]['place']
    page.set_viewport_size(wide)
    zoom_out(page)


def test_report_on_paper(browser, default_run, tmp_path):
    """From a wide dark window onto A4: as wide as the page, dark ink, the 3-D view a picture."""
    page, said, asked = open_page(browser, default_run / 'report.html', color_scheme='dark')
    before = page.evaluate(DRAWN)
    straight = page.locator('figure img').get_attribute('src')
    page.evaluate("Plotly.relayout('space', { 'scene.camera.eye': { x: -1, y: 2, z: 1 } })")
    page.wait_for_function(
        "(src) => document.querySelector('figure img').src !== src", arg=straight
    )
    page.evaluate(NOTE_WHAT_IS_PRINTED)
    paper = page.pdf(path=tmp_path / 'report.pdf', prefer_css_page_size=True)
    printed = page.evaluate('window.printed')
    assert len(printed['panels']) == len(before)
    for panel in printed['panels']:
        assert panel['width'] == pytest.approx(panel['place'], abs=1.0), panel['id']
        assert panel['place'] <= A4_PX - 2 * MARGIN_PX
        assert int(panel['ink'][1:3], 16) < 0x40, 'dark ink'
    assert printed['overlaps'] == []
    assert printed['picture']['shown'] == ['IMG']
    assert printed['picture']['coloured'] > 1000, 'the track is in it'
    sizes = re.findall(rb'/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]', paper)
    assert 4 < len(sizes) < 12
    assert {(round(float(x)), round(float(y))) for x, y in sizes} == {(595, 842)}
    assert paper.count(b'/Subtype /Image') > 0
    page.wait_for_function(IS_READY)
    assert page.evaluate(DRAWN) == before, 'the screen is as it was'

    page.emulate_media(media='print')
    headings = page.evaluate(STYLES, 'h2, .panel h3')
    assert len(headings) > 20
    assert {after for after, _ in headings} == {'avoid'}, 'no page ends below a heading'
    assert {inside for _, inside in page.evaluate(STYLES, '.panel, .tile, tr')} == {'avoid'}
    assert (said, len(asked)) == ([], 1)
    page.close()


def test_report_without_webgl(without, default_run):
    """A side view in place of the one in three dimensions, and no word of plotly's about it."""
    page, said, asked = open_page(without, default_run / 'report.html')
    panels = page.evaluate(DRAWN)
    check_drawn(panels)
    (side,) = (panel for panel in panels if panel['id'] == 'space')
    assert side['kind'] == 'side'
    (track,) = side['traces']
    card = json.loads((default_run / 'score.json').read_text())
    assert max(track['y']) == pytest.approx(card['depth_m']['max'], abs=0.1)
    assert max(track['x']) == pytest.approx(card['distance_along_path_m'] / 1e3, rel=0.01)
    figure = page.locator('figure', has=page.locator('#space'))
    assert 'From the side' in figure.inner_text()
    page.locator('#space').click()
    assert len(page.context.pages) == 1, 'no other page opens'
    text = page.evaluate('document.body.outerHTML.replaceAll(/<script[^]*?<.script>/g, "")')
    assert 'webgl.org' not in text
    assert page.locator('a').count() == 0
    assert (said, len(asked)) == ([], 1)
    page.close()


def test_report_of_an_aborted_run(browser, start_glider, tmp_path):
    """Interrupted in flight: the page says so, and shows what was flown until then."""
    folder = tmp_path / 'run'
    options = ('--duration', 1e8, '--bag', '--out', folder)
    process = start_glider('run', '--engine', 'direct', *options)
    _interrupt_in_flight(process, folder)
    assert process.wait(60.0) == 130
    page, said, asked = open_page(browser, folder / 'report.html')
    assert 'Aborted' in page.locator('.badge').inner_text()
    assert 'stopped by SIGINT' in page.locator('.verdict').inner_text()
    below = page.locator('.findings').inner_text()
    assert 'Nothing went wrong' not in below and 'stopped by SIGINT' not in below
    check_drawn(page.evaluate(DRAWN))
    assert (said, len(asked)) == ([], 1)
    page.close()


def _interrupt_in_flight(process, folder):
    """Send SIGINT once some of the flight is in the bag."""
    deadline = time.monotonic() + 200.0
    while not any(file.stat().st_size > 1_000_000 for file in folder.glob('*.mcap')):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)


def test_comparison(browser, glider, default_run, pid_run, tmp_path):
    """Runs of different length over each other, each with its line, zoomed together."""
    file = tmp_path / 'compared.html'
    done = glider('compare', default_run, pid_run, '--out', file, '--json')
    assert done.returncode == 0, done.stderr
    page, said, asked = open_page(browser, file)
    panels = page.evaluate(DRAWN)
    check_drawn(panels)
    for panel in panels:
        names = [trace['name'] for trace in panel['traces']]
        assert {'default', 'pid'} <= set(names), panel['id']
    rows = page.locator('table').nth(0).inner_text()
    for run in json.loads(done.stdout)['runs']:
        assert f'{run["score"]["cross_track_m"]["max_steady"]:.3f} m' in rows
    assert 'control.law' in page.locator('table').nth(1).inner_text()
    zoom(page, 'pitch', 0.2, 0.4)
    ranges = [panel['ranges'] for panel in page.evaluate(DRAWN) if panel['kind'] == 'time']
    assert all(one == ranges[0] for one in ranges)
    assert ranges[0][0] > 0.0
    assert (said, len(asked)) == ([], 1)
    page.close()
