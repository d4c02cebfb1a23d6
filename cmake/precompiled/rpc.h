// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// The same for the files that speak gRPC.

#pragma once

#include <google/protobuf/message.h>
#include <grpcpp/grpcpp.h>

#include "cmake/precompiled/library.h"
