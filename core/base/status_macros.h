// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

// Debian's Abseil 20220623 has no status macros; these are the two that are in common use.

// Returns from the function when `expression` (an absl::Status) is not OK.
#define TF_RETURN_IF_ERROR(expression)                              \
  do {                                                              \
    if (::absl::Status tf_status = (expression); !tf_status.ok()) { \
      return tf_status;                                             \
    }                                                               \
  } while (false)

// TF_ASSIGN_OR_RETURN(const TetMesh mesh, TetMesh::Create(...));
#define TF_ASSIGN_OR_RETURN(declaration, expression) \
  TF_ASSIGN_OR_RETURN_IMPL(TF_CONCATENATE(tf_status_or_, __LINE__), declaration, expression)

#define TF_ASSIGN_OR_RETURN_IMPL(status_or, declaration, expression) \
  auto status_or = (expression);                                     \
  if (!status_or.ok()) {                                             \
    return std::move(status_or).status();                            \
  }                                                                  \
  declaration = std::move(status_or).value()

#define TF_CONCATENATE(a, b) TF_CONCATENATE_IMPL(a, b)
#define TF_CONCATENATE_IMPL(a, b) a##b
