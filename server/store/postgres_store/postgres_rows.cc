// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_rows.h"

#include <cstdint>
#include <string>
#include <utility>
#include <variant>

#include <pqxx/pqxx>

namespace tissueform {
namespace {

constexpr pqxx::oid kByteaType = 17;

pqxx::binarystring ToBinary(const SqlValue& value) {
  if (const auto* text = std::get_if<absl::string_view>(&value)) {
    return pqxx::binarystring(text->data(), text->size());
  }
  if (const auto* bytes = std::get_if<SqlBytes>(&value)) {
    return pqxx::binarystring(bytes->bytes.data(), bytes->bytes.size());
  }
  auto number = static_cast<uint64_t>(std::get<int64_t>(value));
  std::string bytes(sizeof(number), '\0');
  for (size_t i = bytes.size(); i-- > 0; number >>= 8) bytes[i] = static_cast<char>(number & 0xff);
  return pqxx::binarystring(bytes);
}

}  // namespace

std::vector<pqxx::binarystring> ToParameters(absl::Span<const SqlValue> values) {
  std::vector<pqxx::binarystring> parameters;
  parameters.reserve(values.size());
  for (const SqlValue& value : values) parameters.push_back(ToBinary(value));
  return parameters;
}

SqlRows ToRows(const pqxx::result& result) {
  std::vector<SqlRows::Row> rows;
  rows.reserve(result.size());
  for (const pqxx::row& from : result) {
    SqlRows::Row row;
    row.reserve(from.size());
    for (const pqxx::field& field : from) {
      if (field.type() == kByteaType && !field.is_null()) {
        const pqxx::binarystring bytes(field);
        row.emplace_back(bytes.get(), bytes.size());
      } else {
        row.emplace_back(field.c_str(), field.size());
      }
    }
    rows.push_back(std::move(row));
  }
  return SqlRows(std::move(rows));
}

}  // namespace tissueform
