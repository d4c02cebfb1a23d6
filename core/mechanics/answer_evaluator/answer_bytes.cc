// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/answer_bytes.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <map>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/mechanics/answer_evaluator/answer_checks.h"
#include "core/mechanics/answer_evaluator/answer_sizes.h"

namespace tissueform {
namespace {

static_assert(std::endian::native == std::endian::little, "the format is little-endian");

constexpr char kMagic[] = "TFANSWER";
constexpr size_t kMagicBytes = sizeof(kMagic) - 1;
constexpr size_t kAlignment = 16;
constexpr uint32_t kNumbersSection = 1;
constexpr uint32_t kMaxSections = 1000;

struct Head {
  char magic[kMagicBytes];
  uint32_t version;
  uint32_t num_sections;
};

struct Entry {
  uint32_t number;
  uint32_t type;
  uint32_t offset;  // from the beginning
  uint32_t count;   // of values
};

size_t Aligned(size_t offset) { return (offset + kAlignment - 1) / kAlignment * kAlignment; }

template <typename Value>
constexpr uint32_t TypeOf() {
  if (std::is_same_v<Value, double>) return 1;
  if (std::is_same_v<Value, float>) return 2;
  if (std::is_same_v<Value, int32_t>) return 3;
  static_assert(sizeof(Value) >= sizeof(int16_t));
  return 4;
}

// 0: no type of this format.
size_t BytesOf(uint32_t type) {
  constexpr size_t kBytes[] = {0, sizeof(double), sizeof(float), sizeof(int32_t), sizeof(int16_t)};
  return type < std::size(kBytes) ? kBytes[type] : 0;
}

// The numbers travel as doubles, as many as this reader knows.
constexpr size_t kNumNumbers = sizeof(AnswerNumbers) / sizeof(double);

using NumberList = std::array<double, kNumNumbers>;

uint32_t VersionOf(const PortableAnswers& answers) {
  if (!answers.seal_release.empty()) return 4;
  if (!answers.contact_gaps.empty()) return 3;
  return answers.third_lengths.empty() ? 1 : 2;
}

// The bytes hold some matrices row by row. Returns the number of columns of such a matrix, 0 for
// all other sections.
size_t MatrixColumns(const AnswerSizes& sizes, uint32_t section) {
  switch (section) {
    case 13:
      return sizes.nodes;
    case 20:
    case 22:
      return sizes.factors;
    case 42:
    case 43:
      return sizes.pairs;
    case 44:
      return sizes.triples;
    case 51:
    case 53:
    case 55:
    case 60:
      return 12 * sizes.handles;
    case 54:
    case 56:
      return sizes.contacts;
    default:
      return 0;
  }
}

// Transposes a matrix that is stored as `lines` contiguous lines.
template <typename Value>
std::vector<Value> Transposed(const std::vector<Value>& values, size_t lines) {
  std::vector<Value> across;
  across.reserve(values.size());
  for (size_t i = 0; i < values.size() / lines; ++i) {
    for (size_t line = 0; line < lines; ++line) {
      across.push_back(values[line * (values.size() / lines) + i]);
    }
  }
  return across;
}

AnswerReading Failed(AnswerError error, std::string message) {
  return {.error = error, .message = std::move(message), .answers = {}};
}

// The table by the sections' numbers. False where one does not lie behind the other.
bool ReadTable(std::string_view bytes, uint32_t num_sections, std::map<uint32_t, Entry>* table) {
  size_t end = sizeof(Head) + num_sections * sizeof(Entry);
  if (num_sections > kMaxSections || bytes.size() < end) return false;
  for (uint32_t i = 0; i < num_sections; ++i) {
    Entry entry;
    std::memcpy(&entry, bytes.data() + sizeof(Head) + i * sizeof(Entry), sizeof(Entry));
    const size_t size = entry.count * BytesOf(entry.type);
    const bool in_order = entry.offset % kAlignment == 0 && entry.offset >= end;
    if (BytesOf(entry.type) == 0 || !in_order || entry.offset > bytes.size() ||
        size > bytes.size() - entry.offset || !table->emplace(entry.number, entry).second) {
      return false;
    }
    end = entry.offset + size;
  }
  return Aligned(end) == bytes.size();
}

}  // namespace

std::string WriteAnswers(const PortableAnswers& answers) {
  std::vector<Entry> entries;
  size_t num_sections = 1;
  VisitSections(answers, [&](uint32_t /*number*/, const auto& values) {
    num_sections += values.empty() ? 0 : 1;
  });
  std::string bytes(sizeof(Head) + num_sections * sizeof(Entry), '\0');
  const auto append = [&](uint32_t number, const auto& values) {
    using Value = typename std::remove_cvref_t<decltype(values)>::value_type;
    if (values.empty()) return;
    const size_t offset = Aligned(bytes.size());
    entries.push_back({number, TypeOf<Value>(), static_cast<uint32_t>(offset),
                       static_cast<uint32_t>(values.size())});
    bytes.resize(offset + values.size() * sizeof(Value));
    std::memcpy(bytes.data() + offset, values.data(), values.size() * sizeof(Value));
  };
  const AnswerSizes sizes = SizesOf(answers);
  append(kNumbersSection, std::bit_cast<NumberList>(answers.numbers));
  VisitSections(answers, [&](uint32_t number, const auto& values) {
    const size_t columns = MatrixColumns(sizes, number);
    columns > 0 ? append(number, Transposed(values, columns)) : append(number, values);
  });
  bytes.resize(Aligned(bytes.size()));
  Head head = {{}, VersionOf(answers), static_cast<uint32_t>(num_sections)};
  std::memcpy(head.magic, kMagic, kMagicBytes);
  std::memcpy(bytes.data(), &head, sizeof(head));
  std::memcpy(bytes.data() + sizeof(Head), entries.data(), entries.size() * sizeof(Entry));
  return bytes;
}

AnswerReading ReadAnswers(std::string_view bytes, size_t most_bytes) {
  if (bytes.size() > most_bytes) {
    return Failed(AnswerError::kTooLarge, "prepared answers of " + std::to_string(bytes.size()) +
                                              " bytes; at most " + std::to_string(most_bytes) +
                                              " are read");
  }
  Head head;
  if (bytes.size() < sizeof(head) || !bytes.starts_with(kMagic)) {
    return Failed(AnswerError::kNotAnswers, "these are not prepared answers");
  }
  std::memcpy(&head, bytes.data(), sizeof(head));
  if (head.version < 1 || head.version > kAnswerFormatVersion) {
    return Failed(AnswerError::kVersion,
                  "prepared answers of version " + std::to_string(head.version) +
                      "; this reader knows 1 to " + std::to_string(kAnswerFormatVersion));
  }
  std::map<uint32_t, Entry> table;
  if (!ReadTable(bytes, head.num_sections, &table)) {
    return Failed(AnswerError::kBroken,
                  "prepared answers are incomplete or damaged; fetch them again");
  }
  AnswerReading reading;
  bool fits = true;
  const auto take = [&](uint32_t number, auto& values) {
    using Value = typename std::remove_cvref_t<decltype(values)>::value_type;
    const auto found = table.find(number);
    if (found == table.end()) return;
    const Entry& entry = found->second;
    if (entry.type != TypeOf<Value>()) {
      fits = false;
      return;
    }
    values.resize(entry.count);
    if (entry.count > 0) {
      std::memcpy(values.data(), bytes.data() + entry.offset, entry.count * sizeof(Value));
    }
  };
  std::vector<double> numbers;
  take(kNumbersSection, numbers);
  VisitSections(reading.answers, take);
  if (!fits || numbers.size() != kNumNumbers) {
    return Failed(AnswerError::kInconsistent,
                  "a section has another type or length than it should");
  }
  NumberList list;
  std::copy(numbers.begin(), numbers.end(), list.begin());
  reading.answers.numbers = std::bit_cast<AnswerNumbers>(list);
  if (VersionOf(reading.answers) > head.version) {
    return Failed(AnswerError::kInconsistent, "a section belongs to a later version");
  }
  if (std::string wrong = CheckAnswers(reading.answers); !wrong.empty()) {
    return Failed(AnswerError::kInconsistent, std::move(wrong));
  }
  const AnswerSizes sizes = SizesOf(reading.answers);
  VisitSections(reading.answers, [&sizes](uint32_t number, auto& values) {
    const size_t columns = MatrixColumns(sizes, number);
    if (columns > 0 && !values.empty()) values = Transposed(values, values.size() / columns);
  });
  return reading;
}

}  // namespace tissueform
