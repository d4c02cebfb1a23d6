# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Where the tests find programs and data, and a server for a module's tests."""

import json
import os
import pathlib
import subprocess

import tissueform

BIN = pathlib.Path(os.environ["TISSUEFORM_TEST_BIN"])
SOURCE = pathlib.Path(os.environ["TISSUEFORM_TEST_SOURCE"])
SERVER = BIN / "tissueform-server"


def start_server(*options):
    return tissueform.local(SERVER, options=options)


def tissueform_command(*arguments):
    """What the command prints."""
    return subprocess.run([BIN / "tissueform", *map(str, arguments)], check=True, stdout=subprocess.PIPE, text=True).stdout


def read_json(path):
    return json.loads((SOURCE / path).read_text())
