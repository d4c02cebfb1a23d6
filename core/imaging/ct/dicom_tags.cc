// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/dicom_tags.h"

#include <cstring>
#include <gdcmDataSet.h>
#include <gdcmSequenceOfItems.h>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"

namespace tissueform {
namespace {

gdcm::Tag TagOf(uint32_t tag) {
  return {static_cast<uint16_t>(tag >> 16), static_cast<uint16_t>(tag & 0xffff)};
}

// `count` digits from `begin`; none where there are other characters.
std::optional<int> Digits(absl::string_view text, size_t begin, size_t count) {
  int number = 0;
  if (text.size() < begin + count) return std::nullopt;
  for (const char digit : text.substr(begin, count)) {
    if (!absl::ascii_isdigit(static_cast<unsigned char>(digit))) return std::nullopt;
    number = 10 * number + (digit - '0');
  }
  return number;
}

// Days since the civil calendar's 1 March 0000 (Hinnant's days_from_civil), so that a scan over
// midnight at a month's end is no jump.
double DaysOf(absl::string_view date) {
  const std::optional<int> year = Digits(date, 0, 4);
  const std::optional<int> month = Digits(date, 4, 2);
  const std::optional<int> day = Digits(date, 6, 2);
  if (!year || !month || !day) return 0;
  const int shifted_year = *year - (*month <= 2 ? 1 : 0);
  const int shifted_month = (*month + 9) % 12;
  const int leap_days = shifted_year / 4 - shifted_year / 100 + shifted_year / 400;
  const int month_days = (153 * shifted_month + 2) / 5;
  return 365 * shifted_year + leap_days + month_days + *day;
}

// HHMMSS.ffffff, of which all but the hours may be missing.
std::optional<double> SecondsOfDay(absl::string_view time) {
  const std::optional<int> hours = Digits(time, 0, 2);
  if (!hours) return std::nullopt;
  double fraction = 0;
  if (time.size() > 6 && time[6] == '.' &&
      !absl::SimpleAtod(absl::StrCat("0", time.substr(6, 7)), &fraction)) {
    fraction = 0;
  }
  return 3600.0 * *hours + 60.0 * Digits(time, 2, 2).value_or(0) + Digits(time, 4, 2).value_or(0) +
         fraction;
}

std::optional<double> SecondsAt(absl::string_view date, absl::string_view time) {
  constexpr double kDay = 86400;
  const std::optional<double> seconds = SecondsOfDay(time);
  if (!seconds) return std::nullopt;
  return kDay * DaysOf(date) + *seconds;
}

}  // namespace

std::string TextOf(const gdcm::DataSet& data, uint32_t tag) {
  if (!data.FindDataElement(TagOf(tag))) return "";
  const gdcm::ByteValue* const value = data.GetDataElement(TagOf(tag)).GetByteValue();
  if (value == nullptr || value->GetPointer() == nullptr) return "";
  std::string text(value->GetPointer(), value->GetLength());
  while (!text.empty() && text.back() == '\0') text.pop_back();
  absl::StripAsciiWhitespace(&text);
  return text;
}

int ShortOf(const gdcm::DataSet& data, uint32_t tag) {
  if (!data.FindDataElement(TagOf(tag))) return 0;
  const gdcm::ByteValue* const value = data.GetDataElement(TagOf(tag)).GetByteValue();
  uint16_t number = 0;  // GDCM keeps it in this machine's byte order
  if (value == nullptr || value->GetLength() < sizeof(number)) return 0;
  std::memcpy(&number, value->GetPointer(), sizeof(number));
  return number;
}

std::optional<int> IntegerOf(const gdcm::DataSet& data, uint32_t tag) {
  int number = 0;
  if (!absl::SimpleAtoi(TextOf(data, tag), &number)) return std::nullopt;
  return number;
}

std::optional<Eigen::VectorXd> NumbersOf(const gdcm::DataSet& data, uint32_t tag, int count) {
  const std::vector<std::string> parts = absl::StrSplit(TextOf(data, tag), '\\');
  if (parts.size() != static_cast<size_t>(count)) return std::nullopt;
  Eigen::VectorXd numbers(count);
  for (int i = 0; i < count; ++i) {
    if (!absl::SimpleAtod(parts[static_cast<size_t>(i)], &numbers[i])) return std::nullopt;
  }
  if (!numbers.allFinite()) return std::nullopt;
  return numbers;
}

std::optional<double> NumberOf(const gdcm::DataSet& data, uint32_t tag) {
  const std::optional<Eigen::VectorXd> numbers = NumbersOf(data, tag, 1);
  if (!numbers) return std::nullopt;
  return (*numbers)[0];
}

std::optional<double> SecondsOf(const gdcm::DataSet& data, uint32_t date_tag, uint32_t time_tag) {
  return SecondsAt(TextOf(data, date_tag), TextOf(data, time_tag));
}

std::optional<double> SecondsOf(const gdcm::DataSet& data, uint32_t date_time_tag) {
  const std::string text = TextOf(data, date_time_tag);
  if (text.size() <= 8) return std::nullopt;
  return SecondsAt(absl::string_view(text).substr(0, 8), absl::string_view(text).substr(8));
}

int ForEachItem(const gdcm::DataSet& data, uint32_t tag,
                const std::function<void(int index, const gdcm::DataSet& item)>& visit) {
  if (!data.FindDataElement(TagOf(tag))) return 0;
  const gdcm::SmartPointer<gdcm::SequenceOfItems> items =
      data.GetDataElement(TagOf(tag)).GetValueAsSQ();
  if (!items) return 0;
  const auto count = static_cast<int>(items->GetNumberOfItems());
  for (int i = 0; i < count; ++i) {
    visit(i,
          items->GetItem(static_cast<gdcm::SequenceOfItems::SizeType>(i) + 1).GetNestedDataSet());
  }
  return count;
}

}  // namespace tissueform
