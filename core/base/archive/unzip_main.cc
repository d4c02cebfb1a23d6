// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// tissueform-unzip: unpacks a zip through libzip for another program of ours.

#include "core/base/archive/unpacked_zip.h"
#include "core/base/archive/zip_reader.h"

int main() { return tissueform::RunUnzip(tissueform::ReadZip); }
