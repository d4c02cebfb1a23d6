# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""What the module does, without 3D Slicer: only scene.py imports slicer. Lengths are in mm; RAS unless a name ends in _lps."""
