// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <fstream>
#include <string>
#include <vector>

#include "server/platform/audit_chain/audit_chain.h"

namespace tissueform::testing {

inline AuditKey SampleKey(char byte = 'k') { return AuditKey(std::string(32, byte)); }

// The files of a log with this many lines each, head and all, one file a string.
inline std::vector<std::string> SampleLog(const std::vector<int>& lines,
                                          const AuditKey& key = SampleKey(),
                                          AuditPosition* last = nullptr) {
  AuditChain chain(key, {});
  std::vector<std::string> files;
  for (const int count : lines) {
    std::string& file = files.emplace_back(chain.SealHead(""));
    for (int i = 1; i < count; ++i) {
      file += chain.Seal("\"event\":\"call\",\"resource\":\"sessions/" + std::to_string(i) + "\"");
    }
  }
  if (last != nullptr) *last = chain.position();
  return files;
}

inline std::vector<std::string> LinesOf(const std::string& file) {
  std::vector<std::string> lines;
  for (size_t start = 0; start < file.size();) {
    const size_t end = file.find('\n', start) + 1;
    lines.push_back(file.substr(start, end - start));
    start = end;
  }
  return lines;
}

inline std::string Joined(const std::vector<std::string>& lines) {
  std::string file;
  for (const std::string& line : lines) file += line;
  return file;
}

inline std::string WriteFile(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
  return path;
}

}  // namespace tissueform::testing
