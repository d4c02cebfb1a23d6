// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/web_files.h"

#include <filesystem>
#include <fstream>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::StatusIs;

class WebFilesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(::testing::TempDir()) /
              ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(folder_);
    Write("index.html", "<!doctype html>");
    Write("assets/index-B7sKq2aZ.js", "1;");
    Write("assets/plain.css", "a{}");
    Write("a name.txt", "a");
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  void Write(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name) << text;
  }
  WebFiles Load() const {
    auto files = WebFiles::Load(folder_.string());
    EXPECT_TRUE(files.ok()) << files.status();
    return files.ok() ? *std::move(files) : WebFiles();
  }

  std::filesystem::path folder_;
};

std::string FieldOf(const HttpReply& reply, const std::string& name) {
  for (const auto& [key, value] : reply.fields) {
    if (key == name) return value;
  }
  return "";
}

TEST_F(WebFilesTest, RootServesTheIndexWithoutCaching) {
  const HttpReply reply = Load().Reply("/", "");
  EXPECT_EQ(reply.status, 200);
  EXPECT_EQ(*reply.body, "<!doctype html>");
  EXPECT_EQ(FieldOf(reply, "content-type"), "text/html; charset=utf-8");
  EXPECT_EQ(FieldOf(reply, "cache-control"), "no-cache");
}

TEST_F(WebFilesTest, HashedNamesAreImmutable) {
  const WebFiles files = Load();
  EXPECT_THAT(FieldOf(files.Reply("/assets/index-B7sKq2aZ.js", ""), "cache-control"),
              HasSubstr("immutable"));
  EXPECT_EQ(FieldOf(files.Reply("/assets/plain.css", ""), "cache-control"), "no-cache");
}

TEST_F(WebFilesTest, DoesNotResendAnUnchangedFile) {
  const WebFiles files = Load();
  const std::string etag = FieldOf(files.Reply("/", ""), "etag");
  const HttpReply again = files.Reply("/", "\"other\", " + etag);
  EXPECT_EQ(again.status, 304);
  EXPECT_EQ(again.body, nullptr);
  EXPECT_EQ(FieldOf(again, "etag"), etag);
  EXPECT_EQ(files.Reply("/", "\"other\"").status, 200);
  EXPECT_NE(FieldOf(files.Reply("/assets/plain.css", ""), "etag"), etag);
}

TEST_F(WebFilesTest, ServesNoOtherFiles) {
  Write("../outside.txt", "secret");
  Write(".hidden", "secret");
  Write(".git/config", "secret");
  std::filesystem::create_symlink("/etc/passwd", folder_ / "link.txt");
  std::filesystem::create_directory_symlink("/etc", folder_ / "etc");
  const WebFiles files = Load();
  EXPECT_EQ(files.size(), 4U);
  for (const char* path :
       {"", "//", "/assets", "/assets/", "/../outside.txt", "/..%2foutside.txt",
        "/%2e%2e/outside.txt", "/assets/../index.html", "/.hidden", "/.git/config", "/link.txt",
        "/etc/passwd", "/index.html/", "index.html", "/INDEX.HTML", "/index.html%00"}) {
    EXPECT_EQ(files.Reply(path, "").status, 404) << path;
  }
  std::filesystem::remove(folder_ / "../outside.txt");
}

TEST_F(WebFilesTest, RefusesAFolderWithoutAnIndex) {
  std::filesystem::remove(folder_ / "index.html");
  EXPECT_THAT(WebFiles::Load(folder_.string()).status(),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("index.html")));
  EXPECT_THAT(WebFiles::Load((folder_ / "missing").string()).status(),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("index.html")));
}

TEST_F(WebFilesTest, MoreThanFitsIsRefused) {
  Write("large.bin", "");
  std::filesystem::resize_file(folder_ / "large.bin", uintmax_t{300} << 20);
  EXPECT_THAT(WebFiles::Load(folder_.string()).status(),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("256 MiB")));
}

}  // namespace
}  // namespace tissueform
