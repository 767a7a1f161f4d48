# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider figures``: the moving picture and the figures of README, from flights of this tree.

Every figure of README stands in docs/figures.json, with the command that printed it, the commit
and the date. README shows them between markers; test/test_readme.py compares the two.
"""

import json
import re
import subprocess
from datetime import datetime, timezone
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import hero
import typer

from glider_base.settings import ConfigurationError
from glider_bringup.console import counter, messages, output
from glider_bringup.showing.flown_run import read_run

ROOT = Path(__file__).resolve().parents[2]
README = ROOT / 'README.md'
FIGURES = ROOT / 'docs' / 'figures.json'
MOVING, STILL = (ROOT / 'docs' / 'images' / f'hero.{kind}' for kind in ('gif', 'png'))
MARKED = re.compile(r'(<!-- figures: (\w+) -->\n)(.*?)(<!-- end -->)', re.DOTALL)

LONG = 'run reckoned_12deg --engine direct --duration full --no-report'
#: Flights that are simulated here, by name: what is typed after ./glider.
FLIGHTS = {
    'shown': 'run slocum_shelf --engine direct --no-report',
    'reckoned': f'{LONG} --json',
    'known': f'{LONG} --set navigation.method=known --json',
}
#: Flights of real gliders, in the folder of --at-sea; docs/validation.md says where from.
AT_SEA = {
    'comet': 'validate gliderflight/data/dbd --vehicle slocum_g2 --json',
    'pgpt': 'validate PGPT/example/delayed/raw --vehicle slocum_g2 --json',
    'sg249': 'validate basestation3/testdata/sg249_NANOOS_Apr24 --vehicle seaglider --json',
    'dac_pgpt': 'navigate PGPT/example/delayed/raw --json',
    'dac_sg249': 'navigate basestation3/testdata/sg249_NANOOS_Apr24 --json',
    'wh_pgpt': 'energy PGPT/example/delayed/raw --json',
    'wh_sg249': 'energy basestation3/testdata/sg249_NANOOS_Apr24 --json',
}
#: Lines of a scorecard that README shows.
SHOWN = ('status', 'flown', 'simulated time', 'dives', 'navigation', 'energy', 'battery lasts')

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command(
    epilog='Example: ./glider figures --at-sea ~/flights',
    context_settings={'help_option_names': ['-h', '--help']},
)
def figures(
    at_sea: Annotated[
        Path | None,
        typer.Option(
            file_okay=False,
            exists=True,
            help='Folder with clones of the flights of real gliders (docs/validation.md). '
            'Without it the figures of these stay, with their commit.',
        ),
    ] = None,
) -> None:
    """Make the moving picture of README and its figures anew, from flights of this tree."""
    found = json.loads(FIGURES.read_text()) if FIGURES.exists() else {}
    wanted = [(name, words, ROOT) for name, words in FLIGHTS.items()]
    wanted += [(name, words, at_sea) for name, words in AT_SEA.items() if at_sea]
    with counter('figures', len(wanted)) as update:
        for number, (name, words, folder) in enumerate(wanted):
            found[name] = measured(words, folder)
            update(number + 1, len(wanted))
    FIGURES.write_text(json.dumps(found, indent=1) + '\n')
    README.write_text(with_figures(README.read_text(), found))
    with TemporaryDirectory() as folder, counter('pictures', hero.FRAMES) as update:
        mission, run = Path(__file__).with_name('hero.yaml'), Path(folder) / 'run'
        glider(f'run {mission} --engine direct --duration full --out {run}', ROOT)
        hero.draw(read_run(run), MOVING, STILL, lambda done: update(done, hero.FRAMES))
    output.print(f'written: {README.name}, {FIGURES.name}, {MOVING.name}, {STILL.name}')


def glider(words: str, folder: Path) -> str:
    """What a command of this tree prints."""
    done = subprocess.run(
        [ROOT / 'glider', *words.split()], cwd=folder, capture_output=True, text=True
    )
    if done.returncode:
        raise ConfigurationError(f'./glider {words}: {done.stderr.strip()}')
    return done.stdout


def measured(words: str, folder: Path) -> dict[str, Any]:
    """What a command prints, with the command, the commit and the date."""
    words = f'{words} --out {{}}' if words.startswith('run') else words
    with TemporaryDirectory() as scratch:
        printed = glider(words.format(f'{scratch}/run'), folder)
    commit = subprocess.run(
        ['git', 'rev-parse', '--short', 'HEAD'], cwd=ROOT, capture_output=True, text=True
    ).stdout.strip()
    kept = json.loads(printed) if '--json' in words else card_lines(printed)
    if isinstance(kept, dict):
        kept = {key: kept[key] for key in KEPT if key in kept}
        if 'navigation' in kept:
            kept['navigation'] = {key: kept['navigation'][key] for key in NAVIGATION}
    return {
        'command': f'./glider {words.removesuffix(" --out {}")}',
        'commit': commit,
        'date': datetime.now(timezone.utc).strftime('%Y-%m-%d'),
        'printed': kept,
    }


#: Of the JSON of a command: what README shows, and what says of which flight it is.
KEPT = (
    *('scenario', 'dives', 'sim_time_s', 'navigation', 'segments', 'w_rmse_cmps', 'peer'),
    *('u_adcp_rmse_cmps', 'dac_difference_mps', 'recorded_wh', 'predicted_wh', 'error_percent'),
)


NAVIGATION = ('method', 'surfacing_error_m', 'surfacing_cross_track_m', 'from_fourth')


def card_lines(printed: str) -> list[str]:
    """Lines of a scorecard, without its frame; what a line goes on with is joined to it."""
    lines = []
    for line in printed.splitlines():
        cells = [cell.strip() for cell in line.strip('│').split('│')]
        if len(cells) == 2 and cells[0]:
            lines.append(cells)
        elif len(cells) == 2:
            lines[-1][1] += f' {cells[1]}'
    return [f'{name:<26} {value}' for name, value in lines]


def with_figures(text: str, found: dict[str, Any]) -> str:
    """README with its figures as they were measured."""
    made = {'shown': shown(found), 'tracking': tracking(found), 'sea': sea(found)}
    return MARKED.sub(lambda block: f'{block[1]}{made[block[2]]}\n{block[4]}', text)


def origin(found: dict[str, Any], names) -> str:
    """When, and at which commit, figures were measured."""
    told = sorted({f'commit {found[name]["commit"]}, {found[name]["date"]}' for name in names})
    return '; '.join(told)


def shown(found: dict[str, Any]) -> str:
    """Of the scorecard that the first command prints."""
    lines = found['shown']['printed']
    kept = [line for line in lines if line.startswith(SHOWN) or 'surfacing' in line]
    return '\n'.join(['```text', *kept, '```'])


def tracking(found: dict[str, Any]) -> str:
    """How far off the path, dead-reckoned and with position known."""
    reckoned, known = (found[name]['printed']['navigation'] for name in ('reckoned', 'known'))
    first, second, third = reckoned['surfacing_error_m'][:3]
    aside, sure = (
        max(abs(metres) for metres in one['surfacing_cross_track_m'][3:])
        for one in (reckoned, known)
    )
    under = [one['from_fourth']['under_water_rms_m'] for one in (reckoned, known)]
    return '\n'.join(
        [
            '| simulated, 30 h, current of 1.0 kn | dead-reckoned | position known |',
            '| --- | --- | --- |',
            '| surfacing position error: 1st, 2nd, 3rd surfacing '
            f'| {first:,.0f}, {second:,.0f}, {third:,.0f} m | 0 m |',
            '| cross-track at surfacings, from the 4th on, at most '
            f'| {aside:.1f} m | {sure:.1f} m |',
            f'| the same under water, rms | {under[0]:.1f} m | {under[1]:.1f} m |',
            '',
            f'`./glider {LONG.removesuffix(" --no-report")}`; {origin(found, FLIGHTS)}.',
        ]
    )


def sea(found: dict[str, Any]) -> str:
    """Dives of real gliders beside what this tree makes of them."""
    row = {name: found[name]['printed'] for name in AT_SEA}
    lines = ['| measured at sea | compared | error |', '| --- | --- | --- |']
    for name, what in (
        ('comet', 'Slocum, German Bight'),
        ('pgpt', 'Slocum, Newfoundland'),
        ('sg249', 'Seaglider sg249'),
    ):
        one = row[name]
        other = {'basestation': 'its base station'}.get(one['peer']['name'], one['peer']['name'])
        lines.append(
            f'| {what}, {one["segments"]} dives | vertical speed, fitted | '
            f'{one["w_rmse_cmps"]:.2f} cm/s rms; {other}: {one["peer"]["w_rmse_cmps"]:.2f} |'
        )
    adcp = row['comet']['u_adcp_rmse_cmps']
    lines.append(f'| the first of these | speed by ADCP | {adcp:.1f} cm/s rms |')
    dac = [row[name]['dac_difference_mps']['median'] for name in ('dac_pgpt', 'dac_sg249')]
    lines.append(
        '| the last two | depth-averaged current | '
        f'{100 * dac[0]:.2f}, {100 * dac[1]:.2f} cm/s median |'
    )
    for name, what in (('wh_pgpt', 'the second, all energy'), ('wh_sg249', 'the third, its pump')):
        one = row[name]
        lines.append(
            f'| {what} | {one["recorded_wh"]:.1f} Wh measured, '
            f'{one["predicted_wh"]:.1f} predicted | {one["error_percent"]:+.1f} % |'
        )
    end = f'`./glider validate`, `navigate`, `energy`; {origin(found, AT_SEA)}.'
    return '\n'.join([*lines, '', end])


if __name__ == '__main__':
    try:
        app(prog_name='./glider figures')
    except ConfigurationError as error:
        messages.print(f'glider: {error}')
        raise SystemExit(2) from None
