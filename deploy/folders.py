# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Folders that somebody has named by an option."""

import sys


def make_folder(folder, option, mode=0o777):
    """Makes it where there is none, with those above it; ends the program by one line where that cannot be."""
    try:
        folder.mkdir(mode=mode, parents=True, exist_ok=True)
    except OSError as error:
        sys.exit(f"{option} {folder}: this folder cannot be made: {error.strerror}; name another one")
