// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// As rpc.h, ahead of the tests of such files.

#pragma once

#include "cmake/precompiled/rpc.h"
#include "cmake/precompiled/test.h"
