// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/dataset_equality.h"

#include <cstdint>
#include <cstring>
#include <fstream>
#include <vector>

namespace tissueform {
namespace {

constexpr size_t kPieceBytes = 1 << 18;

// Where the data set begins: after the preamble and the meta header, whose first element
// (0002,0000) says how long the rest of it is.
std::streamoff DataSetBegin(std::ifstream* file) {
  constexpr std::streamoff kMeta = 132;
  constexpr std::streamoff kFirst = 12;
  unsigned char first[kFirst] = {};
  file->seekg(kMeta);
  if (!file->read(reinterpret_cast<char*>(first), kFirst)) return 0;
  if (std::memcmp(first, "\x02\x00\x00\x00UL\x04\x00", 8) != 0) return 0;
  const uint32_t length =
      first[8] | first[9] << 8 | first[10] << 16 | static_cast<uint32_t>(first[11]) << 24;
  return kMeta + kFirst + length;
}

}  // namespace

bool DatasetsAreEqual(const std::string& one, const std::string& other) {
  std::ifstream files[2] = {std::ifstream(one, std::ios::binary),
                            std::ifstream(other, std::ios::binary)};
  for (std::ifstream& file : files) {
    const std::streamoff begin = DataSetBegin(&file);
    file.clear();
    file.seekg(begin);
  }
  std::vector<char> pieces[2] = {std::vector<char>(kPieceBytes), std::vector<char>(kPieceBytes)};
  while (true) {
    files[0].read(pieces[0].data(), kPieceBytes);
    files[1].read(pieces[1].data(), kPieceBytes);
    const auto count = static_cast<size_t>(files[0].gcount());
    if (files[1].gcount() != files[0].gcount() ||
        std::memcmp(pieces[0].data(), pieces[1].data(), count) != 0) {
      return false;
    }
    if (count < kPieceBytes) return true;
  }
}

}  // namespace tissueform
