// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// Included before all else where clang compiles what uses ITK. Debian's two generated headers that
// look at the compiler know GCC alone and end with an error for others; all that they learn from it
// is which parts of C++11 there are.

#pragma once

#pragma clang diagnostic push
#pragma clang diagnostic ignored "-Wbuiltin-macro-redefined"
#undef __clang__
#undef __GNUC__
#define __GNUC__ 12
#include <itk_compiler_detection.h>
#include <vcl_compiler_detection.h>
#undef __GNUC__
#define __GNUC__ 4
#define __clang__ 1
#pragma clang diagnostic pop
