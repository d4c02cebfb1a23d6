// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/certificates.h"

#include <filesystem>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

namespace tissueform::testing {
namespace {

using std::chrono::hours;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const std::chrono::system_clock::time_point kNow = std::chrono::system_clock::now();

class CertificatesTest : public ::testing::Test {
 protected:
  const TestAuthority authority_;
};

TEST_F(CertificatesTest, AnIdentitySaysItsNamesAndItsEnd) {
  const TestIdentity identity = authority_.Issue({.ends = hours(48)});
  ASSERT_OK_AND_ASSIGN(const CertificateFacts facts,
                       CheckIdentity(identity.certificate, identity.key, kNow));
  EXPECT_THAT(facts.names, ElementsAre("localhost", "127.0.0.1"));
  EXPECT_GT(facts.not_after, kNow + hours(47));
  EXPECT_LT(facts.not_after, kNow + hours(49));
}

TEST_F(CertificatesTest, WithoutAlternativesTheCommonNameIsTheName) {
  ASSERT_OK_AND_ASSIGN(
      const CertificateFacts facts,
      ReadCertificate(authority_.Issue({.name = "gateway", .alternatives = ""}).certificate));
  EXPECT_THAT(facts.names, ElementsAre("gateway"));
}

TEST_F(CertificatesTest, TheKeyOfAnotherCertificateIsRefused) {
  EXPECT_THAT(CheckIdentity(authority_.Issue().certificate, authority_.Issue().key, kNow),
              StatusIs(kInvalid, HasSubstr("does not belong")));
}

TEST_F(CertificatesTest, AnExpiredCertificateIsRefusedWithItsDate) {
  const TestIdentity identity = authority_.Issue({.begins = hours(-48), .ends = hours(-24)});
  EXPECT_THAT(CheckIdentity(identity.certificate, identity.key, kNow),
              StatusIs(kInvalid, AllOf(HasSubstr("expired on 20"), HasSubstr("UTC"))));
}

TEST_F(CertificatesTest, RefusesACertificateThatIsNotYetValid) {
  const TestIdentity identity = authority_.Issue({.begins = hours(24), .ends = hours(48)});
  EXPECT_THAT(CheckIdentity(identity.certificate, identity.key, kNow),
              StatusIs(kInvalid, HasSubstr("valid from")));
}

TEST_F(CertificatesTest, RefusesTextThatIsNotPem) {
  const TestIdentity identity = authority_.Issue();
  EXPECT_THAT(CheckIdentity("nonsense", identity.key, kNow),
              StatusIs(kInvalid, HasSubstr("no certificate in PEM")));
  EXPECT_THAT(CheckIdentity(identity.certificate, "nonsense", kNow),
              StatusIs(kInvalid, HasSubstr("no private key")));
  EXPECT_THAT(CheckIdentity(identity.key, identity.certificate, kNow), StatusIs(kInvalid));
  EXPECT_THAT(CheckAuthorities("nonsense"), StatusIs(kInvalid, HasSubstr("no certificate in PEM")));
  EXPECT_THAT(CheckAuthorities(""), StatusIs(kInvalid));
}

TEST_F(CertificatesTest, AChainThatBreaksOffIsRefused) {
  const std::string second = TestAuthority("Another").certificate();
  EXPECT_THAT(CheckAuthorities(authority_.certificate() + second), IsOk());
  EXPECT_THAT(CheckAuthorities(authority_.certificate() + second.substr(0, second.size() / 2)),
              StatusIs(kInvalid, HasSubstr("certificate 2 cannot be read")));
}

TEST_F(CertificatesTest, FilesAreBounded) {
  const std::filesystem::path folder = EmptyTestFolder("certificates");
  WriteTestFile(folder / "large", std::string(kMaxPemBytes + 1, 'a'));
  WriteTestFile(folder / "empty", "");
  EXPECT_THAT(ReadPemFile(folder / "large"), StatusIs(kInvalid, HasSubstr("1 MiB")));
  EXPECT_THAT(ReadPemFile(folder / "empty"), StatusIs(kInvalid, HasSubstr("empty")));
  EXPECT_THAT(ReadPemFile(folder), ::testing::Not(IsOk()));
  EXPECT_THAT(ReadPemFile(folder / "none"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("cannot be read")));
  std::filesystem::remove_all(folder);
}

TEST_F(CertificatesTest, TlsFilesAreReadAndCheckedByName) {
  const std::filesystem::path folder = EmptyTestFolder("tls_files");
  const TestFiles own = authority_.IssueFiles(folder, "own");
  const TestFiles other = authority_.IssueFiles(folder, "other");
  const auto check = [](const TlsFiles& files) {
    const auto contents = ReadTlsFiles(files);
    return contents.ok() ? CheckTlsContents(files, *contents).status() : contents.status();
  };
  EXPECT_THAT(check({}), IsOk());
  EXPECT_THAT(check({own.certificate, own.key, own.roots}), IsOk());
  EXPECT_THAT(check({.certificate = own.certificate}), StatusIs(kInvalid, HasSubstr("both")));
  EXPECT_THAT(check({.key = own.key}), StatusIs(kInvalid, HasSubstr("both")));
  EXPECT_THAT(check({.authorities = own.key}), StatusIs(kInvalid, HasSubstr(own.key)));
  EXPECT_THAT(check({own.certificate, other.key}), StatusIs(kInvalid, HasSubstr(own.certificate)));
  EXPECT_THAT(check({.authorities = folder / "none"}), StatusIs(absl::StatusCode::kNotFound));
  const TlsFiles alone = {.authorities = own.roots};
  EXPECT_EQ(*CheckTlsContents(alone, *ReadTlsFiles(alone)),
            std::chrono::system_clock::time_point());
  const TlsFiles whole = {own.certificate, own.key, own.roots};
  EXPECT_EQ(*CheckTlsContents(whole, *ReadTlsFiles(whole)),
            ReadCertificate(ReadTlsFiles(whole)->certificate)->not_after);
  std::filesystem::remove_all(folder);
}

TEST_F(CertificatesTest, RefusesAWorldReadableKey) {
  const std::filesystem::path folder = EmptyTestFolder("secret");
  const TestFiles files = authority_.IssueFiles(folder, "server");
  EXPECT_THAT(ReadSecretPemFile(files.key), IsOk());
  std::filesystem::permissions(files.key, std::filesystem::perms::others_read,
                               std::filesystem::perm_options::add);
  EXPECT_THAT(ReadSecretPemFile(files.key),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("chmod")));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace tissueform::testing
