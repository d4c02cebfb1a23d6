// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mesh/io/tet_mesh_io.h"
#include "tests/testing/file_bytes.h"

namespace tissueform::testing {

// A folder of its own for every test.
class MeshFolder : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    std::string name = std::string(info->test_suite_name()) + "." + info->name();
    for (char& c : name) c = c == '/' ? '.' : c;
    folder_ = std::filesystem::path(::testing::TempDir()) / "mesh_io_test" / name;
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string Path(const std::string& name) const { return (folder_ / name).string(); }

  void Write(const std::string& name, const std::string& contents) const {
    std::ofstream(Path(name), std::ios::binary) << contents;
  }

  // Writes a file and reads it as a mesh of tets; nothing may appear on stderr, regardless of the
  // result.
  absl::StatusOr<TetMeshFile> Read(const std::string& name, const std::string& contents) const {
    Write(name, contents);
    ::testing::internal::CaptureStderr();
    absl::StatusOr<TetMeshFile> file = ReadTetMesh(Path(name));
    EXPECT_THAT(::testing::internal::GetCapturedStderr(), ::testing::IsEmpty());
    return file;
  }

  std::filesystem::path folder_;
};

}  // namespace tissueform::testing
