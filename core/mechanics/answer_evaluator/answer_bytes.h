// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "core/mechanics/answer_evaluator/portable_answers.h"

namespace tissueform {

// The newest that is read. Written is the lowest that has what is there: 2 with a third order,
// which readers of 1 would pass over.
inline constexpr uint32_t kAnswerFormatVersion = 4;
inline constexpr size_t kMaxAnswerBytes = size_t{256} << 20;

enum class AnswerError {
  kNone,
  kTooLarge,     // more bytes than are allowed
  kNotAnswers,   // begins with something else
  kVersion,      // of a version that this reader does not know
  kBroken,       // cut off, or sections that do not lie one after the other
  kInconsistent  // sizes that do not fit together, numbers out of range or not finite
};

struct AnswerReading {
  AnswerError error = AnswerError::kNone;
  std::string message;  // one line, empty without an error
  PortableAnswers answers;
};

// The bytes of docs/prepared-answers.md. REQUIRES: CheckAnswers finds nothing; less than 4 GiB.
std::string WriteAnswers(const PortableAnswers& answers);

// Takes any bytes; what comes without an error keeps CheckAnswers, and may be evaluated. Allocates
// no more than the bytes hold, and a little. Sections that it does not know are passed over.
AnswerReading ReadAnswers(std::string_view bytes, size_t most_bytes = kMaxAnswerBytes);

}  // namespace tissueform
