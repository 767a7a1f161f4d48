# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""docs/theory.md names functions and tests that exist, and leaves no function of its parts out."""

import ast
import functools
import importlib
import inspect
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
THEORY = (ROOT / 'docs/theory.md').read_text(encoding='utf-8')
SECTION = THEORY[THEORY.index('\n## 7 ') : THEORY.index('\n## 8 ')]
#: Cells of the row of each statement.
STATEMENTS = {
    row[1]: [cell.strip() for cell in row[2].split('|')]
    for row in re.finditer(r'^\| (S\d+) \|(.*)\|$', SECTION, re.MULTILINE)
}
#: Modules of which every public function is named in the document, by its name.
WHOLE = (
    *('glider_guidance.los', 'glider_guidance.current_observer', 'glider_control.allocation'),
    *('glider_studies.bounds.certificate', 'glider_studies.bounds.lmi'),
)


@functools.cache
def known_tests() -> dict[str, list[ast.FunctionDef]]:
    """Every test of the tree, by its name."""
    found = {}
    for path in [*ROOT.glob('test/test_*.py'), *ROOT.glob('src/*/test/test_*.py')]:
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            if isinstance(node, ast.FunctionDef) and node.name.startswith('test_'):
                found.setdefault(node.name, []).append(node)
    return found


def test_numbers_follow_one_another():
    for letter, least in (('A', 8), ('S', 13), ('N', 7)):
        numbers = [int(one) for one in re.findall(rf'^\| {letter}(\d+) \|', SECTION, re.MULTILINE)]
        assert numbers == list(range(1, len(numbers) + 1)) and len(numbers) >= least


def test_what_is_referred_to_is_numbered():
    known = set(re.findall(r'^\| ([ASN]\d+) \|', SECTION, re.MULTILINE))
    assert set(re.findall(r'\b[ASN]\d+\b', THEORY)) - {'M2'} <= known


@pytest.mark.parametrize('statement', STATEMENTS)
def test_statement_names_function_test_and_bound(statement):
    _, under, proof, function, test, bound = STATEMENTS[statement]
    module, name = re.fullmatch(r'`([\w.]+):(\w+)`', function).groups()
    assert callable(getattr(importlib.import_module(module), name))
    (test,) = re.findall(r'`(test_\w+)`', test)
    assert test in known_tests()
    assert under and proof and bound


def test_every_test_that_the_document_names_is_there():
    named = set(re.findall(r'`(test_\w+)`', THEORY))
    assert len(named) > 15
    assert named <= known_tests().keys()


def test_every_file_that_the_document_names_is_there():
    for name in set(re.findall(r'`((?:\w+/)*\w+\.py)`', THEORY)):
        assert (ROOT / name).is_file() or list((ROOT / 'src').glob(f'**/{name}')), name


@pytest.mark.parametrize('module', WHOLE)
def test_no_function_is_left_out(module):
    loaded = importlib.import_module(module)
    functions = {
        name
        for name, one in vars(loaded).items()
        if not name.startswith('_')
        and inspect.isfunction(getattr(one, 'py_func', one))
        and getattr(one, '__module__', '') == module
    }
    assert functions
    missing = {name for name in functions if not re.search(rf'\b{name}\b', THEORY)}
    assert missing == set()
