# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""docs/vehicle_file.md says what the models of a vehicle file say, and leads to one that glides.

./glider python test/test_vehicle_doc.py       makes its tables anew
"""

import re
from pathlib import Path
from typing import get_args

import pydantic
import pytest

from glider_base.settings import BOUNDS, limits
from glider_model.plant.trim import solve_trim
from glider_model.vehicle.file import SURFACES, Vehicle, load_vehicle

DOCUMENT = Path(__file__).resolve().parents[1] / 'docs' / 'vehicle_file.md'
MARKED = re.compile(r'(<!-- table: ([^>]+) -->\n)(.*?)(<!-- end -->)', re.DOTALL)


def model_of(annotation) -> type[pydantic.BaseModel] | None:
    """Model that an annotation is, or may be."""
    return next(
        (
            kind
            for kind in (annotation, *get_args(annotation))
            if isinstance(kind, type) and issubclass(kind, pydantic.BaseModel)
        ),
        None,
    )


def is_quantity(model) -> bool:
    return model is not None and 'value' in model.model_fields


def range_of(field) -> str:
    return ', '.join(f'{BOUNDS[name]} {limit:g}' for name, limit in limits(field).items())


def row(name: str, field) -> tuple[str, ...]:
    """Name, unit, range, whether it is needed, meaning."""
    model, unit, allowed = model_of(field.annotation), '', ''
    if is_quantity(model):
        unit, value = re.search(r'\[(.*)\]$', model.__name__)[1], model.model_fields['value']
        allowed = range_of(value)
        if value.annotation is not float:
            (one,) = get_args(value.annotation)
            unit, allowed = f'{unit}, three numbers', range_of(one.__metadata__[0])
    return (
        f'`{name}`',
        unit,
        allowed,
        'required' if field.is_required() else 'optional',
        field.description or '',
    )


def rows(model: type[pydantic.BaseModel], prefix: str = ''):
    for name, field in model.model_fields.items():
        inside = model_of(field.annotation)
        yield row(prefix + name, field)
        if inside is not None and not is_quantity(inside):
            yield from rows(inside, f'{prefix}{name}.')


def tables() -> dict[str, str]:
    """Every table of the document, by the name in its marker."""
    sections, alone = {}, []
    for name, field in Vehicle.model_fields.items():
        model = model_of(field.annotation)
        if model is None or is_quantity(model):
            alone.append(row(name, field))
        elif name not in SURFACES or name == 'fin':
            sections[name] = list(rows(model))
    head = [('field', 'unit', 'allowed', 'needed', 'meaning'), ('---',) * 5]
    return {
        name: ''.join(f'| {" | ".join(one)} |\n' for one in (*head, *lines))
        for name, lines in {'vehicle': alone, **sections}.items()
    }


@pytest.fixture(scope='module')
def document() -> str:
    return DOCUMENT.read_text(encoding='utf-8')


def test_every_section_has_its_table(document):
    assert sorted(match[2] for match in MARKED.finditer(document)) == sorted(tables())


@pytest.mark.parametrize('name', tables())
def test_table_says_what_the_code_says(document, name):
    written = {match[2]: match[3] for match in MARKED.finditer(document)}[name]
    assert written == tables()[name], 'run python test/test_vehicle_doc.py'


def test_every_field_has_a_meaning():
    for name, text in tables().items():
        for line in text.splitlines()[2:]:
            assert len(line.split('|')[5].strip()) > 2, f'{name}: {line}'


@pytest.fixture(scope='module')
def mine(document, tmp_path_factory):
    """The file that the document leads to."""
    path = tmp_path_factory.mktemp('mine') / 'my_slocum.yaml'
    path.write_text(''.join(re.findall(r'```yaml\n(.*?)```', document, re.DOTALL)))
    return load_vehicle(str(path))


def test_the_pieces_are_a_file_that_glides_as_the_document_says(document, mine):
    told = re.findall(
        r'^\| (-\d+) \| ([\d.]+) m/s \| ([\d.]+) m/s \| ([\d.]+) deg', document, re.M
    )
    assert [line[0] for line in told] == ['-25', '-35']
    for line in told:
        pitch, speed, vertical, alpha = map(float, line)
        trim = solve_trim(mine.params(), 0.205, pitch_deg=pitch)
        assert trim.converged
        assert trim.speed_mps == pytest.approx(speed, abs=6e-5)
        assert trim.vertical_mps == pytest.approx(vertical, abs=6e-5)
        assert trim.alpha_deg == pytest.approx(alpha, abs=6e-3)


def test_its_pump_pitches_it_as_the_document_says(mine):
    trim = solve_trim(mine.params(), 0.23 * 1.025, pitch_mass_m=0.0)
    assert trim.pitch_deg == pytest.approx(-25.0, abs=1.0)


if __name__ == '__main__':
    text = DOCUMENT.read_text(encoding='utf-8')
    current = tables()
    DOCUMENT.write_text(MARKED.sub(lambda m: m[1] + current[m[2]] + m[4], text), encoding='utf-8')
