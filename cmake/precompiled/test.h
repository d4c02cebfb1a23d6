// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// As library.h, ahead of every file of the tests.

#pragma once

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "cmake/precompiled/library.h"
