# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""./glider docs: a strict site, in which links lead somewhere and every name can be found."""

import re
import shutil
import subprocess
import sys
from functools import partial
from http.server import HTTPServer, SimpleHTTPRequestHandler
from importlib.util import find_spec
from pathlib import Path
from threading import Thread
from urllib.parse import unquote

import click
import pytest
import typer

import glider_bringup
from glider_base.wiring import PORTS
from glider_bringup import cli
from glider_bringup.scoring.scores import SCORES
from glider_guard.rows import ROWS
from glider_mission.scenario import Scenario
from glider_model.vehicle.file import Vehicle

ROOT = Path(__file__).resolve().parents[1]
needs_mkdocs = pytest.mark.skipif(not find_spec('material'), reason='requirements-docs.txt')


def build(out: Path, *before: str) -> subprocess.CompletedProcess:
    program = ROOT / 'docs/making/pages.py'
    return subprocess.run(
        [sys.executable, *before, program, '--out', out], capture_output=True, text=True
    )


@pytest.fixture(scope='module')
def site(tmp_path_factory):
    """The site, built anew; a warning would have ended it."""
    folder = tmp_path_factory.mktemp('site')
    done = build(folder)
    assert (done.returncode, 'WARNING' in done.stderr) == (0, False), done.stderr
    return folder


@pytest.fixture(scope='module')
def text(site):
    """What can be read on all pages, without tags."""
    pages = [page.read_text(encoding='utf-8') for page in sorted(site.rglob('*.html'))]
    bodies = [re.search(r'<article.*?</article>', page, re.DOTALL) for page in pages]
    whole = ' '.join(body[0] for body in bodies if body)
    return re.sub(r'<[^>]+>', ' ', re.sub(r'</?span[^>]*>', '', whole))


def missing(text: str, names) -> list[str]:
    return [name for name in names if not re.search(rf'(?<![\w.]){re.escape(name)}\b', text)]


@needs_mkdocs
def test_every_link_of_the_site_leads_to_a_page_and_a_heading(site):
    checked = 0
    for page in site.rglob('*.html'):
        for target in re.findall(r'href="([^"]+)"', page.read_text(encoding='utf-8')):
            path, _, anchor = unquote(target).partition('#')
            if re.match(r'\w+:', target) or page.name == '404.html':
                continue
            file = (page.parent / path).resolve() if path else page
            assert file.exists(), f'{page.name}: {target}'
            if anchor and file.suffix == '.html':
                assert f'id="{anchor}"' in file.read_text(encoding='utf-8'), f'{page}: {target}'
            checked += 1
    assert checked > 1000


@needs_mkdocs
def test_every_option_topic_event_and_score_has_an_entry(text):
    group = typer.main.get_command(cli.app)
    context = click.Context(group)
    commands = {name: group.get_command(context, name) for name in cli.ORDER}
    options = {name for one in commands.values() for way in one.params for name in way.opts}
    assert missing(text, [f'./glider {name}' for name in cli.ORDER]) == []
    assert [name for name in options if name.startswith('--') and name not in text] == []
    assert missing(text, [port for port in PORTS]) == []
    assert missing(text, [row.name for row in ROWS]) == []
    assert missing(text, [score.key for score in SCORES]) == []


@needs_mkdocs
def test_every_field_and_public_name_has_an_entry(text):
    assert missing(text, Scenario.model_fields) == []
    assert missing(text, [name for name in Vehicle.model_fields if name != 'rudder']) == []
    assert missing(text, [f'glider.{name}' for name in dir(glider_bringup)]) == []
    assert missing(text, ['no_such_field']) == ['no_such_field']


@needs_mkdocs
@pytest.mark.skipif(not shutil.which('chromium'), reason='no chromium')
def test_search_finds_a_page(site):
    from playwright.sync_api import sync_playwright

    with HTTPServer(('127.0.0.1', 0), partial(SimpleHTTPRequestHandler, directory=site)) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        with sync_playwright() as player:
            browser = player.chromium.launch(
                executable_path=shutil.which('chromium'), args=['--no-sandbox']
            )
            page = browser.new_page()
            page.goto(f'http://127.0.0.1:{server.server_port}/')
            # Typed as by a person, once the index is read: the page looks when a key goes up.
            index_is_read = page.locator('.md-search-result__meta', has_text='Type to start')
            index_is_read.wait_for(state='attached', timeout=120_000)
            page.locator('input.md-search__input').press_sequentially('drop weight')
            # results change with every letter: what is waited for is the one that has to come
            found = page.locator('.md-search-result__link[href*="safety.html"]')
            found.first.wait_for(state='attached', timeout=120_000)
            browser.close()
        server.shutdown()


@needs_mkdocs
def test_a_dead_link_ends_the_build(tmp_path):
    shutil.copytree(ROOT / 'docs/making', tmp_path / 'docs/making')
    how, _, _ = (ROOT / 'mkdocs.yml').read_text().partition('\nnav:')
    (tmp_path / 'mkdocs.yml').write_text(how)
    program, page = tmp_path / 'docs/making/pages.py', tmp_path / 'docs/index.md'
    for name, code in (('index.md', 0), ('nowhere.md', 1)):
        page.write_text(f'# One page\n\n[there]({name})\n')
        done = subprocess.run([sys.executable, program], capture_output=True, text=True)
        assert done.returncode == code, done.stderr
    assert 'nowhere.md' in done.stderr


def test_without_mkdocs_it_is_one_sentence(tmp_path):
    blocked = tmp_path / 'mkdocs.py'
    blocked.write_text('raise ImportError\n')
    (tmp_path / 'material.py').write_text('raise ImportError\n')
    program = f'import sys, runpy; sys.path.insert(0, {str(tmp_path)!r}); runpy.run_path('
    program += f'{str(ROOT / "docs/making/pages.py")!r}, run_name="__main__")'
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert 'pip install --no-deps -r requirements-docs.txt' in line
