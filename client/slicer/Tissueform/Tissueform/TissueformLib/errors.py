# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Errors that the module shows."""


class SceneError(ValueError):
    """The scene or the settings do not give what is needed. One line: what, where, what to do."""
