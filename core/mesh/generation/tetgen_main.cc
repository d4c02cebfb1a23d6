// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// tissueform-tetrahedralize: fills a surface with tets by TetGen for another program of ours.

#include "core/mesh/generation/tetgen_adaptor.h"

int main() { return tissueform::RunTetgenProgram(tissueform::RunTetgen); }
