// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>
#include <zip.h>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <sys/stat.h>

#include "core/base/archive/stored_zip.h"
#include "core/base/archive/unpacked_zip.h"
#include "core/base/archive/zip_names.h"
#include "core/base/archive/zip_reader.h"
#include "tests/testing/file_bytes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;
using testing::BytesOfFile;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::IsOk;

struct ZipEntry {
  std::string name;
  std::string contents;
  bool encrypted = false;
  bool link = false;
};

// Written by libzip, and so as other programs write it.
void WriteZip(const std::string& path, const std::vector<ZipEntry>& entries) {
  int error = 0;
  zip_t* archive = zip_open(path.c_str(), ZIP_CREATE | ZIP_TRUNCATE, &error);
  ASSERT_NE(archive, nullptr);
  for (const ZipEntry& entry : entries) {
    zip_source_t* source =
        zip_source_buffer(archive, entry.contents.data(), entry.contents.size(), 0);
    const zip_int64_t index = zip_file_add(archive, entry.name.c_str(), source, ZIP_FL_ENC_UTF_8);
    ASSERT_GE(index, 0);
    const auto at = static_cast<zip_uint64_t>(index);
    if (entry.encrypted) {
      ASSERT_EQ(zip_file_set_encryption(archive, at, ZIP_EM_AES_256, "word"), 0);
    }
    if (entry.link) {
      zip_file_set_external_attributes(archive, at, 0, ZIP_OPSYS_UNIX,
                                       zip_uint32_t{S_IFLNK | 0777} << 16);
    }
  }
  ASSERT_EQ(zip_close(archive), 0);
}

class ZipTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        fs::path(::testing::TempDir()) /
        (std::string("zip_") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string Path(const std::string& name) const { return (folder_ / name).string(); }

  // The message of the refusal, after which nothing is left beside the zip.
  std::string Refusal(const std::vector<ZipEntry>& entries, const ZipLimits& limits = {}) const {
    if (!entries.empty()) WriteZip(Path("in.zip"), entries);
    const absl::StatusOr<UnpackedZip> zip =
        UnpackedZip::Unpack(Path("in.zip"), folder_.string(), limits);
    EXPECT_FALSE(zip.ok());
    EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
    const std::string message(zip.status().message());
    EXPECT_THAT(message, HasSubstr("cannot use the zip: "));
    EXPECT_EQ(message.find('\n'), std::string::npos);
    return message;
  }

  fs::path folder_;
};

TEST_F(ZipTest, FilesComeOutInAPrivateFolderThatGoes) {
  WriteZip(Path("in.zip"), {{"series/1.dcm", "one"},
                            {"series/2.dcm", std::string(100'000, 'x')},
                            {"windows\\name.txt", "three"},
                            {"empty", ""},
                            {"__MACOSX/._1.dcm", "clutter"},
                            {"series/.DS_Store", "clutter"}});
  std::string folder;
  {
    const absl::StatusOr<UnpackedZip> zip = UnpackedZip::Unpack(Path("in.zip"), folder_.string());
    ASSERT_THAT(zip.status(), IsOk());
    folder = zip->folder();
    EXPECT_EQ(fs::status(folder).permissions(), fs::perms::owner_all);
    EXPECT_EQ(BytesOfFile(folder + "/series/1.dcm"), "one");
    EXPECT_EQ(BytesOfFile(folder + "/series/2.dcm").size(), 100'000);
    EXPECT_EQ(BytesOfFile(folder + "/windows/name.txt"), "three");
    EXPECT_TRUE(fs::exists(folder + "/empty"));
    EXPECT_FALSE(fs::exists(folder + "/__MACOSX"));
    EXPECT_FALSE(fs::exists(folder + "/series/.DS_Store"));
  }
  EXPECT_FALSE(fs::exists(folder));
}

TEST_F(ZipTest, StoredZipHoldsItsMembers) {
  const absl::StatusOr<std::string> bytes =
      StoredZip({{"surfaces.json", "{}"}, {"a/skin.stl", std::string("\0\1", 2)}, {"empty", ""}});
  ASSERT_THAT(bytes.status(), IsOk());
  std::ofstream(Path("in.zip"), std::ios::binary) << *bytes;
  const absl::StatusOr<UnpackedZip> zip = UnpackedZip::Unpack(Path("in.zip"), folder_.string());
  ASSERT_THAT(zip.status(), IsOk());
  EXPECT_EQ(BytesOfFile(zip->folder() + "/surfaces.json"), "{}");
  EXPECT_EQ(BytesOfFile(zip->folder() + "/a/skin.stl"), std::string("\0\1", 2));
  EXPECT_TRUE(fs::exists(zip->folder() + "/empty"));
}

TEST_F(ZipTest, NamesThatLeadElsewhereAreRefused) {
  for (const char* name : {"../evil", "a/../../evil", "a\\..\\..\\evil"}) {
    EXPECT_THAT(Refusal({{"good", "x"}, {name, "x"}}), HasSubstr("entry 2 has a name with \"..\""));
  }
  for (const char* name : {"/tmp/evil", "C:\\evil", "\\\\server\\evil"}) {
    EXPECT_THAT(Refusal({{name, "x"}}), HasSubstr("absolute"));
  }
  EXPECT_THAT(Refusal({{"a\nb", "x"}}), HasSubstr("not text"));
  EXPECT_THAT(Refusal({{"link", "/etc/passwd", false, true}}), HasSubstr("a link or a device"));
  EXPECT_THAT(Refusal({{"a/b", "x"}, {"a\\b", "y"}}), HasSubstr("name of an earlier one"));
  EXPECT_THAT(Refusal({{"a", "x"}, {"a/b", "y"}}), HasSubstr("folder that is a file"));
  EXPECT_FALSE(fs::exists(folder_.parent_path() / "evil"));
}

TEST_F(ZipTest, ZipsInZipsAndEncryptedOnesAreRefused) {
  WriteZip(Path("in.zip"), {{"a", "x"}});
  EXPECT_THAT(Refusal({{"inner.dat", BytesOfFile(Path("in.zip"))}}), HasSubstr("is a zip itself"));
  EXPECT_THAT(Refusal({{"a", "secret", true}}), HasSubstr("is encrypted"));
}

TEST_F(ZipTest, LimitsHold) {
  const std::string zeros(size_t{70} << 20, '\0');
  EXPECT_THAT(Refusal({{"bomb", zeros}}), HasSubstr("zip bomb"));
  EXPECT_THAT(Refusal({{"a", "xx"}, {"b", "yy"}}, {.max_bytes = 3}),
              HasSubstr("more than 3 bytes"));
  EXPECT_THAT(Refusal({{"a", "xx"}, {"b", "yy"}}, {.max_files = 1}), HasSubstr("holds 2 files"));
  EXPECT_THAT(Refusal({{"a/b/c", "x"}}, {.max_folder_depth = 2}), HasSubstr("more than 2 folders"));
  // Small files may compress as well as they can.
  WriteZip(Path("in.zip"), {{"labels.raw", zeros.substr(0, size_t{60} << 20)}});
  EXPECT_THAT(UnpackedZip::Unpack(Path("in.zip"), folder_.string()).status(), IsOk());
}

TEST_F(ZipTest, DamagedAndEmptyZipsAreRefused) {
  std::string random;
  for (unsigned i = 1; random.size() < 50'000; i = i * 1664525 + 1013904223) {
    random.push_back(static_cast<char>(i >> 24));
  }
  WriteZip(Path("in.zip"), {{"a", random}});
  const std::string whole = BytesOfFile(Path("in.zip"));
  const auto write = [&](const std::string& bytes) {
    std::ofstream(Path("in.zip"), std::ios::binary) << bytes;
  };
  write(whole.substr(0, whole.size() / 2));
  EXPECT_THAT(Refusal({}), HasSubstr("it is damaged or not complete"));
  std::string flipped = whole;
  flipped[whole.size() / 2] = static_cast<char>(flipped[whole.size() / 2] ^ 0x55);
  write(flipped);
  EXPECT_THAT(Refusal({}), HasSubstr("entry 1 is damaged or not complete"));
  write("no zip at all");
  EXPECT_THAT(Refusal({}), HasSubstr("damaged"));
  write(std::string("PK\x05\x06", 4) + std::string(18, '\0'));
  EXPECT_THAT(Refusal({}), HasSubstr("it is empty"));
  EXPECT_THAT(Refusal({{"only/", ""}}), HasSubstr("it is empty"));
}

TEST_F(ZipTest, IsKnownByNameOrContents) {
  WriteZip(Path("in.dat"), {{"a", "x"}});
  std::ofstream(Path("text.ZIP")) << "x";
  std::ofstream(Path("plain.nii")) << "x";
  EXPECT_TRUE(IsZip(Path("in.dat")));
  EXPECT_TRUE(IsZip(Path("text.ZIP")));
  EXPECT_FALSE(IsZip(Path("plain.nii")));
  EXPECT_FALSE(IsZip(folder_.string()));
}

TEST(ZipNamesTest, PartsAreThoseOfBothSeparators) {
  EXPECT_THAT(*PartsOfZipName("a/./b\\c.dcm", 16), ElementsAre("a", "b", "c.dcm"));
  EXPECT_THAT(*PartsOfZipName("Müller Köpfe/1", 16), ElementsAre("Müller Köpfe", "1"));
  EXPECT_THAT(*PartsOfZipName("..a/b..", 16), ElementsAre("..a", "b.."));
  EXPECT_FALSE(PartsOfZipName("", 16).ok());
  EXPECT_FALSE(PartsOfZipName(std::string(300, 'a'), 16).ok());
}

}  // namespace
}  // namespace tissueform
