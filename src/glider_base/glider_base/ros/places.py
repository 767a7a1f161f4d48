# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Namespaces and domains: the places in ROS 2 where gliders live, side by side."""

import fcntl
import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from glider_base.errors import ConfigurationError, shown

#: Where the nodes of a glider live, if nobody says otherwise.
NAMESPACE = '/glider'
#: Characters of a namespace: with it, names of topics and services have at most 255.
MAX_NAMESPACE = 200
NAMESPACE_ALLOWED = (
    f'names of letters, digits and _, with / between them, up to {MAX_NAMESPACE} characters'
)

_NAMESPACE = re.compile(r'(/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*)?/?')
_DOMAINS = range(1, 102)
#: Domains that there are ports for.
MAX_DOMAIN = 232
#: Argument of ROS: no files of logs in its home, which may not be writable. A run has its own.
QUIET = '--disable-external-lib-logs'


def absolute_namespace(text: str) -> str | None:
    """Namespace as ROS writes it, or None if ``text`` is none."""
    usable = len(text) <= MAX_NAMESPACE and _NAMESPACE.fullmatch(text)
    return '/' + text.strip('/') if usable else None


def given_domain() -> int | None:
    """ROS domain that $ROS_DOMAIN_ID says; None if it says nothing, an error if it is none."""
    text = os.environ.get('ROS_DOMAIN_ID')
    if not text:
        return None
    if not (text.isascii() and text.isdigit() and len(text) < 9 and int(text) <= MAX_DOMAIN):
        raise ConfigurationError(
            f'ROS_DOMAIN_ID = {shown(text)}: no ROS domain (allowed: 0 to {MAX_DOMAIN})'
        )
    return int(text)


@contextmanager
def domain_id() -> Iterator[int]:
    """ROS domain of a run: $ROS_DOMAIN_ID, or one that no other run on this machine uses.

    Raises ConfigurationError if all of them are taken, or $ROS_DOMAIN_ID is none.
    """
    domain, lock = given_domain(), None
    if domain is not None:  # others may have been given it too, but nobody shall draw it
        lock = _locked(domain, fcntl.LOCK_SH)
    else:
        for offset in range(len(_DOMAINS)):
            domain = _DOMAINS[(os.getpid() + offset) % len(_DOMAINS)]
            lock = _locked(domain, fcntl.LOCK_EX, fcntl.LOCK_SH)
            if lock is not None:
                break
        else:
            raise ConfigurationError('every ROS domain from 1 to 101 is in use by another run')
    try:
        yield domain
    finally:
        if lock is not None:
            os.close(lock)


def _locked(domain: int, *kinds: int) -> int | None:
    """Lock of a domain, taken in these ways one after the other; None if somebody has it.

    Who draws a domain takes it alone first, so that nobody has it, and then shares it with those
    that are given it: so it is in use until the last of them ends. The file may be that of another
    person, who lets it be read.
    """
    path = Path(tempfile.gettempdir()) / f'glider-ros-domain-{domain}.lock'
    try:
        if not path.exists():
            path.touch()
            path.chmod(0o644)
        descriptor = os.open(path, os.O_RDONLY)
    except OSError:
        return None
    try:
        for kind in kinds:
            fcntl.flock(descriptor, kind | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        return None
    return descriptor
