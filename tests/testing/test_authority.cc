// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/testing/test_authority.h"

#include <atomic>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <unistd.h>
#include <utility>

#include <openssl/bio.h>
#include <openssl/ec.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

namespace tissueform::testing {
namespace {

using Key = std::unique_ptr<EVP_PKEY, void (*)(EVP_PKEY*)>;
using Certificate = std::unique_ptr<X509, void (*)(X509*)>;

void Demand(bool fine) {
  if (fine) return;
  std::fputs("test_authority: OpenSSL refused\n", stderr);
  std::abort();
}

Key MakeKey() {
  Key key(EVP_EC_gen("P-256"), EVP_PKEY_free);
  Demand(key != nullptr);
  return key;
}

template <typename Write>
std::string PemOf(const Write& write) {
  const std::unique_ptr<BIO, int (*)(BIO*)> out(BIO_new(BIO_s_mem()), BIO_free);
  Demand(write(out.get()) == 1);
  char* data = nullptr;
  const auto size = static_cast<size_t>(BIO_get_mem_data(out.get(), &data));
  return {data, size};
}

void Extend(X509* certificate, X509* issuer, int what, const std::string& value) {
  X509V3_CTX context;
  X509V3_set_ctx(&context, issuer, certificate, nullptr, nullptr, 0);
  X509_EXTENSION* extension = X509V3_EXT_conf_nid(nullptr, &context, what, value.c_str());
  Demand(extension != nullptr && X509_add_ext(certificate, extension, -1) == 1);
  X509_EXTENSION_free(extension);
}

Certificate Unsigned(const TestCertificate& content, EVP_PKEY* key) {
  static std::atomic<int> serial = 1;
  Certificate certificate(X509_new(), X509_free);
  X509_set_version(certificate.get(), X509_VERSION_3);
  ASN1_INTEGER_set(X509_get_serialNumber(certificate.get()), serial++);
  X509_gmtime_adj(X509_getm_notBefore(certificate.get()),
                  std::chrono::seconds(content.begins).count());
  X509_gmtime_adj(X509_getm_notAfter(certificate.get()),
                  std::chrono::seconds(content.ends).count());
  X509_set_pubkey(certificate.get(), key);
  X509_NAME_add_entry_by_txt(X509_get_subject_name(certificate.get()), "CN", MBSTRING_UTF8,
                             reinterpret_cast<const unsigned char*>(content.name.c_str()), -1, -1,
                             0);
  return certificate;
}

std::string CertificatePem(X509* certificate) {
  return PemOf([&](BIO* out) { return PEM_write_bio_X509(out, certificate); });
}

}  // namespace

struct TestAuthority::Secret {
  Key key = MakeKey();
  Certificate certificate{nullptr, X509_free};
};

TestAuthority::TestAuthority(const std::string& name) : secret_(std::make_unique<Secret>()) {
  Certificate own = Unsigned({.name = name}, secret_->key.get());
  X509_set_issuer_name(own.get(), X509_get_subject_name(own.get()));
  Extend(own.get(), own.get(), NID_basic_constraints, "critical,CA:TRUE");
  Extend(own.get(), own.get(), NID_subject_key_identifier, "hash");
  Demand(X509_sign(own.get(), secret_->key.get(), EVP_sha256()) > 0);
  own_ = CertificatePem(own.get());
  secret_->certificate = std::move(own);
}

TestAuthority::~TestAuthority() = default;

TestIdentity TestAuthority::Issue(const TestCertificate& content) const {
  const Key key = MakeKey();
  const Certificate issued = Unsigned(content, key.get());
  X509* const issuer = secret_->certificate.get();
  X509_set_issuer_name(issued.get(), X509_get_subject_name(issuer));
  if (!content.alternatives.empty()) {
    Extend(issued.get(), issuer, NID_subject_alt_name, content.alternatives);
  }
  Demand(X509_sign(issued.get(), secret_->key.get(), EVP_sha256()) > 0);
  return {.certificate = CertificatePem(issued.get()),
          .key = PemOf([&](BIO* out) {
            return PEM_write_bio_PrivateKey(out, key.get(), nullptr, nullptr, 0, nullptr, nullptr);
          })};
}

TestFiles TestAuthority::IssueFiles(const std::filesystem::path& folder, const std::string& name,
                                    const TestCertificate& content) const {
  const TestIdentity identity = Issue(content);
  const TestFiles files = {.certificate = folder / (name + ".pem"),
                           .key = folder / (name + ".key"),
                           .roots = folder / (name + "-ca.pem")};
  WriteTestFile(files.key, identity.key);
  std::filesystem::permissions(
      files.key, std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  WriteTestFile(files.certificate, identity.certificate);
  WriteTestFile(files.roots, own_);
  return files;
}

std::filesystem::path EmptyTestFolder(const std::string& name) {
  const char* const scratch = std::getenv("TEST_TMPDIR");
  const std::filesystem::path folder =
      std::filesystem::path(scratch == nullptr ? "/tmp" : scratch) /
      (name + "-" + std::to_string(getpid()));
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  return folder;
}

void WriteTestFile(const std::filesystem::path& path, const std::string& content) {
  std::ofstream(path, std::ios::binary | std::ios::trunc) << content;
}

}  // namespace tissueform::testing
